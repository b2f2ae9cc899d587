"""``gcs laws [show|header]``: the control laws that scenarios can choose."""

from typing import Annotated

import typer

from ftc_autopilot.control.laws import LAWS, law_of
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.plugins.loading import LAWS as GROUP
from gcs.commands import plugins

EPILOG = """
Examples:

- gcs laws
- gcs laws show surviving
- gcs laws show my_law.py:MyLaw
- gcs laws header my_law.py:MyLaw > my_law_parameters.h

Other packages register theirs in the group of entry points ftc_sitl.laws.

Exit status: 0 shown, 2 bad input.
"""

app = typer.Typer(
    help="List the control laws, ours and other packages', or show one.",
    invoke_without_command=True,
    epilog=EPILOG,
)

_KIND = plugins.Kind(
    "law", "ftc_law.h", GROUP, dict(LAWS), law_of, LawParameters, lambda law: law.record()
)
_Name = Annotated[
    str, typer.Argument(help="Name of a law, or FILE.py:CLASS.", metavar="LAW", show_default=False)
]


@app.callback()
def laws(
    context: typer.Context,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the control laws, ours and other packages', or show one."""
    if context.invoked_subcommand is None:
        plugins.show_list(_KIND, as_json=json)


@app.command(epilog=EPILOG)
def show(law: _Name) -> None:
    """Show where a law comes from, what it does, and its keys with units and defaults."""
    plugins.show(_KIND, law)


@app.command(epilog=EPILOG)
def header(
    law: Annotated[
        str | None,
        typer.Argument(help="Name of a law, or FILE.py:CLASS.", metavar="LAW", show_default=False),
    ] = None,
    folder: Annotated[
        bool, typer.Option("--folder", help="Print the folder of ftc_law.h instead.")
    ] = False,
) -> None:
    """Print parameters and state of a law as C structs, for one that is a shared library."""
    plugins.header(_KIND, law, folder=folder)
