"""``gcs compare``: whether a campaign is worse than another one, for CI; and two flights."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcs.commands.options import options_of, with_options
from gcs.console.errors import BadInput
from gcs.console.lines import print_json
from gcs.console.outputs import check_file, write_file
from gcs.console.terminal import console_of
from mavlink_defs.visible import visible_lines

if TYPE_CHECKING:
    from ftc_lab.campaigns.findings import Findings


@dataclass(frozen=True)
class CompareOptions:
    """Options of ``gcs compare``.

    Attributes:
        fail_if: Condition under which NEW fails; may be repeated. 'worse p(success) at 95 %' by
            default; also 'worse FIGURE at 99 %', 'p(attitude_lost) > 0.05 at 95 %'.
        junit: Write a JUnit file, a case for each check.
        markdown: Write a summary for the page of a CI job.
        everything: Two flights: also list keys of one law only, at defaults.
        as_json: Two flights: print JSON, nothing else.
    """

    fail_if: Annotated[list[str] | None, typer.Option(metavar="CONDITION", show_default=False)] = (
        None
    )
    junit: Annotated[Path | None, typer.Option(metavar="FILE")] = None
    markdown: Annotated[Path | None, typer.Option(metavar="FILE")] = None
    everything: Annotated[bool, typer.Option("--all")] = False
    as_json: Annotated[bool, typer.Option("--json")] = False


@with_options("options", options_of(CompareOptions), CompareOptions)
def compare(
    old: Annotated[Path, typer.Argument(metavar="OLD")],
    new: Annotated[Path, typer.Argument(metavar="NEW")],
    *,
    options: CompareOptions,
) -> None:
    """Compare two flights, or two campaigns.

    Two campaigns: whether NEW is worse. If both flew the same draws, flights are compared in pairs
    (McNemar's exact test, the sign test), else as two samples (Fisher's exact test, the
    Mann-Whitney test). A test that finds nothing does not prove that both are equal; the interval
    beside it, at the level of the condition, shows what could have escaped it. Where both flew the
    same draws by different laws, a table marks figures in which the simpler one is better.

    Of two flights: what was set, figures of every UAV, decisions of the diagnosis, and the keys in
    which their scenarios differ. Nothing is tested, so of the options only --json and --all apply.

    Args:
        old: Folder of the campaign, or the flight, to compare with.
        new: Folder of the campaign, or the flight, in question.

    Examples:
        - gcs compare runs/yesterday runs/today
        - gcs compare old new --fail-if 'worse p(success) at 99 %'
          --fail-if 'worse iae_roll at 99 %'
        - gcs compare old new --fail-if 'p(attitude_lost) > 0.02 at 95 %' --junit gate.xml
        - gcs compare runs/first runs/second    (two flights)
        - gcs compare runs/first runs/second --json | jq '.uavs[].figures.messages.change'

    Exit status: 0 no check failed, 1 one failed or a file cannot be written, 2 bad input.
    """
    from gcs.results.runs.difference import is_flight

    for folder in (old, new):
        if not folder.exists():
            raise BadInput(f"{folder} does not exist", "gcs runs lists what was flown")
    if is_flight(old) or is_flight(new):
        _compare_flights(old, new, options)
    else:
        _compare_campaigns(old, new, options)


def _compare_campaigns(old: Path, new: Path, options: CompareOptions) -> None:
    """Show whether a campaign is worse than another.

    Raises:
        BadInput: One of them is none, or is unfinished; or an option is of flights.
        typer.Exit: It is worse.
    """
    if options.as_json or options.everything:
        name = "--json" if options.as_json else "--all"
        raise BadInput(f"{name} is of two flights", "campaigns have --junit and --markdown")
    from ftc_lab.campaigns.findings import findings_of
    from ftc_lab.campaigns.gate import DEFAULT, gate, parse_rules
    from ftc_lab.reports import gate as reports
    from ftc_lab.reports.campaign_laws import between
    from ftc_lab.reports.laws import law_markdown, law_terminal

    for path, option in ((options.junit, "--junit"), (options.markdown, "--markdown")):
        if path is not None:
            check_file(path, option)
    both = findings_of(old), findings_of(new)
    notes = _checked(*both)
    before, after = both[0].counted, both[1].counted
    rules = parse_rules(options.fail_if or [DEFAULT], [*before.values(), *after.values()])
    checks = gate(before, after, rules)
    laws = {f"{name}, of {of.draws} draws": of for name, of in between(*both)}
    if options.markdown is not None:
        tables = [law_markdown([title], of.rows, of.laws) for title, of in laws.items()]
        text = reports.gate_markdown(str(old), str(new), checks, notes)
        text = visible_lines("\n".join([text, *tables]))
        write_file(options.markdown, text, "--markdown")
    if options.junit is not None:
        write_file(options.junit, reports.junit(str(old), str(new), checks, notes), "--junit")
    console = console_of(stderr=False)
    for line in reports.gate_lines(checks, notes):
        console.print(line, soft_wrap=True)
    for title, of in laws.items():
        console.print(law_terminal([title], of.rows, of.laws))
    if any(check.violated for check in checks):
        raise typer.Exit(1)


def _compare_flights(old: Path, new: Path, options: CompareOptions) -> None:
    """Show how two flights differ.

    Raises:
        BadInput: One of them is none, or has not ended; or an option is for campaigns.
    """
    from gcs.results.runs.difference import EndedFlight, difference, difference_data, is_flight

    for folder, other in ((old, new), (new, old)):
        if not is_flight(other):
            text = f"{folder} is a flight, and {other} is none"
            raise BadInput(text, "compare two flights, or two campaigns")
    if options.fail_if or options.junit or options.markdown:
        text = "--fail-if, --junit and --markdown test campaigns; a flight is a single draw"
        raise BadInput(text, "leave them out, or fly a campaign")
    if options.as_json:
        print_json(difference_data(EndedFlight(old), EndedFlight(new)))
        return
    console = console_of(stderr=False)
    for part in difference(EndedFlight(old), EndedFlight(new), everything=options.everything):
        console.print(part, soft_wrap=isinstance(part, str))


def _checked(old: "Findings", new: "Findings") -> list[str]:
    """Return what the reader of a comparison should know.

    Raises:
        BadInput: A campaign is unfinished, or the new one lacks a variant: either would hide
            flights.
    """
    problems = []
    for each in (old, new):
        ended = sum(map(len, each.ended.values()))
        if ended == 0 or (ended < each.planned and not each.until):
            problems.append(f"{each.folder} has {ended} of {each.planned} planned flights")
    if problems:
        hint = "the command that began a campaign continues it"
        raise BadInput(f"unfinished campaigns cannot be compared: {'; '.join(problems)}", hint)
    if lacking := [name for name in old.ended if name not in new.ended]:
        raise BadInput(
            f"{new.folder} has no flights of {', '.join(lacking)}, which {old.folder} has",
            "compare campaigns with the same variants",
        )
    notes = [
        f"{name} is new and has nothing to compare with"
        for name in new.ended
        if name not in old.ended
    ]
    for each in (old, new):
        if len(each.codes) > 1:
            notes.append(f"{each.folder} was flown by {len(each.codes)} different codes")
        if not each.is_sample:
            design = each.mark.campaign.design
            notes.append(f"{each.folder} is a {design} design: tests take its points for draws")
    if old.codes == new.codes:
        notes.append("both were flown by the same code")
    return notes
