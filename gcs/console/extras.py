"""Loading of what is an extra: operators and vehicles do without pandas, servers and reports."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from gcs.console.errors import BadInput
from mavlink_defs.extras import install_command

LAB_PACKAGES = ("SALib", "distributed", "jinja2")
"""What campaigns and reports import besides what the core brings: the extra `lab`."""
DESIGN_PACKAGES = ("scipy",)
"""What trims and designs import, and no flight: of the extra `lab` as well."""
TOOLS_PACKAGES = ("pymavlink",)
"""What generates code for the dialect: the extra `tools`."""
WEB_PACKAGES = ("aiohttp", "textual_serve")
"""What `gcs web` imports: the extra `web`."""


def load_package(name: str, purpose: str, extra: str = "python") -> Any:
    """Import a package of an extra.

    Args:
        name: The package, as it is imported.
        purpose: What needs it, for the message.
        extra: The extra that brings it.

    Raises:
        BadInput: It is not installed.
    """
    check_packages((name,), purpose, extra)
    return import_module(name)


def load_lab(module: str, purpose: str | None = None) -> Any:
    """Import a module of `ftc_lab`, by its name there.

    Nothing else of `gcs` may import what lies in `ftc_lab`.

    Args:
        module: The module.
        purpose: What needs the packages of the extra `lab`, for the message; None: it does not.

    Raises:
        BadInput: One of them is not installed.
    """
    if purpose is not None:
        check_packages(LAB_PACKAGES, purpose, "lab")
    return import_module(f"ftc_lab.{module}")


def missing(packages: tuple[str, ...]) -> list[str]:
    """Return the packages among some that are not installed."""
    return [package for package in packages if find_spec(package) is None]


def check_packages(packages: tuple[str, ...], purpose: str, extra: str) -> None:
    """Check that packages are installed.

    Args:
        packages: As they are imported.
        purpose: What needs them, for the message.
        extra: The extra that brings them.

    Raises:
        BadInput: Some are not.
    """
    if absent := missing(packages):
        text = f"{purpose} needs {', '.join(absent)}, not installed here"
        raise BadInput(text, f"{install_command(extra)} (the extra `{extra}`)")
