"""Errors of the command line, as exceptions."""

import contextlib
from collections.abc import Iterator

from gcs.errors import BadInput, GcsError
from mavlink_defs.config.models import ConfigError
from mavlink_defs.runtime.foreign import PluginError


@contextlib.contextmanager
def python_errors() -> Iterator[None]:
    """Raise what the command line prints as an error of `gcs.errors`, with its hint as a note."""
    try:
        yield
    except (ConfigError, PluginError) as problem:
        raise BadInput(str(problem)) from None
    except GcsError as problem:
        note = f"hint: {problem.hint}"
        if problem.hint and note not in getattr(problem, "__notes__", ()):
            problem.add_note(note)
        raise
