"""Similarity: the units in which an aircraft is the one that the defaults were found on.

Measured in these units, it flies at the same airspeed, has the same mass, and its surfaces give it
the same angular accelerations. A parameter with a unit is multiplied by that unit's ratio.
"""

import math
import re
from typing import NamedTuple

from ftc_lab.design.airframe import Airframe, home

_DIMENSIONS = {  # of units: powers of length, mass, time
    "m": (1.0, 0.0, 0.0),
    "kg": (0.0, 1.0, 0.0),
    "s": (0.0, 0.0, 1.0),
    "N": (1.0, 1.0, -2.0),
    "Hz": (0.0, 0.0, -1.0),
    "rad": (0.0, 0.0, 0.0),
    "deg": (0.0, 0.0, 0.0),
    "steps": (0.0, 0.0, 0.0),
}
_STEP = 1.25  # largest change of the profile's airspeed, with a quarter to spare
_PEAK = 0.27  # of a triple pole's answer to a step: 2 e^-2, its largest acceleration by ω ΔV
_HALVES = 2.0  # the time scale is rounded to halves


class Similarity(NamedTuple):
    """An aircraft's units, in units of the aircraft that the defaults were found on."""

    time: float  # s: the aircraft is so many times slower
    velocity: float
    mass: float
    axes: tuple[float, float, float]  # time scales of roll, pitch and yaw
    stops: tuple[float, float, float]  # of aileron, elevator, rudder

    def factor(self, unit: str) -> float:
        """Return the ratio of a unit such as "rad^2/s^3" or "N s/m".

        Raises:
            KeyError: It has a part that is not known.
        """
        length, mass, time = dimensions(unit)
        ratio: float = (self.velocity * self.time) ** length * self.mass**mass * self.time**time
        return ratio

    def formula(self, unit: str) -> str:
        """Return what `factor` multiplies by as a text, such as "s^-1"; "" for 1."""
        length, mass, time = dimensions(unit)
        parts = (("v", length), ("m", mass), ("s", time + length))
        return " ".join(
            symbol if power == 1.0 else f"{symbol}^{power:g}" for symbol, power in parts if power
        )


def dimensions(unit: str) -> tuple[float, float, float]:
    """Return the powers of length, mass and time of a unit: "m/s^2" is (1, 0, -2)."""
    total = [0.0, 0.0, 0.0]
    above, *below = unit.split("/")
    for sign, part in ((1.0, above), *((-1.0, one) for one in below)):
        for symbol, power in re.findall(r"([A-Za-z]+)(?:\^(-?[\d.]+))?", part):
            for k, exponent in enumerate(_DIMENSIONS[symbol]):
                total[k] += sign * exponent * float(power or 1.0)
    return total[0], total[1], total[2]


def similarity(airframe: Airframe) -> Similarity:
    """Return the units of an aircraft.

    An axis is slower by the square root of what its surface can do less. The whole is as slow as
    roll and pitch together, or as the thrust, where that could not follow the reference's steps of
    airspeed otherwise; rounded to halves, and at least 1. A rudder that it has not is as the whole.
    """
    known = home()
    pairs = zip(known.authority, airframe.authority, strict=True)
    roll, pitch, yaw = (math.sqrt(most / one) if one > 0.0 else math.inf for most, one in pairs)
    velocity = airframe.airspeed / known.airspeed
    slowest = max(1.0, math.sqrt(roll * pitch), _by_thrust(airframe, velocity))
    stops = zip(airframe.stops, known.stops, strict=True)
    a, b, c = (x / most if x > 0.0 else 1.0 for x, most in stops)
    if not airframe.aircraft.has("rudder"):
        yaw = slowest
    return Similarity(
        max(1.0, round(slowest * _HALVES) / _HALVES),
        velocity,
        airframe.aircraft.mass_kg / known.aircraft.mass_kg,
        (max(1.0, roll), max(1.0, pitch), max(1.0, yaw)),
        (a, b, c),
    )


def _by_thrust(airframe: Airframe, velocity: float) -> float:
    """Return the time scale at which the thrust can follow a step of airspeed of the profile.

    A reference filter of triple pole ω = 2.5/s accelerates by 0.27 ω ΔV at most; ΔV is 5 m/s.
    """
    needed = _PEAK * 2.5 * 5.0 * velocity * _STEP
    return needed / max(airframe.thrust_to_spare / airframe.aircraft.mass_kg, 1e-9)
