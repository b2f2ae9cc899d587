"""``gcs replay-fault``: a flight that failed, flown again."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftc_autopilot.control.laws import KINDS
from gcs.commands.common import QuietOption
from gcs.commands.options import JsonOption, LogColumnsOption, LogUavOption
from gcs.console.errors import BadInput
from gcs.console.lines import print_json
from gcs.console.outputs import check_folder, make_folder
from gcs.console.progress import working
from gcs.console.terminal import console_of, table_of, texts
from mavlink_defs.config.output_files import write_text

if TYPE_CHECKING:
    from ftc_lab.fault_replay.replayed import ReplayedFault

REPORT = "report"


def replay_fault(
    flight: Annotated[Path, typer.Argument(metavar="FLIGHT", show_default=False)],
    uav: LogUavOption = None,
    columns: LogColumnsOption = None,
    aircraft: Annotated[str | None, typer.Option(metavar="AIRCRAFT", show_default=False)] = None,
    identify: Annotated[bool, typer.Option("--identify/--as-given")] = True,
    law: Annotated[
        list[str] | None, typer.Option("--controller.kind", metavar="LAW", show_default=False)
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FOLDER")] = Path("replay"),
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fly a flight that failed again, by its own and by other laws.

    What failed, since when and by how much is found by a model of the aircraft, which is identified
    from the healthy part of the log. The model is then flown under the recorded commands, with the
    fault: does it do what the aircraft did, and for how long? And other laws are flown from just
    before the fault, in the wind of the log. A page (report.md, report.html) has all side by side,
    and how far the model is to be trusted; each flight is a scenario file that `gcs fly` flies.

    Args:
        flight: Log of a flight with commands to the actuators: .tlog, .bin, .ulg, .csv, .parquet,
            .mat; or a run folder, whose scenario is flown again.
        aircraft: The aircraft as it is known, a bundled one or a file; of a run folder by default
            the one that its laws knew.
        identify: Whether its coefficients are identified from the log, or taken as they are; of a
            run folder they are.
        law: Control law that flies; may be repeated; by default surviving.
        out: Folder to write, new or empty.

    Examples:
        - gcs replay-fault flight.ulg --aircraft mine.yaml
        - gcs replay-fault runs/lost --uav 3 --controller.kind surviving --controller.kind tube
        - gcs replay-fault flight.bin --aircraft mine.yaml --as-given --out again

    Exit status: 0 a law flew on, 1 all were lost, 2 bad input, no commands in the log, or nothing
    that failed.
    """
    from ftc_lab.fault_replay.replayed import read_fault, replay_fault
    from ftc_lab.figures.replay import draw_replay
    from ftc_lab.reports.markdown import html_of, save_markdown
    from ftc_lab.reports.replay import PICTURE, replay_report
    from gcs.scenario.aircraft_file import load_aircraft

    laws = law or ["surviving"]
    if unknown := [one for one in laws if one not in KINDS]:
        raise BadInput(f"--controller.kind is {unknown[0]!r}, expected one of {', '.join(KINDS)}")
    _check_folder(out)
    console = console_of(quiet=quiet)
    nominal = None if aircraft is None else load_aircraft(aircraft)
    with working(console, "finding what failed"):
        read = read_fault(flight, nominal, uav, columns, identify=identify)
    make_folder(out)
    with working(console, "flying it again"):
        found = replay_fault(read, laws, out)
    draw_replay(found).savefig(out / PICTURE, dpi=150)
    markdown = replay_report(found)
    save_markdown(out / f"{REPORT}.md", markdown)
    write_text(out / f"{REPORT}.html", html_of(markdown, out))
    if as_json:
        print_json(_json(found), indent=2)
    else:
        _print(found, quiet=quiet)
        console.print(f"{out / REPORT}.html written", soft_wrap=True)
    if all(one.loss is not None for one in found.laws):
        raise typer.Exit(1)


def _check_folder(out: Path) -> None:
    check_folder(out)
    if out.is_dir() and any(out.iterdir()):
        text = f"--out is {out}, expected a new or an empty folder"
        raise BadInput(text, "choose another, or remove it")


def _json(found: "ReplayedFault") -> dict[str, object]:
    fault, errors = found.read.fault, found.errors
    return {
        "fault": {
            "actuator": fault.actuator,
            "onset_s": fault.onset_s,
            "onset_between_s": list(fault.between_s),
            "values": dict(fault.values),
            "unexplained": fault.unexplained,
        },
        "model": {
            "confirms_the_fault": errors.confirms,
            "diverged_s": errors.diverged_s,
            "judged_s": errors.judged_s,
            "largest_errors": {"with": errors.faulty, "without": errors.healed},
            "healthy_95": errors.healthy,
        },
        "laws": {one.law: {"loss": one.loss, "scenario": str(one.scenario)} for one in found.laws},
        "remarks": list(found.read.remarks),
    }


def _print(found: "ReplayedFault", *, quiet: bool) -> None:
    from ftc_lab.reports.replay import confirmation, divergence, side_by_side

    output, fault = console_of(stderr=False, quiet=quiet), found.read.fault
    output.print(
        f"Failed: {fault}, at {fault.onset_s:.2f} s ({fault.between_s[0]:.2f} to "
        f"{fault.between_s[1]:.2f} s).",
        soft_wrap=True,
    )
    header = ("from the fault on", "roll [deg]", "pitch [deg]", "height [m]", "ended")
    table = table_of(*map(texts, header))
    for row in side_by_side(found):
        table.add_row(*row)
    output.print(table)
    for line in (divergence(found), confirmation(found)):
        output.print(line, soft_wrap=True)
    for remark in found.read.remarks:
        console_of(quiet=quiet).print(f"remark: {remark}", soft_wrap=True)
