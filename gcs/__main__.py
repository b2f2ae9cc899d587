"""``gcs``: starts what a flight needs while the command line is still being imported."""

import sys

from gcs.fleet.forked import start_server_ahead

__all__ = ["main"]

_FLIES = ("fly", "up")
_STARTS_NOTHING = {"--in-process", "--help"}


def main() -> None:
    """Run the command line."""
    if sys.argv[1:2] and sys.argv[1] in _FLIES and not _STARTS_NOTHING & set(sys.argv):
        start_server_ahead()
    from gcs.cli import main as command_line

    command_line()


if __name__ == "__main__":
    main()
