"""Steady flight with one actuator stuck: what no controller can do better than.

At a given roll angle, everything follows from v̇ = 0, ω̇ = 0 and no climb. With aileron or rudder
stuck, the airspeed can be chosen and the aircraft turns; with elevator or throttle stuck, it can
fly straight and the airspeed follows.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from mavlink_defs.constants import ACTUATORS, AILERON, RUDDER, SURFACES, THROTTLE, Actuator
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.level_flight import NEWTONS, Steady, steady_flight
from sitl_plant.airframe.thrust import available_thrust, with_any_thrust

_CHOSEN_AIRSPEED = (AILERON, RUDDER)
_METRES_S = 50.0  # unit of airspeed in which it is of the order of an angle
_ENDS = 1e-3  # deg or N
ANY_SIDESLIP_DEG = 90.0
"""A limit that no sideslip exceeds."""


@dataclass(frozen=True)
class Trim:
    """A steady, level flight.

    Attributes:
        stuck: Actuator whose position is given.
        airspeed_m_s: Airspeed.
        aileron_deg: Deflection, as the two others.
        elevator_deg: Deflection.
        rudder_deg: Deflection.
        thrust_n: Thrust.
        alpha_deg: Angle of attack.
        beta_deg: Angle of sideslip.
        roll_deg: Roll angle, given.
        pitch_deg: Pitch angle.
        turn_rate_deg_s: Rate of the yaw angle.
        beyond: What would have to exceed the aircraft's limits; none: the flight is possible.
    """

    stuck: Actuator
    airspeed_m_s: float
    aileron_deg: float
    elevator_deg: float
    rudder_deg: float
    thrust_n: float
    alpha_deg: float
    beta_deg: float
    roll_deg: float
    pitch_deg: float
    turn_rate_deg_s: float
    beyond: tuple[str, ...] = ()

    @property
    def position(self) -> float:
        """Position of the stuck actuator [deg, of the throttle N]."""
        positions = (self.aileron_deg, self.elevator_deg, self.rudder_deg, self.thrust_n)
        return positions[ACTUATORS.index(self.stuck)]


def trim_stuck(
    aircraft: Aircraft,
    stuck: Actuator,
    position: float,
    airspeed_m_s: float = _METRES_S,
    roll_deg: float = 0.0,
    sideslip_limit_deg: float = ANY_SIDESLIP_DEG,
) -> Trim | None:
    """Return the level flight with one actuator stuck; None if the equations have no solution.

    Args:
        aircraft: The aircraft.
        stuck: The actuator.
        position: Where it is stuck [deg, throttle N].
        airspeed_m_s: Airspeed; where it follows from the position, the one to begin the search at.
        roll_deg: Roll angle; without a rudder, the one that balances the aircraft is found.
        sideslip_limit_deg: Largest sideslip of a flight that is possible: the coefficients are
            linear, and say nothing of an aircraft at right angles to the air.
    """
    record, channel = aircraft_record(aircraft), ACTUATORS.index(stuck)
    if channel != THROTTLE:
        record = with_any_thrust(record)
    value = position / NEWTONS if channel == THROTTLE else math.radians(position)
    turns = channel in _CHOSEN_AIRSPEED
    balanced_by_bank = not aircraft.has("rudder") and channel != RUDDER

    def tried(x: np.ndarray) -> Steady:
        alpha, beta, pitch, last, *controls = x.tolist()
        controls.insert(channel, value)
        roll = math.radians(roll_deg)
        if balanced_by_bank:
            roll, controls[RUDDER] = controls[RUDDER], 0.0
        aileron, elevator, rudder, thrust = controls
        V, turn_rate = (airspeed_m_s, last) if turns else (_METRES_S * last, 0.0)
        delta = aileron, elevator, rudder
        return Steady(V, alpha, beta, roll, pitch, delta, NEWTONS * thrust, turn_rate=turn_rate)

    begin = [0.05, 0.0, 0.05, 0.0 if turns else airspeed_m_s / _METRES_S, 0.0, 0.0, 0.0]
    if channel != THROTTLE:
        begin[-1] = 1.0
    found = steady_flight(record, tried, begin)
    if found is None:
        return None
    trim = _trim_of(stuck, found)
    beyond = (*_beyond(aircraft, channel, found),)
    if abs(trim.beta_deg) > sideslip_limit_deg:
        beyond = *beyond, "sideslip"
    roll_deg = trim.roll_deg if balanced_by_bank else roll_deg
    return replace(trim, roll_deg=roll_deg, beyond=beyond)


def _trim_of(stuck: Actuator, found: Steady) -> Trim:
    aileron, elevator, rudder = map(math.degrees, found.delta)
    return Trim(
        stuck=stuck,
        airspeed_m_s=found.airspeed,
        aileron_deg=aileron,
        elevator_deg=elevator,
        rudder_deg=rudder,
        thrust_n=found.thrust,
        alpha_deg=math.degrees(found.alpha),
        beta_deg=math.degrees(found.beta),
        roll_deg=math.degrees(found.roll),
        pitch_deg=math.degrees(found.pitch),
        turn_rate_deg_s=math.degrees(found.turn_rate),
    )


def _beyond(aircraft: Aircraft, stuck: int, flight: Steady) -> tuple[str, ...]:
    found: list[str] = [
        name
        for channel, (name, stops) in enumerate(zip(SURFACES, aircraft.stops_deg, strict=True))
        if channel != stuck and not stops[0] <= math.degrees(flight.delta[channel]) <= stops[1]
    ]
    most = available_thrust(flight.airspeed, aircraft_record(aircraft))
    if not 0.0 <= flight.thrust <= most and stuck != THROTTLE:
        found.append("throttle")
    if not aircraft.airspeed_min_m_s <= flight.airspeed <= aircraft.airspeed_max_m_s:
        found.append("airspeed")
    return tuple(found)


def stuck_range(
    aircraft: Aircraft,
    stuck: Actuator,
    airspeed_m_s: float = _METRES_S,
    roll_deg: float = 0.0,
    sideslip_limit_deg: float = ANY_SIDESLIP_DEG,
    step: float = 1.0,
) -> tuple[Trim, Trim] | None:
    """Return the level flights at both ends of the range of positions that can be flown, or None.

    The range is the longest one of positions `step` [deg, throttle 20 N] apart; its ends are then
    searched by bisection, unless they are the actuator's own.
    """
    if stuck == "throttle":
        low, high, step = 0.0, aircraft.thrust_limit_n, 20.0 * step
    else:
        low, high = aircraft.stops_deg[ACTUATORS.index(stuck)]

    def flown(position: float) -> Trim | None:
        trim = trim_stuck(aircraft, stuck, position, airspeed_m_s, roll_deg, sideslip_limit_deg)
        return trim if trim is not None and not trim.beyond else None

    grid = [float(x) for x in np.arange(low, high + step / 2.0, step)]
    found = [flown(position) for position in grid]
    first, length = _longest([trim is not None for trim in found])
    if length == 0:
        return None
    ends = []
    for inside, outside in ((first, first - 1), (first + length - 1, first + length)):
        best = found[inside]
        if best is not None and 0 <= outside < len(grid):
            near, far = grid[inside], grid[outside]
            while abs(far - near) > _ENDS:
                middle = (near + far) / 2.0
                trim = flown(middle)
                near, far, best = (middle, far, trim) if trim else (near, middle, best)
        ends.append(best)
    return ends[0], ends[1]  # type: ignore[return-value]  # both were flown


def _longest(flags: list[bool]) -> tuple[int, int]:
    """Return begin and length of the longest run of true values."""
    best, begin = (0, 0), None
    for i, flag in enumerate([*flags, False]):
        if flag and begin is None:
            begin = i
        elif not flag and begin is not None:
            best = max(best, (begin, i - begin), key=lambda run: run[1])
            begin = None
    return best
