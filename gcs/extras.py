"""Loading of what is an extra: operators and vehicles do without `gcs.lab`, pandas and servers."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from gcs.errors import BadInput

LAB_PACKAGES = ("SALib", "distributed", "jinja2")
"""What `gcs.lab` imports besides the dependencies of the core; extra `lab` in pyproject.toml."""


def load_package(name: str, purpose: str, extra: str = "python") -> Any:
    """Import a package of an extra.

    Args:
        name: The package, as it is imported.
        purpose: What needs it, for the message.
        extra: The extra that brings it.

    Raises:
        BadInput: It is not installed.
    """
    if find_spec(name) is None:
        raise BadInput(
            f"{purpose} needs {name}, not installed here", f"pip install 'ftc-sitl[{extra}]'"
        )
    return import_module(name)


def load_lab(module: str) -> Any:
    """Import a module of `gcs.lab`, by its name there.

    Nothing else of `gcs` may import what lies in `gcs.lab`.

    Raises:
        BadInput: A package that it needs is not installed.
    """
    missing = [package for package in LAB_PACKAGES if find_spec(package) is None]
    if missing:
        raise BadInput(
            f"campaigns, sweeps and baselines need {', '.join(missing)}, not installed here",
            "pip install 'ftc-sitl[lab]'",
        )
    return import_module(f"gcs.lab.{module}")
