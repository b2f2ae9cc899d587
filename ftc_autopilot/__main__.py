"""``ftc-autopilot``: Ctrl-C ends it without a word while it is being imported."""

import signal


def main() -> None:
    """Run the autopilot process and exit."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:  # as a shell has it in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from ftc_autopilot.process import main as process

    process()


if __name__ == "__main__":
    main()
