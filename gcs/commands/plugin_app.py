"""``gcs laws``, ``gcs triggers`` and ``gcs guidance``: one command for each kind of plug-in."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated

import typer

from gcs.commands.options import JsonOption
from gcs.commands.plugins import PluginKind, show, show_header, show_list


def plugin_app(kind: PluginKind, name: str, several: str, examples: Sequence[str]) -> typer.Typer:
    """Return the command that lists what is of a kind, and shows one.

    Args:
        kind: What is listed.
        name: Name of the command.
        several: Plural of the kind's noun.
        examples: Arguments of the command that its help shows.
    """
    written = "\n".join(f"- gcs {name} {one}".rstrip() for one in examples)
    epilog = (
        f"Examples:\n\n{written}\n\nOther packages register theirs in the group of entry points "
        f"{kind.group}.\n\nExit status: 0 shown, 2 bad input.\n"
    )
    app = typer.Typer(invoke_without_command=True, epilog=epilog)
    command = partial(app.command, epilog=epilog)
    named = typer.Argument(
        help=f"Name of a {kind.noun}, or FILE.py:CLASS.",
        metavar=kind.noun.split()[-1].upper(),
        show_default=False,
    )

    @app.callback(help=f"List the {several}, ours and other packages', or show one.")
    def main(context: typer.Context, json: JsonOption = False) -> None:
        if context.invoked_subcommand is None:
            show_list(kind, as_json=json)

    @command(
        "show",
        help=f"Show where a {kind.noun} comes from, what it does, and its keys with units and "
        "defaults.",
    )
    def show_one(name: Annotated[str, named]) -> None:
        show(kind, name)

    @command(
        help=f"Print parameters and state of a {kind.noun} as C structs, for one that is a shared "
        "library."
    )
    def header(
        name: Annotated[str | None, named] = None,
        folder: Annotated[
            bool, typer.Option("--folder", help=f"Print the folder of {kind.header} instead.")
        ] = False,
    ) -> None:
        show_header(kind, name, folder=folder)

    return app
