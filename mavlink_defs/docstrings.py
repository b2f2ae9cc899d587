"""What docstrings say of parameters and attributes, for help pages and references."""

import inspect
import re


def texts_of(docstring: str | None, section: str) -> dict[str, str]:
    """Return the texts of a section of a docstring, such as "Args", by name."""
    listed = inspect.cleandoc(docstring or "").partition(f"\n\n{section}:\n")[2]
    _, *parts = re.split(r"^    (\w+): ", listed.partition("\n\n")[0], flags=re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in zip(*[iter(parts)] * 2, strict=True)}
