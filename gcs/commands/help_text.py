"""How the help of `gcs` looks: an option and its value in one column, commands before options.

The columns of typer's own help leave a third of a narrow terminal to the texts.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from inspect import cleandoc
from typing import Any

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.panel import Panel
from rich.text import Text

from gcs.console.terminal import bulleted, console_of, names_and_texts

_WIDEST_NAME = 29


def print_help(command: Any, context: Any) -> None:
    """Print the help of a command: usage, text, its commands or arguments and options, examples.

    A group that runs one of its commands by default has it as `default`: its options are shown.
    """
    console = console_of(stderr=False, pipe_has_edge=True)
    usage = Text(command.get_usage(context), style="bold yellow")
    console.print(Padding(usage, (0, 1, 1, 1)))
    if command.help:
        console.print(Padding(_prose(cleandoc(command.help)), (0, 1, 1, 1)))
    options = getattr(command, "default", command)
    for panel in (*_of_commands(command, context), *_of_parameters(options, context)):
        console.print(panel)
    if options.epilog:
        console.print(Padding(_prose(cleandoc(options.epilog)), (0, 1)))


def _of_commands(command: Any, context: Any) -> Iterator[Panel]:
    names = command.list_commands(context) if hasattr(command, "commands") else ()
    shown = [one for name in names if not (one := command.commands[name]).hidden]
    widest = max((len(one.name) for one in shown), default=0)
    for title, panel in _by_panel(shown, "Commands").items():
        rows = [
            (one.name, one.short_help or (one.help or "").partition("\n\n")[0]) for one in panel
        ]
        yield _panel(title, rows, widest)


def _of_parameters(command: Any, context: Any) -> Iterator[Panel]:
    shown = [one for one in command.get_params(context) if not one.hidden]
    arguments = [one for one in shown if one.param_type_name == "argument"]
    options = [one for one in shown if one.param_type_name == "option"]
    panels = _by_panel(arguments, "Arguments") | _by_panel(options, "Options")
    for title, panel in panels.items():
        rows = [one.get_help_record(context) for one in panel]
        yield _panel(title, rows, min(max(len(name) for name, _ in rows), _WIDEST_NAME))


def _by_panel(shown: Iterable[Any], default: str) -> dict[str, list[Any]]:
    """Return what is shown by the titles of its panels, each where its first entry is."""
    panels: defaultdict[str, list[Any]] = defaultdict(list)
    for one in shown:
        panels[one.rich_help_panel or default].append(one)
    return panels


def _panel(title: str, rows: Iterable[tuple[str, str]], width: int) -> Panel:
    table = names_and_texts(((name.strip(), _prose(text)) for name, text in rows), width)
    return Panel(table, title=title, title_align="left", border_style="dim")


def _prose(text: str) -> RenderableType:
    """Return a text of help: paragraphs and lists, with `code` in them.

    Rich's own Markdown, which looks the same, takes as long to import as to show the help.
    """
    shown: list[RenderableType] = []
    for block in re.split(r"\n\s*\n", text.strip()):
        shown += [Text()] if shown else []
        if not block.startswith("- "):
            shown.append(_paragraph(block))
            continue
        items = re.split(r"^- ", block, flags=re.MULTILINE)[1:]
        shown.append(bulleted(map(_paragraph, items)))
    return Group(*shown)


def _paragraph(text: str) -> Text:
    parts = re.sub(r"\s*\n\s*", " ", text.strip()).split("`")
    return Text.assemble(*((part, "markdown.code" * (k % 2)) for k, part in enumerate(parts)))
