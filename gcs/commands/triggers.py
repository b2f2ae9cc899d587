"""``gcs triggers [show|header]``: the event triggers that scenarios can choose."""

from typing import Annotated

import typer

from ftc_autopilot.control.triggers import TRIGGERS, trigger_of
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.control.triggers.plugin import own_record
from ftc_autopilot.plugins.loading import TRIGGERS as GROUP
from gcs.commands import plugins

EPILOG = """
Examples:

- gcs triggers
- gcs triggers show dynamic
- gcs triggers show my_trigger.py:EveryNth

Other packages register theirs in the group of entry points ftc_sitl.triggers.

Exit status: 0 shown, 2 bad input.
"""

app = typer.Typer(
    help="List the event triggers, ours and other packages', or show one.",
    invoke_without_command=True,
    epilog=EPILOG,
)

_KIND = plugins.Kind(
    "trigger", "ftc_trigger.h", GROUP, dict(TRIGGERS), trigger_of, TriggerParameters, own_record
)
_Name = Annotated[
    str,
    typer.Argument(
        help="Name of a trigger, or FILE.py:CLASS.", metavar="TRIGGER", show_default=False
    ),
]


@app.callback()
def triggers(
    context: typer.Context,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the event triggers, ours and other packages', or show one."""
    if context.invoked_subcommand is None:
        plugins.show_list(_KIND, as_json=json)


@app.command(epilog=EPILOG)
def show(trigger: _Name) -> None:
    """Show where a trigger comes from, what it does, and its keys with units and defaults."""
    plugins.show(_KIND, trigger)


@app.command(epilog=EPILOG)
def header(
    trigger: Annotated[
        str | None,
        typer.Argument(
            help="Name of a trigger, or FILE.py:CLASS.", metavar="TRIGGER", show_default=False
        ),
    ] = None,
    folder: Annotated[
        bool, typer.Option("--folder", help="Print the folder of ftc_trigger.h instead.")
    ] = False,
) -> None:
    """Print parameters and state of a trigger as C structs, for one that is a shared library."""
    plugins.header(_KIND, trigger, folder=folder)
