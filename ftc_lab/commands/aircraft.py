"""``gcs aircraft``: the aircraft that come with the package, and what one is like."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcs.commands.common import QuietOption
from gcs.console.errors import BadInput
from gcs.console.lines import print_json, print_line
from gcs.console.terminal import console_of, numbers, table_of, texts
from gcs.scenario.bundled import aircraft_names

if TYPE_CHECKING:
    from rich.table import Table

    from ftc_autopilot.control.airframe_checks import AirframeCheck
    from sitl_plant.airframe.config import Aircraft
    from sitl_plant.airframe.level_flight import LevelFlight
    from sitl_plant.airframe.modes import Mode


@dataclass(frozen=True)
class _ShownAircraft:
    """An aircraft at an airspeed."""

    aircraft: "Aircraft"
    flight: "LevelFlight"
    modes: "list[Mode]"
    authority_rad_s2: dict[str, float]
    checks: "list[AirframeCheck]"
    thrust_n: dict[str, float] | None  # largest one by airspeed, if its file says it
    fastest_m_s: float | None  # level flight within its airspeeds


def aircraft(
    name: Annotated[str | None, typer.Argument(metavar="AIRCRAFT", show_default=False)] = None,
    airspeed: Annotated[float | None, typer.Option(metavar="M/S", show_default=False)] = None,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", show_default=False)] = None,
    quiet: QuietOption = False,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """List the bundled aircraft, or show one: limits, trim, modes.

    It also checks what the laws take for granted: a trim within the stops, thrust to spare, aileron
    and rudder that do different work, sideslip that dies out while the rudder holds the heading. If
    that does not, or there is no rudder, the laws `surviving` and `tube` hold the heading by bank.
    Where aileron and rudder do each other's work, `tube` plans both together.

    Args:
        name: A bundled aircraft or a file; without it all bundled ones are listed.
        airspeed: Airspeed of level flight [m/s]; by default cruise, or the middle of the range.
        out: Folder, new or empty, for a picture of the polar: polar.png and polar.svg.
        as_json: Print an object instead of tables.

    Examples:
        - gcs aircraft
        - gcs aircraft aerosonde
        - gcs aircraft my.yaml --airspeed 18 --json
        - gcs aircraft aerosonde --out polar && xdg-open polar/polar.png

    A scenario names one by `aircraft: aerosonde`, or `--set aircraft=aerosonde`.

    Exit status: 0 listed or shown, 2 bad input.
    """
    from gcs.scenario.aircraft_file import load_aircraft

    if name is None:
        _list_all(out, as_json)
        return
    shown = _shown(name, load_aircraft(name), airspeed)
    if out is not None:
        _draw_polar(shown, out)
    if as_json:
        print_json(_parts(shown), indent=2)
    else:
        _print(name, shown, quiet)


def _list_all(out: Path | None, as_json: bool) -> None:
    from gcs.scenario.aircraft_file import load_aircraft

    if out is not None:
        raise BadInput("--out is for the polar of one aircraft; name it: gcs aircraft NAME")
    found = {known: load_aircraft(known) for known in aircraft_names()}
    if as_json:
        print_json({known: one.model_dump() for known, one in found.items()}, indent=2)
        return
    width = max(map(len, found))
    for known, one in found.items():
        size = f"{one.mass_kg:g} kg, {one.wing_span_m:g} m"
        speeds = f"{one.airspeed_min_m_s:g} to {one.airspeed_max_m_s:g} m/s"
        print_line(f"{known:{width}}  {size}, {speeds}.  {one.source}")


def _draw_polar(shown: _ShownAircraft, out: Path) -> None:
    from ftc_lab.figures.polar import draw_polar
    from gcs.reports.figures.style import save
    from gcs.results.run_folder import make_run_folder

    save(draw_polar(shown.aircraft, shown.flight), make_run_folder(out, ""), "polar")


def _parts(shown: _ShownAircraft) -> dict[str, object]:
    from ftc_autopilot.control.heading import needs_bank

    return {
        "aircraft": shown.aircraft.model_dump(),
        "level_flight": shown.flight._asdict(),
        "modes": [mode._asdict() for mode in shown.modes],
        "authority_rad_s2": shown.authority_rad_s2,
        "largest_thrust_n": shown.thrust_n,
        "fastest_level_flight_m_s": shown.fastest_m_s,
        "checks": [check._asdict() for check in shown.checks],
        "heading_by_bank": needs_bank(shown.aircraft),
    }


def _shown(name: str, aircraft: "Aircraft", airspeed: float | None) -> _ShownAircraft:
    from ftc_autopilot.control.airframe_checks import airframe_checks
    from sitl_plant.airframe.level_flight import (
        authority,
        fastest_level_flight,
        largest_thrust,
        level_flight,
    )
    from sitl_plant.airframe.modes import modes

    low, high = aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s
    speed = aircraft.design_airspeed if airspeed is None else airspeed
    if not low <= speed <= high:
        limits = f"expected [{low:g}, {high:g}] m/s, the limits of {name}"
        raise BadInput(f"--airspeed is {speed:g}, {limits}")
    flight = level_flight(aircraft, speed)
    if flight is None:
        text = f"{name} has no straight, level flight at {speed:g} m/s; choose another --airspeed"
        raise BadInput(text)
    found = modes(aircraft, flight), authority(aircraft, speed)
    thrust = None
    if aircraft.propulsion is not None:
        at = sorted({low, speed, high})
        thrust = {f"{V:g}": largest_thrust(aircraft, V) for V in at}
    fastest = fastest_level_flight(aircraft)
    checks = airframe_checks(aircraft, flight)
    return _ShownAircraft(aircraft, flight, *found, checks, thrust, fastest)


def _print(name: str, shown: _ShownAircraft, quiet: bool) -> None:
    from ftc_autopilot.control.heading import needs_bank

    console = console_of(stderr=False, quiet=quiet)
    one = shown.aircraft
    console.print(_limits_table(name, one))
    if one.source:
        console.print(f"Source: {one.source}")
    console.print(_trim_table(shown))
    if shown.thrust_n is not None:
        rows = ", ".join(f"{V} m/s {T:.3g} N" for V, T in shown.thrust_n.items())
        console.print(f"Largest thrust: {rows}")
    if shown.fastest_m_s is not None and shown.fastest_m_s < one.airspeed_max_m_s:
        text = f"Its thrust holds level flight up to {shown.fastest_m_s:.1f} m/s"
        console.print(f"{text}, less than airspeed_max_m_s: {one.airspeed_max_m_s:g} m/s")
    console.print(_modes_table(shown.modes))
    surfaces = ", ".join(f"{key} {value:.3g}" for key, value in shown.authority_rad_s2.items())
    console.print(f"Angular acceleration by full deflection [rad/s²]: {surfaces}")
    table = table_of(texts("check"), numbers("value"), texts(""))
    for check in shown.checks:
        table.add_row(check.name, check.value, "met" if check.is_met else "NOT MET")
    console.print(table)
    reason = needs_bank(one)
    console.print(f"Heading is held by {f'bank: {reason}' if reason else 'the rudder'}")
    for check in shown.checks:
        if not check.is_met:
            console.print(f"{check.name}: {check.otherwise}")


def _limits_table(name: str, one: "Aircraft") -> "Table":
    table = table_of(texts(name), numbers(""))
    for label, value in (
        ("mass", f"{one.mass_kg:g} kg"),
        ("wing", f"{one.wing_span_m:g} m, {one.wing_area_m2:g} m²"),
        ("airspeeds", f"{one.airspeed_min_m_s:g} to {one.airspeed_max_m_s:g} m/s"),
        ("cruise", "-" if one.cruise_m_s is None else f"{one.cruise_m_s:g} m/s"),
        ("stall", "-" if one.stall_deg is None else f"{one.stall_deg:g}°"),
        ("thrust by weight", f"{one.thrust_limit_n / (one.mass_kg * one.gravity_m_s2 or 1.0):.2g}"),
    ):
        table.add_row(label, value)
    return table


def _trim_table(shown: _ShownAircraft) -> "Table":
    one, flight = shown.aircraft, shown.flight
    at = f"{flight.airspeed_m_s:g}"
    table = table_of(texts(f"Straight, level flight at {at} m/s"), numbers(""), texts("of"))
    aileron, elevator, rudder = map(_stops_text, one.stops_deg)
    most = (shown.thrust_n or {}).get(at, one.thrust_limit_n)
    for label, value, limit in (
        ("angle of attack", f"{flight.alpha_deg:.1f}°", ""),
        ("sideslip", f"{flight.beta_deg + 0.0:.1f}°", ""),
        ("aileron", f"{flight.aileron_deg:.1f}°", aileron),
        ("elevator", f"{flight.elevator_deg:.1f}°", elevator),
        ("rudder", f"{flight.rudder_deg:.1f}°" if one.has("rudder") else "", rudder),
        ("thrust", f"{flight.thrust_n:.0f} N", f"{most:.4g} N"),
    ):
        table.add_row(label, value.replace("-0.0°", "0.0°"), limit)
    return table


def _modes_table(modes: "Iterable[Mode]") -> "Table":
    heads = numbers("frequency\n[rad/s]"), numbers("damping"), numbers("time\n[s]")
    table = table_of(texts("mode"), *heads, texts(""))
    for mode in modes:
        seconds = 1.0 / (abs(mode.damping) * mode.frequency_rad_s or 1e-9)
        table.add_row(
            mode.name,
            "" if mode.is_aperiodic else f"{mode.frequency_rad_s:.3g}",
            "" if mode.is_aperiodic else f"{mode.damping:.2g}",
            f"{seconds:.3g}",
            "grows" if mode.damping < 0.0 else "",
        )
    return table


def _stops_text(stops: tuple[float, float]) -> str:
    low, high = stops
    if low == high:
        return "none"
    return f"±{high:g}°" if low == -high else f"{low:g}° to {high:g}°"
