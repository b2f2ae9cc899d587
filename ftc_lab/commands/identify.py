"""``gcs identify``: the nominal aircraft of a simulator, or of a recorded flight."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftc_lab.commands.design import DEFAULT_LAW
from ftc_lab.written_files import check_out
from gcs.commands.common import QuietOption
from gcs.commands.options import JsonOption, options_of, with_options
from gcs.console.errors import BadInput
from gcs.console.lines import print_json
from gcs.console.outputs import write_file
from gcs.console.progress import working
from gcs.console.terminal import Terminal, console_of, numbers, table_of, texts

if TYPE_CHECKING:
    from ftc_lab.identification.identified import Identified

_MARK = "# Written by: gcs identify "


@dataclass(frozen=True)
class IdentifyOptions:
    """Options of ``gcs identify``.

    Attributes:
        cruise: Airspeed about which PLANT is identified [m/s].
        altitude: Altitude at which it is identified [m].
        thrust_limit: Largest thrust at every airspeed [N], which the experiment does not show; by
            default 0.4 of the weight.
        airspeed_min: Lowest airspeed accepted [m/s]; by default 1.2 times the stall speed, if there
            is one, else 0.65 times the cruise.
        airspeed_max: Highest airspeed accepted [m/s]; by default 1.3 times the cruise.
        wing_area: Reference area in place of the simulator's [m²], if that is wrong.
        seed: Seed of the experiment's random controls.
        source: Identify from a flight: its run folder, recorded with --record full.
        aircraft: With --from: the aircraft as it is known so far, a bundled one or a file.
        uav: With --from: which UAV; by default the first.
        out: Aircraft file to write; by default none.
    """

    cruise: Annotated[float | None, typer.Option(min=0.1, max=300.0, metavar="M/S")] = None
    altitude: Annotated[float, typer.Option(min=0.0, max=20_000.0, metavar="M")] = 1000.0
    thrust_limit: Annotated[float | None, typer.Option(min=0.1, metavar="N")] = None
    airspeed_min: Annotated[float | None, typer.Option(min=0.1, metavar="M/S")] = None
    airspeed_max: Annotated[float | None, typer.Option(min=0.1, metavar="M/S")] = None
    wing_area: Annotated[float | None, typer.Option(min=1e-3, metavar="M2")] = None
    seed: Annotated[int, typer.Option(min=0, metavar="NUMBER")] = 1
    source: Annotated[Path | None, typer.Option("--from", metavar="FOLDER")] = None
    aircraft: Annotated[str | None, typer.Option(metavar="AIRCRAFT")] = None
    uav: Annotated[int | None, typer.Option(metavar="ID")] = None
    out: Annotated[Path | None, typer.Option("--out", "-o", metavar="FILE")] = None
    quiet: QuietOption = False
    as_json: JsonOption = False

    def command(self, plant: str | None) -> str:
        """Return the command that identifies the same."""
        if self.source is not None:
            uav = "" if self.uav is None else f" --uav {self.uav}"
            return f"gcs identify --from {self.source.name} --aircraft {self.aircraft}{uav}"
        given = {
            "--cruise": self.cruise,
            "--altitude": self.altitude,
            "--thrust-limit": self.thrust_limit,
            "--airspeed-min": self.airspeed_min,
            "--airspeed-max": self.airspeed_max,
            "--wing-area": self.wing_area,
            "--seed": self.seed if self.seed != 1 else None,
        }
        options = [f"{name} {value:g}" for name, value in given.items() if value is not None]
        return " ".join([f"gcs identify {plant}", *options])


@with_options("options", options_of(IdentifyOptions), IdentifyOptions)
def identify(
    plant: Annotated[str | None, typer.Argument(metavar="PLANT", show_default=False)] = None,
    *,
    options: IdentifyOptions,
) -> None:
    """Identify an aircraft from a simulator or a recorded flight.

    The simulator is trimmed in level flight, its stall is searched, and it is flown in many short
    experiments with all controls moved at random. Least squares give every coefficient of force and
    moment with an interval of 95 %, and what they leave unexplained; then the checks of `gcs
    aircraft`, and a verdict: what `gcs design` says of the aircraft, with every law. The constants
    are set so that the model trims where the plant does.

    Propulsion is not identified: the file has no section `propulsion`, so its aircraft makes any
    thrust from 0 to --thrust-limit at once, at every airspeed, through the centre of gravity.

    From a flight, only what it excites can be seen: other coefficients, and the propulsion, stay as
    --aircraft has them.

    Args:
        plant: What flies: jsbsim:AIRCRAFT, one of JSBSim or a file of it; own:AIRCRAFT, a file
            flown by our own equations.

    Examples:
        - gcs identify jsbsim:c172p --cruise 55 -o c172p.yaml
        - gcs identify own:aerosonde --cruise 24 -o mine.yaml
        - gcs identify --from runs/mine --aircraft aerosonde

    Exit status: 0 identified, 2 bad input, or nothing that can be identified.
    """
    if (plant is None) == (options.source is None):
        raise BadInput(
            "expected either a PLANT, or --from FOLDER",
            "as in gcs identify own:aerosonde --cruise 24, or gcs identify --from runs/mine "
            "--aircraft aerosonde",
        )
    check_out(options.out, _MARK, "an identified aircraft")
    console = console_of(quiet=options.quiet)
    command = options.command(plant)
    if plant is not None:
        found = _of_plant(plant, command, options, console)
    else:
        found = _of_flight(options, console)
    if options.out is not None:
        from ftc_lab.identification.identified import text_of

        write_file(options.out, text_of(found, command))
    if options.as_json:
        print_json(_json(found), indent=2)
    else:
        _print(found, console_of(stderr=False, quiet=options.quiet))
    if options.out is not None:
        console.print(f"{options.out} written{_next_command(found, options.out)}", soft_wrap=True)


def _next_command(found: "Identified", out: Path) -> str:
    """Return what comes after the file: the command that designs a flight, if one does."""
    from ftc_lab.design.answers import laws_of

    laws = laws_of(found.answers)
    if not laws:
        return ""
    law = "" if DEFAULT_LAW in laws else f" --law {laws[0]}"
    return f"; `gcs design {out}{law}` derives a flight from it"


def _of_plant(
    plant: str, command: str, options: IdentifyOptions, console: Terminal
) -> "Identified":
    from ftc_lab.identification.experiment import SEGMENTS
    from ftc_lab.identification.identified import Choices
    from ftc_lab.identification.identified import identify as identified
    from ftc_lab.identification.plants import simulator_of

    if options.cruise is None:
        raise BadInput("--cruise is missing, expected an airspeed in m/s", "as in --cruise 24")
    _check_airspeeds(options, options.cruise)
    simulator, name = simulator_of(plant, options.altitude, options.wing_area)
    choices = Choices(
        options.cruise,
        options.altitude,
        options.thrust_limit,
        options.airspeed_min,
        options.airspeed_max,
        options.seed,
        f"{name}; {command}; what no flight shows, thrust and airspeeds, is chosen",
    )
    with working(console) as work:
        task = work.add(f"flying {plant}", SEGMENTS, "segments")
        return identified(simulator, choices, lambda done, total: task.show(done, total=total))


def _check_airspeeds(options: IdentifyOptions, cruise: float) -> None:
    """Refuse limits that the cruise is not within.

    Raises:
        BadInput: It is not.
    """
    low, high = options.airspeed_min, options.airspeed_max
    if low is not None and low > cruise:
        raise BadInput(f"--airspeed-min is {low:g}, expected at most --cruise, {cruise:g} m/s")
    if high is not None and high < cruise:
        raise BadInput(f"--airspeed-max is {high:g}, expected at least --cruise, {cruise:g} m/s")


def _of_flight(options: IdentifyOptions, console: Terminal) -> "Identified":
    from ftc_lab.identification.recorded import identify_recording
    from gcs.scenario.aircraft_file import load_aircraft

    assert options.source is not None
    if options.aircraft is None:
        text = "--aircraft is missing: a recording has neither mass nor size"
        raise BadInput(text, "as in --from runs/mine --aircraft aerosonde")
    with working(console, "reading the flight"):
        return identify_recording(options.source, load_aircraft(options.aircraft), options.uav)


def _json(found: "Identified") -> dict[str, object]:
    from ftc_lab.identification.identified import verdict

    return {
        "aircraft": found.aircraft.model_dump(exclude_none=True),
        "level_flight": found.flight._asdict(),
        "estimates": {name: one._asdict() for name, one in found.fit.estimates.items()},
        "residuals": {axis: one._asdict() for axis, one in found.fit.residuals.items()},
        "checks": [check._asdict() for check in found.checks],
        "verdict": verdict(found),
        "refused_by_design": found.answers,
    }


def _print(found: "Identified", output: Terminal) -> None:
    from ftc_lab.identification.identified import FORCES, SET_BY_TRIM, verdict
    from sitl_plant.airframe.config import TERMS

    values = found.aircraft.coefficients.model_dump()
    columns = (texts("coefficient"), numbers("value"), numbers("95 % interval ±"), texts(""))
    table = table_of(*columns)
    for coefficients in TERMS.values():
        for name in coefficients:
            one = found.fit.estimates[name]
            shift = values[name] - one.value
            remark = "nominal" if one.is_nominal else ""
            if found.level is not None and name in SET_BY_TRIM and abs(shift) > one.half_width:
                remark = f"shifted by {shift:.2g} to the plant's trim"
            table.add_row(name, f"{values[name]:.5g}", f"{one.half_width:.2g}", remark)
        table.add_section()
    output.print(table)
    table = table_of(texts("force or moment"), numbers("unexplained"), numbers("RMS"))
    for axis, name in FORCES.items():
        left = found.fit.residuals[axis]
        table.add_row(name, f"{left.share:.1%}", f"{left.rms:.2g}")
    output.print(table)
    table = table_of(texts("check"), numbers("value"), texts(""))
    for check in found.checks:
        table.add_row(check.name, check.value, "met" if check.is_met else "NOT MET")
    output.print(table)
    for line in verdict(found):
        output.print(line, soft_wrap=True)
