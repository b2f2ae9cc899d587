"""Errors and warnings of the command line, as exceptions and warnings of Python."""

import contextlib
import warnings
from collections.abc import Iterable, Iterator

from gcs.console.errors import BadInput, GcsError
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


def warn(remarks: Iterable[str]) -> None:
    """Warn the caller of our caller of those remarks on a flight that are warnings."""
    from gcs.flights.remarks import WARNING, WarningRemark

    for text in remarks:
        if isinstance(text, WarningRemark):
            warnings.warn(text.removeprefix(WARNING), stacklevel=3)
