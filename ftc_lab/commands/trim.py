"""``gcs trim``: steady flights that are possible with one actuator stuck."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box

from ftc_autopilot.plugins.loading import without_code
from gcs.commands.common import (
    QuietOption,
    ScenarioArgument,
    SetOption,
    WithOption,
    changed_scenario,
)
from gcs.console.errors import BadInput
from gcs.console.lines import print_json
from gcs.console.progress import working
from gcs.console.terminal import Terminal, console_of, numbers, table_of, texts
from mavlink_defs.constants import Actuator

if TYPE_CHECKING:
    from gcs.scenario.model import Scenario
    from sitl_plant.airframe.config import Aircraft
    from sitl_plant.airframe.stuck_trim import Trim

_KEPT: tuple[Actuator, ...] = ("aileron", "rudder")
_GIVEN_UP: tuple[Actuator, ...] = ("elevator", "throttle")
_STEPS = {"elevator": 5.0, "throttle": 500.0}  # of positions shown
_HEADINGS = (
    "at",
    "air-\nspeed\n[m/s]",
    "turn\n[°/s]",
    "aileron\n[°]",
    "elevator\n[°]",
    "rudder\n[°]",
    "thrust\n[N]",
    "side-\nslip\n[°]",
    "attack\nangle\n[°]",
    "pitch\n[°]",
)


def trim(
    scenario: ScenarioArgument,
    airspeed: Annotated[list[float] | None, typer.Option(metavar="M/S")] = None,
    uav: Annotated[int | None, typer.Option(metavar="ID")] = None,
    roll: Annotated[float, typer.Option(min=-80.0, max=80.0, metavar="DEG")] = 0.0,
    sideslip: Annotated[float, typer.Option(min=1.0, max=90.0, metavar="DEG")] = 15.0,
    additions: WithOption = None,
    settings: SetOption = None,
    quiet: QuietOption = False,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """Compute where an actuator may be stuck in level flight.

    For aileron and rudder at each airspeed: both ends of the range of deflections, and zero; the
    other surfaces balance the aircraft, which turns. For elevator and throttle: the airspeed at
    which it flies straight. No controller can hold what is not in these ranges.

    Args:
        airspeed: Airspeed [m/s]; may be repeated. By default the airspeeds of profile or mission.
        uav: UAV whose aircraft it is; by default the first.
        roll: Roll angle [deg].
        sideslip: Largest sideslip at an end of a range [deg]: linear coefficients hold for small
            angles only.
        as_json: Print a list of steady flights instead of tables.

    Examples:
        - gcs trim paper/scenario1
        - gcs trim my.yaml --airspeed 30 --airspeed 50 --roll 20
        - gcs trim airframes/mixed --uav 2
        - gcs trim paper/scenario1 --json | jq '.[] | select(.stuck == "elevator")'

    Exit status: 0 computed, 2 bad input.
    """
    from sitl_plant.airframe.config import true_aircraft

    with without_code():
        loaded = changed_scenario(scenario, additions, settings)
    aircraft = true_aircraft(_aircraft_of(loaded, uav), loaded.uncertainty)
    airspeeds = sorted({*(airspeed or _airspeeds(loaded))})
    _check(airspeeds, aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s)
    with working(console_of(quiet=quiet), "solving for steady flights"):
        limits, least, names = (roll, sideslip), airspeeds[0], filter(aircraft.has, _KEPT)
        kept = [t for name in names for at in airspeeds for t in _kept(aircraft, name, at, *limits)]
        given_up = [t for name in _GIVEN_UP for t in _given_up(aircraft, name, least, *limits)]
    if as_json:
        print_json([{"position": t.position} | asdict(t) for t in (*kept, *given_up)], indent=2)
        return
    tables = console_of(stderr=False, quiet=quiet)
    _print(tables, "Aileron or rudder stuck: level flight that turns", kept)
    _print(tables, "Elevator or throttle stuck: straight, level flight", given_up)


def _check(airspeeds: list[float], low: float, high: float) -> None:
    for speed in airspeeds:
        if not low <= speed <= high:
            raise BadInput(
                f"--airspeed is {speed:g}, expected [{low:g}, {high:g}] m/s, the aircraft's limits"
            )


def _aircraft_of(scenario: "Scenario", uav: int | None) -> "Aircraft":
    ids = [one.id for one in scenario.uavs]
    if uav is not None and uav not in ids:
        known = ", ".join(map(str, ids))
        raise BadInput(f"--uav is {uav}, expected one of the scenario's UAVs: {known}")
    return scenario.aircraft_of(ids[0] if uav is None else uav)


def _airspeeds(scenario: "Scenario") -> list[float]:
    """Return the airspeeds of a scenario's profile, or of the path of its mission [m/s]."""
    from gcs.results.mission_paths import paths_of

    if (paths := paths_of(scenario)) is None:
        return [segment.airspeed_m_s for segment in scenario.profile]
    return [float(v) for path in paths for v in path["airspeed"][: path["count"]]]


def _kept(
    aircraft: "Aircraft", stuck: Actuator, airspeed_m_s: float, roll_deg: float, sideslip_deg: float
) -> Iterator["Trim"]:
    """Yield the ends of the range of deflections at an airspeed, and zero in between."""
    from sitl_plant.airframe.stuck_trim import stuck_range, trim_stuck

    ends = stuck_range(aircraft, stuck, airspeed_m_s, roll_deg, sideslip_deg)
    if ends is None:
        return
    yield ends[0]
    zero = trim_stuck(aircraft, stuck, 0.0, airspeed_m_s, roll_deg)
    if zero is not None and ends[0].position < 0.0 < ends[1].position:
        yield zero
    yield ends[1]


def _given_up(
    aircraft: "Aircraft", stuck: Actuator, airspeed_m_s: float, roll_deg: float, sideslip_deg: float
) -> Iterator["Trim"]:
    """Yield the ends of the range of positions, and round positions in between."""
    from sitl_plant.airframe.stuck_trim import stuck_range, trim_stuck

    ends = stuck_range(aircraft, stuck, airspeed_m_s, roll_deg, sideslip_deg)
    if ends is None:
        return
    step = _STEPS[stuck]
    position = step * (ends[0].position // step + 1.0)
    yield ends[0]
    while position < ends[1].position:
        between = trim_stuck(aircraft, stuck, position, airspeed_m_s, roll_deg)
        if between is not None:
            yield between
        position += step
    yield ends[1]


def _print(console: Terminal, title: str, trims: list["Trim"]) -> None:
    columns = (texts("stuck"), *map(numbers, _HEADINGS))
    table = table_of(*columns, title=title, box=box.SIMPLE_HEAD, padding=0, pad_edge=False)
    for t in trims:
        table.add_row(*_cells(t))
    console.print(table)
    if not trims:
        console.print("There is none.")


def _cells(t: "Trim") -> tuple[str, ...]:
    """Return the cells of one steady flight."""
    angles = (t.aileron_deg, t.elevator_deg, t.rudder_deg)
    return (
        t.stuck,
        _position(t),
        *map(_number, (t.airspeed_m_s, t.turn_rate_deg_s, *angles)),
        f"{t.thrust_n:.0f}",
        *map(_number, (t.beta_deg, t.alpha_deg, t.pitch_deg)),
    )


def _position(t: "Trim") -> str:
    """Format where the actuator is stuck."""
    return f"{t.position:.0f} N" if t.stuck == "throttle" else f"{_number(t.position)}°"


def _number(value: float) -> str:
    """Format a number with one digit; zero has no sign."""
    return f"{round(value, 1) + 0.0:.1f}"
