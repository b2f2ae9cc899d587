"""``gcs guidance [show|header]``: the guidance laws that scenarios can choose."""

from typing import Annotated

import typer

from ftc_autopilot.guidance.laws import GUIDANCE_LAWS, guidance_of
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.guidance.laws.plugin import own_record
from ftc_autopilot.plugins.loading import GUIDANCE_LAWS as GROUP
from gcs.commands import plugins

EPILOG = """
Examples:

- gcs guidance
- gcs guidance show path
- gcs guidance show my_guidance.py:Gentle

Other packages register theirs in the group of entry points ftc_sitl.guidance_laws.

Exit status: 0 shown, 2 bad input.
"""

app = typer.Typer(
    help="List the guidance laws, ours and other packages', or show one.",
    invoke_without_command=True,
    epilog=EPILOG,
)

_KIND = plugins.Kind(
    "guidance law",
    "ftc_guidance.h",
    GROUP,
    dict(GUIDANCE_LAWS),
    guidance_of,
    GuidanceParameters,
    own_record,
)
_Name = Annotated[
    str,
    typer.Argument(
        help="Name of a guidance law, or FILE.py:CLASS.", metavar="LAW", show_default=False
    ),
]


@app.callback()
def guidance(
    context: typer.Context,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the guidance laws, ours and other packages', or show one."""
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
        typer.Argument(
            help="Name of a guidance law, or FILE.py:CLASS.", metavar="LAW", show_default=False
        ),
    ] = None,
    folder: Annotated[
        bool, typer.Option("--folder", help="Print the folder of ftc_guidance.h instead.")
    ] = False,
) -> None:
    """Print parameters and state of a law as C structs, for one that is a shared library."""
    plugins.header(_KIND, law, folder=folder)
