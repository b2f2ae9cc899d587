"""What is an extra of the package, and how it is installed."""

import re

_OF_EXTRA = re.compile(r"(?P<package>[^;]+);.*extra == .(?P<extra>\w+).")


def install_command(extra: str) -> str:
    """Return the command that installs what an extra brings, however ftc-sitl was installed."""
    from importlib.metadata import requires  # takes time, of every command

    found = map(_OF_EXTRA.match, requires("ftc-sitl") or ())
    named = [one["package"].strip() for one in found if one is not None and one["extra"] == extra]
    return f"pip install {' '.join(map(repr, named))}"
