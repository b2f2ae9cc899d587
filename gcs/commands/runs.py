"""``gcs runs``: what was flown."""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.console import Group
from rich.text import Text
from typer.core import TyperGroup

from gcs.commands.common import QuietOption
from gcs.console.errors import BadInput
from gcs.console.lines import print_json, print_line
from gcs.console.outputs import check_file
from gcs.console.progress import working
from gcs.console.terminal import MAX_WORD, console_of, numbers, table_of, texts
from gcs.results.quantities import percent
from gcs.results.runs.index import list_runs
from gcs.results.runs.run import Run
from gcs.results.runs.scan import NOTE, scan
from gcs.results.runs.select import chosen, conditions_of, order_of
from mavlink_defs.config.output_files import write_text

if TYPE_CHECKING:
    from rich.table import Table

    from gcs.results.runs.index import Listing
    from gcs.results.runs.scan import Foreign

_RUNS = Path("runs")
_MANY = 100  # folders to read that are worth a bar
_NARROW, _NARROW_NAME = 110, 15
"""Terminals of fewer columns have names of at most so many in a line, broken at hyphens."""
_GOOD, _BAD = "green", "bold red"
_DONE = {"completed": _GOOD, "under_way": "yellow"}


class _ListByDefault(TyperGroup):
    """``gcs runs FOLDER`` is ``gcs runs list FOLDER``."""

    @property
    def default(self) -> Any:
        """The command that is meant without one."""
        return self.commands["list"]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take what is no command as arguments of the list."""
        if not args or (args[0] not in self.commands and args[0] != "--help"):
            args = ["list", *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=_ListByDefault,
    help="List what was flown, write a page of it, and add notes.\n\n"
    "`gcs runs FOLDER` is `gcs runs list FOLDER`, whose options are below.",
)


_FolderArgument = Annotated[
    Path, typer.Argument(help="Folder with the runs.", metavar="FOLDER", show_default=True)
]
_WhereOption = Annotated[
    list[str] | None,
    typer.Option(
        "--where", help="Only runs for which this is true; may be repeated.", metavar="CONDITION"
    ),
]
_SortOption = Annotated[
    str,
    typer.Option(
        "--sort", help="Key to sort by; a minus sign before it: largest first.", metavar="KEY"
    ),
]
_RebuildOption = Annotated[
    bool, typer.Option("--rebuild", help="Read every folder again, and make a new index.")
]


@app.command(name="list")
def list_(
    folder: _FolderArgument = _RUNS,
    where: _WhereOption = None,
    sort: _SortOption = "-time",
    number: Annotated[int, typer.Option("-n", "--number", min=0, metavar="NUMBER")] = 50,
    rebuild: _RebuildOption = False,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """List what was flown, the newest first: flights, fleets, campaigns, sweeps, baselines.

    Events are transmissions of one actuator's command; several can share a message. The IAE is the
    largest of all UAVs, of airspeed and of the worst angle. Figures of campaigns and sweeps are
    medians of the flights that completed, their IAEs the worst of them. A hidden index in FOLDER
    saves reading again what has not changed.

    Args:
        number: Most runs in the table; 0: all.
        as_json: Print all of them as JSON, nothing else.

    Examples:
        - gcs runs
        - gcs runs --where law=surviving --where 'saving < 0.9' --sort iae_roll
        - gcs runs --where kind=campaign --where outcome!=completed
        - gcs runs results --json | jq '.runs[].name'

    --where and --sort take the keys of --json. Signs: =, !=, <, <=, >, >=, and ~ for "contains".

    Exit status: 0 listed, 2 bad input.
    """
    conditions = conditions_of(where or ())
    order_of(sort)
    found = _listing(folder, rebuild, quiet=as_json)
    runs = chosen(found.runs, conditions, sort)
    if as_json:
        foreign = [vars(one) for one in found.foreign]
        print_json({"runs": [run.to_json() for run in runs], "foreign": foreign}, indent=2)
        return
    console = console_of(stderr=False)
    shown = runs[:number] if number else runs
    if shown:
        console.print(_table(shown, console.width < _NARROW))
    console.print(_counts(len(shown), len(runs), len(found.runs), folder), soft_wrap=True)
    _name_foreign(found.foreign)


@app.command()
def note(
    run: Annotated[Path, typer.Argument(metavar="RUN")],
    text: Annotated[str, typer.Argument(metavar="TEXT")],
) -> None:
    """Write a note on a run, in place of an earlier one; it is stored in the run's folder.

    Args:
        run: Folder of the run.
        text: The note; an empty one removes it.

    Examples:
        - gcs runs note runs/first 'the one in the talk'
        - gcs runs note runs/first ''

    Exit status: 0 written, 1 the folder cannot be written, 2 bad input.
    """
    _check_run(run)
    path = run / NOTE
    if text.strip():
        write_text(path, text.strip() + "\n")
    else:
        path.unlink(missing_ok=True)
    print_line(f"{path} {'written' if text.strip() else 'removed'}", stderr=True)


@app.command()
def html(
    folder: _FolderArgument = _RUNS,
    out: Annotated[Path | None, typer.Option(metavar="FILE")] = None,
    where: _WhereOption = None,
    sort: _SortOption = "-time",
    compare: Annotated[list[Path] | None, typer.Option(metavar="RUN")] = None,
    figures: Annotated[int, typer.Option(min=0, metavar="NUMBER")] = 200,
    quiet: QuietOption = False,
) -> None:
    """Write one page with all runs: sortable, with thumbnails, differences and curves overlaid.

    The page fetches nothing and can be sent to anybody; its links to the folders work where it is.

    Args:
        out: The page; FOLDER/index.html by default.
        compare: Run that is compared when the page opens; may be repeated.
        figures: How many runs, from the first on, have a thumbnail, curves and all keys; the others
            have their row only.

    Examples:
        - gcs runs html
        - gcs runs html --where scenario~scenario1 --out page.html
        - gcs runs html --compare runs/first --compare runs/second

    Exit status: 0 written, 1 the file cannot be written, 2 bad input.
    """
    from gcs.results.runs.page import save_page

    path = out or folder / "index.html"
    if folder.is_dir():
        check_file(path)
    conditions = conditions_of(where or ())
    order_of(sort)
    found = _listing(folder, False, quiet=quiet)
    runs = chosen(found.runs, conditions, sort)
    names = [_name_in(found, folder, run) for run in compare or ()]
    first = {name: place for place, name in enumerate(names)}
    runs.sort(key=lambda run: first.get(run.name, len(first)))  # the others as they were
    with working(console_of(quiet=quiet), "drawing") as work:
        task = work.add("reading", min(figures, len(runs)), "runs")
        save_page(path, folder, runs, found.foreign, names, figures, task.advance)
    console_of(stderr=False, quiet=quiet).print(f"{len(runs)} runs in {path}", soft_wrap=True)
    if not quiet:
        _name_foreign(found.foreign)


def _listing(folder: Path, rebuild: bool, *, quiet: bool) -> "Listing":
    """List a folder; reading many shows how far it is."""
    console = console_of(quiet=quiet)
    with working(console) as work:
        task = None

        def show(done: int, total: int) -> None:
            nonlocal task
            if total >= _MANY:
                task = task or work.add(f"reading {folder}", total, "runs")
                task.advance("")

        return list_runs(folder, rebuild=rebuild, on_read=show)


def _check_run(run: Path) -> None:
    """Raise BadInput if a folder is no run."""
    try:
        is_run = any(getattr(one, "path", None) == run for one in scan(run))
    except OSError as problem:
        raise BadInput(f"{run} cannot be read: {problem.strerror}") from None
    if not is_run:
        raise BadInput(f"{run} is no run", "gcs runs lists them")


def _name_in(found: "Listing", folder: Path, run: Path) -> str:
    """Return the name of a run in a list, given its path or that name.

    Raises:
        BadInput: It is not in the list.
    """
    names = {one.name for one in found.runs}
    if str(run) in names:
        return str(run)
    name = str(run.resolve().relative_to(folder.resolve())) if _inside(run, folder) else ""
    if name in names:
        return name
    raise BadInput(f"--compare: {run} is no run in {folder}", "gcs runs lists them")


def _inside(run: Path, folder: Path) -> bool:
    return run.resolve().is_relative_to(folder.resolve())


def _table(runs: Sequence[Run], narrow: bool) -> "Table":
    table = table_of(
        texts("run"),
        texts("what was flown"),
        numbers("messages events saved"),
        numbers("IAE [m] [deg s]"),
        texts("outcome"),
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for run in runs:
        table.add_row(
            _name(run, narrow),
            _flown(run),
            f"{_count(run.messages)}\n{_count(run.events)}\n{percent(run.saving)}",
            _iae(run),
            _outcome(run),
        )
    return table


def _name(run: Run, narrow: bool) -> Text:
    name = "\n".join(wrap(run.name, _NARROW_NAME)) if narrow else run.name
    single = run.planned == 1 or run.flights in {None, 1}
    kind = run.kind if single else f"{run.kind} of {run.flights}"
    begun = datetime.fromisoformat(run.time).astimezone()
    return Text.assemble((name, "bold"), f"\n{kind}\n{begun:%Y-%m-%d %H:%M}")


def _flown(run: Run) -> Text:
    law = ", ".join(filter(None, (run.law, run.trigger)))
    path = Path(run.scenario)
    here = Path.cwd()
    scenario = str(path.relative_to(here)) if path.is_relative_to(here) else run.scenario
    lines = [scenario, *map(_foldable, run.changes), law, *run.faults]
    text = Text("\n".join(filter(None, lines)))
    return text.append(f"\nnote: {run.note}", "italic") if run.note else text


def _foldable(change: str) -> str:
    """Return a change with spaces where a narrow column may fold it: between values."""
    key, equals, value = change.partition("=")
    gap = " " if len(change.split(",", maxsplit=1)[0]) > MAX_WORD else ""
    return key + equals + gap + value.replace(",", ", ")


def _count(number: int | None) -> str:
    return "-" if number is None else str(number)


def _iae(run: Run) -> str:
    values = (run.iae.get("airspeed"), run.iae.get(run.worst_angle or ""))
    return "\n".join("-" if value is None else f"{value:.2f}" for value in values)


def _outcome(run: Run) -> Text:
    style = _DONE.get(run.outcome, _BAD)
    text = Text(run.outcome.replace("_", " "), style)
    if run.duration_s is not None:
        text.append(f"\n{run.duration_s:g} s", "default")
    if run.reason:
        text.append(f"\n{run.reason}", "default")
    return text.append(f"\nversion {run.version}", "dim") if run.version else text


def _counts(shown: int, chosen: int, total: int, folder: Path) -> str:
    text = f"{total} runs in {folder}" if total != 1 else f"1 run in {folder}"
    if chosen < total:
        text += f", {chosen} of them with these properties"
    return text if shown == chosen else f"{text}; the first {shown} are shown, --number 0 shows all"


def _name_foreign(foreign: "Sequence[Foreign]") -> None:
    """Name what is no run, each in a line."""
    if foreign:
        lines = Group(*(Text(f"{one.name}: {one.reason}") for one in foreign))
        console_of().print(lines, soft_wrap=True)
