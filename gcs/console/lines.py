"""Lines and JSON that commands print: what most of them say, without the import of rich."""

import sys
from typing import Any

from mavlink_defs.visible import visible_lines


def print_line(text: str, *, stderr: bool = False) -> None:
    """Print a line, or lines, which a terminal may wrap but nothing folds."""
    print(visible_lines(text), file=sys.stderr if stderr else sys.stdout, flush=True)


def print_json(value: Any, indent: int | None = None) -> None:
    """Print a value as JSON; NaN and infinity become null."""
    import json  # takes time, of every command

    text = json.dumps(_finite(value), allow_nan=False, indent=indent)
    print(text.replace("\x7f", "\\u007f"), flush=True)  # the control character json lets pass


def _finite(value: Any) -> Any:
    match value:
        case dict():
            return {key: _finite(inner) for key, inner in value.items()}
        case list() | tuple():
            return [_finite(inner) for inner in value]
        case float() if value - value != 0.0:
            return None
    return value
