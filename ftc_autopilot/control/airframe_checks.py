"""What can be said of an airframe before any flight: is it consistent, can these laws fly it?

The laws hold roll by the aileron and heading by the rudder. Where the rudder keeps the heading,
sideslip is left to itself, and must die out: the side force by sideslip, less what the rudder makes
that balances the yawing moment of the same sideslip, has to be against it.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from ftc_autopilot.control.heading import remaining_side_force, weathercock_problem
from ftc_autopilot.control.pairing import MIN_RELATIVE_GAIN, is_coupled, relative_gain
from mavlink_defs.constants import SURFACES
from sitl_plant.airframe.aerodynamics import lateral
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.level_flight import LevelFlight, authority, largest_thrust

_MAX_RELATIVE_GAIN = 1.6
"""Above it aileron and rudder undo much of each other's work: the Aerosonde, changed so, lacks the
authority for the steps of a design."""
_AREA = 0.3  # by which S may differ from b c
_NO_TRIM = "level flight is not possible: choose another airspeed, or check moments and stops"
_RESERVE_DEG = 4.0  # of the angle of attack to the stall
_SPARE_THRUST = 1.3  # of the drag

_SHORT = (
    "its thrust at this airspeed does not hold level flight: choose another one, or check "
    "propulsion, thrust_limit_n and drag"
)
_NO_SPARE = "it can neither climb nor speed up: choose another airspeed, or check thrust and drag"

AREA = "wing area by span times chord"
PAIRING = "aileron rolls, rudder yaws (relative gain)"
SIDESLIP = "sideslip dies out while the rudder holds the heading"
NO_RUDDER = "yawing moment by rudder"
"""Names of checks that others have to know."""


class AirframeCheck(NamedTuple):
    """A property of an airframe, and whether it is as the laws need it."""

    name: str
    value: str
    is_met: bool
    otherwise: str  # what it means if it is not met, and what to do


def airframe_checks(aircraft: Aircraft, flight: LevelFlight) -> list[AirframeCheck]:
    """Check an aircraft in straight, level flight."""
    ratio = aircraft.wing_area_m2 / (aircraft.wing_span_m * aircraft.mean_chord_m)
    found = [
        AirframeCheck(
            AREA,
            f"{ratio:.2f}",
            abs(ratio - 1.0) <= _AREA,
            "compare S, b and c with their source; a tapered wing may differ as much",
        )
    ]
    found += _surfaces_that_do_nothing(aircraft, flight)
    found += _surfaces_within_stops(aircraft, flight)
    if aircraft.stall_deg is not None:
        reserve = aircraft.stall_deg - flight.alpha_deg
        text = f"no room for turns and gusts, {_RESERVE_DEG:g}° at least: choose a higher airspeed"
        is_met = reserve >= _RESERVE_DEG
        found.append(
            AirframeCheck("angle of attack below the stall", f"{reserve:.1f}°", is_met, text)
        )
    most = largest_thrust(aircraft, flight.airspeed_m_s)
    spare = most / flight.thrust_n if flight.thrust_n > 0.0 else math.inf
    found.append(
        AirframeCheck(
            "largest thrust by what level flight takes",
            f"{spare:.2f}",
            spare >= _SPARE_THRUST,
            _SHORT if spare < 1.0 else _NO_SPARE,
        )
    )
    return [*found, *_heading_checks(aircraft, flight.airspeed_m_s)]


def _heading_checks(aircraft: Aircraft, V: float) -> list[AirframeCheck]:
    """Check what holds the heading at an airspeed [m/s]: the rudder, else the aircraft itself."""
    air = lateral(V, aircraft_record(aircraft))
    roll, yaw = air.rolling, air.yawing
    if not aircraft.has("rudder"):
        stiffness = yaw.beta - yaw.aileron * roll.beta / (roll.aileron or math.nan)
        return [
            AirframeCheck(
                "turns into the wind while the aileron holds the roll (cn_beta)",
                f"{stiffness:.3g}",
                weathercock_problem(aircraft) is None,
                "without a rudder nothing holds the nose: check cn_beta, cn_da and cl_da",
            )
        ]
    if yaw.rudder == 0.0:
        text = "the rudder does nothing: check cn_dr, or say `surface_limits_deg: {rudder: none}`"
        return [AirframeCheck(NO_RUDDER, "0", False, text)]
    effective = remaining_side_force(aircraft, V)
    tau_s = aircraft.mass_kg * V / -effective if effective != 0.0 else math.inf
    sideslip = AirframeCheck(
        SIDESLIP,
        f"{tau_s:.3g} s",
        0.0 < tau_s < math.inf,
        "sideslip would grow until the rudder is at its stop: `surviving` and `tube` hold the "
        "heading by bank; other laws lose it",
    )
    turns = roll.aileron != 0.0 and aircraft.has("aileron")
    return [_pairing(aircraft), sideslip] if turns else [sideslip]


def _pairing(aircraft: Aircraft) -> AirframeCheck:
    gain = relative_gain(aircraft)
    if is_coupled(aircraft):
        text = (
            "aileron and rudder do much of each other's work: `tube` plans both together, "
            "`surviving`, `backstepping` and `proposed` invert both; `pid`, a loop for each, may "
            "swing"
        )
    else:
        text = (
            "aileron and rudder undo each other's work: little is left to turn about one axis; "
            "roll and yaw take small steps, and many messages"
        )
    return AirframeCheck(
        PAIRING, f"{gain:.2f}", MIN_RELATIVE_GAIN <= gain <= _MAX_RELATIVE_GAIN, text
    )


def _surfaces_that_do_nothing(aircraft: Aircraft, flight: LevelFlight) -> Iterator[AirframeCheck]:
    """Yield a check that is not met for an aileron or an elevator without a moment, if any."""
    V = flight.airspeed_m_s
    by_aileron = lateral(V, aircraft_record(aircraft)).rolling.aileron
    by_elevator = authority(aircraft, V).get("elevator", 0.0)
    for surface, moment, checked in (
        ("aileron", by_aileron, "check cl_da"),
        ("elevator", by_elevator, "check cm_de"),
    ):
        if moment == 0.0 or not aircraft.has(surface):
            text = f"it does nothing, and every law needs it: {checked} and its stops"
            yield AirframeCheck(f"moment by {surface}", "0", False, text)


def _surfaces_within_stops(aircraft: Aircraft, flight: LevelFlight) -> list[AirframeCheck]:
    angles = flight.aileron_deg, flight.elevator_deg, flight.rudder_deg
    found = []
    for name, angle, (low, high) in zip(SURFACES, angles, aircraft.stops_deg, strict=True):
        if aircraft.has(name):
            share = angle / (high if angle > 0.0 else low)
            what, value = f"{name} in level flight", f"{share:.0%} of its stop"
            found.append(AirframeCheck(what, value, share < 1.0, _NO_TRIM))
    return found
