"""``sitl-plant``: Ctrl-C ends it without a word while it is being imported."""

import signal


def main() -> None:
    """Run the plant process and exit."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:  # as a shell has it in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from sitl_plant.loop.process import main as process

    process()


if __name__ == "__main__":
    main()
