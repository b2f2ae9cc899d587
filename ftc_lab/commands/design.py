"""``gcs design``: a scenario for an aircraft, every parameter derived from it."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ftc_autopilot.control.laws import KINDS
from ftc_lab.written_files import check_out
from gcs.commands.common import QuietOption, flight_progress
from gcs.commands.options import options_of, with_options
from gcs.console.errors import BadInput, FlightLost
from gcs.console.lines import print_line
from gcs.console.outputs import write_file
from gcs.console.terminal import Terminal, console_of, numbers, table_of, texts
from gcs.results.quantities import PAPER_ORDER, QUANTITIES, UNITS, percent
from mavlink_defs.config.yaml_text import parse_yaml

if TYPE_CHECKING:
    from ftc_lab.design.scenario import Design
    from gcs.results.figures import FlightSummary
    from gcs.scenario.model import Scenario
    from sitl_plant.airframe.config import Aircraft

_MARK = "# Written by: gcs design "
_STEP_US = 1000  # of the control period that SIM_RATE_HZ is a whole part of
_READERS = {
    "ardupilot": "ArduPlane reads it by --defaults",
    "px4": "a UAV's section autopilot takes it in, where what is derived is to be changed",
}
"""What is done with the parameters of each foreign autopilot."""
DEFAULT_LAW = "surviving"


@dataclass(frozen=True)
class DesignOptions:
    """Options of ``gcs design``.

    Attributes:
        airspeed: Cruising speed [m/s]; by default the aircraft's, or the middle of its range.
        servo_lag: Lag of the surfaces' servos [s].
        servo_rate: Rate limit of these servos [deg/s]; without it, none.
        engine_lag: Lag of the thrust [s].
        gyro_noise: White noise of a gyro's sample [deg/s].
        gyro_delay: Age of a gyro's sample [s].
        uavs: Number of UAVs, which fly in formation.
        plant: Section `plant` of the scenario, as in '{kind: jsbsim, aircraft: c172p}': what flies,
            if it is not these coefficients.
        kind: For which autopilot: ftc, or ardupilot or px4: the parameters that ArduPlane or PX4
            flies the aircraft by.
        out: Scenario file; without it the text is printed.
        fly: Fly it, in process, and print what came out.
    """

    law: Annotated[str, typer.Option(help=f"Control law: {', '.join(KINDS)}.", metavar="NAME")] = (
        DEFAULT_LAW
    )
    airspeed: Annotated[float | None, typer.Option(metavar="M/S")] = None
    servo_lag: Annotated[float, typer.Option(min=0.0, max=1.0, metavar="S")] = 0.0
    servo_rate: Annotated[float | None, typer.Option(min=1.0, metavar="DEG/S")] = None
    engine_lag: Annotated[float, typer.Option(min=0.0, max=10.0, metavar="S")] = 0.0
    gyro_noise: Annotated[float, typer.Option(min=0.0, max=100.0, metavar="DEG/S")] = 0.0
    gyro_delay: Annotated[float, typer.Option(min=0.0, max=0.1, metavar="S")] = 0.0
    uavs: Annotated[int, typer.Option(min=1, max=30, metavar="NUMBER")] = 1
    plant: Annotated[str | None, typer.Option(metavar="YAML")] = None
    kind: Annotated[str, typer.Option("--for", metavar="AUTOPILOT")] = "ftc"
    out: Annotated[Path | None, typer.Option("--out", "-o", metavar="FILE")] = None
    fly: Annotated[bool, typer.Option("--fly")] = False
    quiet: QuietOption = False

    def command(self, aircraft: str) -> str:
        """Return the command that makes the same scenario, wherever it is written."""
        numbers = {
            "--airspeed": self.airspeed,
            "--servo-lag": self.servo_lag or None,
            "--servo-rate": self.servo_rate,
            "--engine-lag": self.engine_lag or None,
            "--gyro-noise": self.gyro_noise or None,
            "--gyro-delay": self.gyro_delay or None,
            "--uavs": self.uavs if self.uavs > 1 else None,
        }
        given = [f"{name} {value:g}" for name, value in numbers.items() if value is not None]
        plant = [] if self.plant is None else [f"--plant '{self.plant}'"]
        return " ".join([f"gcs design {aircraft} --law {self.law}", *given, *plant])


@with_options("options", options_of(DesignOptions), DesignOptions)
def design(
    aircraft: Annotated[str, typer.Argument(metavar="AIRCRAFT")], *, options: DesignOptions
) -> None:
    """Write a scenario for an aircraft, parameters derived from it.

    Law, trigger, diagnosis and guidance have defaults that were found on the paper's aircraft. Each
    is multiplied as its unit says, by the aircraft's own time scale, airspeed and mass; what
    servos, noise, stops and thrust ask for has rules of its own. Each line of the scenario says
    which. It flies the paper's scenario 1, its steps no larger than the aircraft can fly.

    An aircraft that no law can fly in this way is refused, with the reason: a check of `gcs
    aircraft` that it does not meet.

    Args:
        aircraft: A bundled aircraft or a file.

    Examples:
        - gcs design aerosonde --law tube
        - gcs design my.yaml --law surviving --servo-lag 0.02 --servo-rate 400
          --gyro-noise 0.3 -o mine.yaml
        - gcs design aerosonde --law tube --airspeed 28 --fly
        - gcs design aerosonde --for ardupilot -o aerosonde.parm
        - gcs design aerosonde --for px4

    Exit status: 0 written or flown, 1 the flight was lost, 2 bad input, or no law can fly the
    aircraft.
    """
    from ftc_lab.design.scenario import plain, text_of, tree_of
    from gcs.fleet.preparation import check_simulators
    from gcs.scenario.model import scenario_of

    check_out(options.out, _MARK, "a design")
    if options.kind != "ftc":
        _write_parameters(aircraft, options)
        return
    made = _design(aircraft, options)
    console = console_of(quiet=options.quiet)
    text = text_of(made, options.command(Path(aircraft).name))
    scenario = scenario_of(options.out or "the design", plain(tree_of(made)))
    check_simulators(scenario)
    for warning in made.warnings:
        console.print(f"warning: {warning}", soft_wrap=True)
    if options.out is not None:
        write_file(options.out, text)
        console.print(f"{options.out} written; `gcs fly {options.out}` flies it", soft_wrap=True)
    elif not options.fly:
        print_line(text.rstrip("\n"))
    if options.fly:
        _fly(made, scenario, console_of(stderr=False, quiet=options.quiet), console)


def _write_parameters(aircraft: str, options: DesignOptions) -> None:
    """Write the parameters of a foreign autopilot."""
    from gcs.scenario.aircraft_file import load_aircraft

    if options.kind not in _READERS:
        raise BadInput(f"--for is {options.kind!r}, expected ftc, {' or '.join(_READERS)}")
    if options.fly:
        text = f"--fly flies a law of ours; {options.kind} has its program"
        hint = f"fly a scenario with uavs[].autopilot, see docs/how-to/{options.kind}.md"
        raise BadInput(text, hint)
    loaded = load_aircraft(aircraft)
    speed, limits = options.airspeed or loaded.design_airspeed, loaded.airspeed_limits
    if not limits.min_m_s <= speed <= limits.max_m_s:
        raise BadInput(
            f"--airspeed is {speed:g} m/s, expected {limits.min_m_s:g} to {limits.max_m_s:g} m/s, "
            "the aircraft's limits"
        )
    cruising = loaded.model_copy(update={"cruise_m_s": speed})
    given = f" --airspeed {options.airspeed:g}" if options.airspeed else ""
    first = f"{_MARK}{Path(aircraft).name} --for {options.kind}{given}\n"
    text = first + _parameters_of(cruising, options.kind)
    if options.out is None:
        print_line(text.rstrip("\n"))
    else:
        write_file(options.out, text)
        console = console_of(quiet=options.quiet)
        console.print(f"{options.out} written; {_READERS[options.kind]}", soft_wrap=True)


def _parameters_of(aircraft: "Aircraft", kind: str) -> str:
    from sitl_plant.foreign.ardupilot.config import ArduPilot
    from sitl_plant.foreign.ardupilot.parameters import parameter_text, parameters_of
    from sitl_plant.foreign.px4.parameters import px4_parameters
    from sitl_plant.sensing.config import NavigationSensors

    if kind == "ardupilot":
        return parameter_text(parameters_of(aircraft, ArduPilot(), _STEP_US))
    found = px4_parameters(aircraft, NavigationSensors())
    return "parameters:\n" + "".join(f"  {p.name}: {p.value:.6g}  # {p.why}\n" for p in found)


def _design(aircraft: str, options: DesignOptions) -> "Design":
    from ftc_lab.design.airframe import airframe_of
    from ftc_lab.design.rules import Conditions
    from ftc_lab.design.scenario import design_of
    from gcs.scenario.aircraft_file import load_aircraft

    if options.law not in KINDS:
        raise BadInput(f"--law is {options.law!r}, expected one of {', '.join(KINDS)}")
    loaded = load_aircraft(aircraft)
    is_file = Path(aircraft).exists() and not Path(aircraft).is_dir()
    name = Path(aircraft).stem if is_file else aircraft.removesuffix(".yaml")
    key = name
    if is_file:
        folder = Path() if options.out is None else options.out.parent
        key = Path(os.path.relpath(aircraft, folder)).as_posix()
    given = Conditions(
        options.servo_lag,
        options.servo_rate,
        options.engine_lag,
        options.gyro_noise,
        options.gyro_delay,
    )
    airframe = airframe_of(name, loaded, options.airspeed)
    plant = _section(options.plant)
    return design_of(airframe, options.law, given, aircraft_key=key, uavs=options.uavs, plant=plant)


def _section(text: str | None) -> dict[str, Any] | None:
    if text is None:
        return None
    try:
        section = parse_yaml(text)
    except Exception:  # of YAML, of whatever kind
        section = None
    if not isinstance(section, dict):
        raise BadInput(
            f"--plant is {text!r}, expected a section in YAML",
            "as in --plant '{kind: jsbsim, aircraft: c172p}'",
        )
    return dict(section)


def _fly(made: "Design", scenario: "Scenario", output: Terminal, console: Terminal) -> None:
    from gcs.fleet.in_process import fly_in_process
    from gcs.fleet.warm_up import warm_up
    from gcs.results.summary import summarise

    warm_up(scenario, console, in_process=True)
    with flight_progress(scenario, console) as on_progress:
        recording = fly_in_process(scenario, on_progress)
    summary = summarise(recording, scenario)
    _print(made, scenario, summary, output)
    if summary.loss is not None:
        raise FlightLost(summary.loss)


def _print(
    made: "Design", scenario: "Scenario", summary: "FlightSummary", output: Terminal
) -> None:
    from ftc_lab.design.scenario import steps_deg

    figures = [numbers(name) for name in (*PAPER_ORDER, "saved")]
    table = table_of(texts("UAV"), *figures, title=f"Events in {summary.steps} control periods")
    for uav in summary.uavs:
        events = [str(uav.channels[name].events) for name in PAPER_ORDER]
        table.add_row(str(uav.id), *events, percent(uav.saving))
    output.print(table)
    figures = [numbers(f"{name}\n[{UNITS[name]}]") for name in QUANTITIES]
    table = table_of(texts("UAV"), *figures, title="Largest error after 1 s, and the steps asked")
    for uav in summary.uavs:
        errors = [uav.max_error[name] for name in QUANTITIES]
        table.add_row(str(uav.id), *("-" if e is None else f"{e:.2f}" for e in errors))
    speeds = [segment.airspeed_m_s for segment in scenario.profile]
    steps = [max(speeds) - min(speeds), *(value for value, _ in steps_deg(made).values())]
    table.add_row("asked", *(f"{step:.2f}" for step in steps), style="bold")
    output.print(table)
    for uav in summary.uavs:
        for decision in uav.diagnosis:
            output.print(
                f"UAV {uav.id} diagnosed its {decision.actuator} as {decision.phase} at "
                f"{decision.time_s:.3f} s, without a fault"
            )
