"""What the rules of a design read of an aircraft at its cruising speed."""

import math
from dataclasses import dataclass
from functools import cache, cached_property

from gcs.console.errors import BadInput
from gcs.scenario.aircraft_file import load_aircraft
from mavlink_defs.constants import SURFACES
from sitl_plant.airframe.aerodynamics import lateral, rate_damping
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.level_flight import (
    LevelFlight,
    authority,
    fastest_level_flight,
    largest_thrust,
    level_flight,
)


@dataclass(frozen=True)
class Airframe:
    """An aircraft in straight, level flight at its cruising speed.

    Attributes:
        name: As the user calls it.
        aircraft: The aircraft.
        flight: The level flight.
        authority: Angular acceleration by full aileron, elevator, rudder [rad/s²].
        stops: Least deflection to either side of aileron, elevator, rudder [rad].
        damping: Angular acceleration by roll, pitch and yaw rate, positive [1/s].
    """

    name: str
    aircraft: Aircraft
    flight: LevelFlight
    authority: tuple[float, float, float]
    stops: tuple[float, float, float]
    damping: tuple[float, float, float]

    @property
    def airspeed(self) -> float:
        """Cruising speed [m/s]."""
        return self.flight.airspeed_m_s

    @property
    def largest_thrust(self) -> float:
        """Largest thrust at the cruising speed [N]."""
        return largest_thrust(self.aircraft, self.airspeed)

    @property
    def thrust_to_spare(self) -> float:
        """The same less what level flight takes [N]."""
        return self.largest_thrust - self.flight.thrust_n

    @cached_property
    def fastest(self) -> float:
        """Highest airspeed for which its propulsion has the thrust, if its file says that [m/s]."""
        aircraft = self.aircraft
        if aircraft.propulsion is None:
            return aircraft.airspeed_max_m_s
        return fastest_level_flight(aircraft) or self.airspeed

    @property
    def engine_lag_s(self) -> float:
        """Lag of its own propulsion [s]."""
        propulsion = self.aircraft.propulsion
        return 0.0 if propulsion is None else propulsion.lag_s

    @property
    def effect(self) -> tuple[float, float, float]:
        """Angular acceleration by deflection of aileron, elevator, rudder [1/s²]."""
        pairs = zip(self.authority, self.stops, strict=True)
        a, b, c = (x / stop if stop > 0.0 else 0.0 for x, stop in pairs)
        return a, b, c


def cruise_of(aircraft: Aircraft) -> float:
    """Return the airspeed that an aircraft is designed for [m/s]: its cruise, or mid-range."""
    return aircraft.design_airspeed


def airframe_of(name: str, aircraft: Aircraft, airspeed: float | None = None) -> Airframe:
    """Return what rules need to know of an aircraft at an airspeed [m/s], its cruise by default.

    Raises:
        BadInput: The airspeed is not within its limits, or it has no level flight there.
    """
    low, high = aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s
    V = cruise_of(aircraft) if airspeed is None else airspeed
    if not low <= V <= high:
        text = f"expected [{low:g}, {high:g}] m/s, the limits of {name}"
        raise BadInput(f"--airspeed is {V:g}, {text}")
    flight = level_flight(aircraft, V)
    if flight is None:
        text = f"{name} has no straight, level flight at {V:g} m/s"
        raise BadInput(text, "choose another --airspeed, or check its lift and its moments")
    by_surface = authority(aircraft, V)
    aileron, elevator, rudder = (by_surface.get(surface, 0.0) for surface in SURFACES)
    return Airframe(
        name,
        aircraft,
        flight,
        (aileron, elevator, rudder),
        stops_of(aircraft),
        _damping(aircraft, V),
    )


def stops_of(aircraft: Aircraft) -> tuple[float, float, float]:
    """Return the least deflection to either side of aileron, elevator, rudder [rad]."""
    a, b, c = (math.radians(min(-low, high)) for low, high in aircraft.stops_deg)
    return a, b, c


def _damping(aircraft: Aircraft, V: float) -> tuple[float, float, float]:
    record, J = aircraft_record(aircraft), aircraft.inertia_kg_m2
    air, (_, pitch) = lateral(V, record), rate_damping(V, record)
    roll, yaw = air.scale * air.rolling.p, air.scale * air.yawing.r
    return abs(roll) / J.Jxx, abs(pitch) / J.Jyy, abs(yaw) / J.Jzz


@cache
def home() -> Airframe:
    """Return the aircraft that the defaults were found on: the paper's, at 45 m/s."""
    return airframe_of("paper", load_aircraft("paper"), 45.0)
