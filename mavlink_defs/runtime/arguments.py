"""Arguments of the processes."""

import argparse
from typing import NoReturn

from mavlink_defs.visible import visible


class ArgumentParser(argparse.ArgumentParser):
    """A parser that repeats wrong arguments with control characters made visible."""

    def error(self, message: str) -> NoReturn:
        """Print usage and the message, and exit with status 2."""
        super().error(visible(message))
