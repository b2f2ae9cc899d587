"""``gcs``: starts what a flight needs while the command line is still being imported."""

import signal
import sys

_FLIES = ("fly", "up")
_STARTS_NOTHING = {"--in-process", "--help"}


def main() -> None:
    """Run the command line.

    Until it is imported, Ctrl-C ends the program as a signal does, without a word.
    """
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:  # as a shell has it in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    import atexit
    import gc

    gc.set_threshold(20_000)  # imports make many objects, of which few are garbage
    atexit.register(gc.freeze)  # the process ends: nobody needs what a search for garbage frees
    if sys.argv[1:2] and sys.argv[1] in _FLIES and not _STARTS_NOTHING & set(sys.argv):
        from gcs.fleet.forked import start_server_ahead

        start_server_ahead()
    from gcs.commands.cli import main as command_line

    command_line()


if __name__ == "__main__":
    main()
