"""Modes of straight, level flight: small motions about it, by eigenvalues."""

import math
from typing import NamedTuple

import numpy as np

from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.level_flight import LevelFlight, velocity_at
from sitl_plant.airframe.rigid_body import STILL_AIR, state_derivative
from sitl_plant.airframe.thrust import with_any_thrust

_STEP = 1e-6  # of the differences
_LONGITUDINAL, _LATERAL = (0, 2, 3, 6), (1, 4, 5, 7)  # u, w, θ, q and v, φ, p, r of the states
_REST = (0.0, 0.0, 0.0)
_ALONG = "short period", "phugoid", "phugoid"
_ACROSS = "dutch roll", "roll", "spiral"
"""Names of the modes: of what mostly moves the nose, and of the rest, the faster first."""
_OF_THE_NOSE = (1, 3), (0, 3)  # w, q and v, r of those states


class Mode(NamedTuple):
    """A mode of straight, level flight."""

    name: str
    frequency_rad_s: float  # natural frequency; of an aperiodic mode 1/|time constant|
    damping: float  # ratio; of an aperiodic mode 1, of one that grows -1

    @property
    def is_aperiodic(self) -> bool:
        """Whether it does not swing."""
        return abs(self.damping) == 1.0


def modes(aircraft: Aircraft, flight: LevelFlight) -> list[Mode]:
    """Return the modes of small motions about a level flight, the longitudinal ones first.

    The thrust is held: a command asks for it in N.
    """
    record = with_any_thrust(aircraft_record(aircraft))
    alpha, beta, aileron, elevator, rudder = map(math.radians, flight[1:6])

    def slope(x: np.ndarray) -> np.ndarray:
        u, v, w, pitch, roll, p, q, r = x.tolist()
        _, v_dot, phi_dot, omega_dot = state_derivative(
            (_REST, (u, v, w), (roll, pitch, 0.0), (p, q, r)),
            flight.thrust_n,
            (aileron, elevator, rudder),
            _REST,
            _REST,
            STILL_AIR,
            record,
        )
        return np.array([*v_dot, phi_dot[1], phi_dot[0], *omega_dot])

    velocity = velocity_at(flight.airspeed_m_s, alpha, beta)
    at = np.array([*velocity, alpha, math.radians(flight.roll_deg), *_REST])
    steps = _STEP * np.eye(8)
    A = np.column_stack([(slope(at + h) - slope(at - h)) / (2.0 * _STEP) for h in steps])
    along, across = (A[np.ix_(part, part)] for part in (_LONGITUDINAL, _LATERAL))
    return [
        *_named(along, _OF_THE_NOSE[0], _ALONG),
        *_named(across, _OF_THE_NOSE[1], _ACROSS),
    ]


def _named(A: np.ndarray, nose: tuple[int, int], names: tuple[str, str, str]) -> list[Mode]:
    """Name the modes of four states by what takes part in them, and by their speed.

    The four eigenvalues are two pairs, conjugate or real. In one of them the states of the nose
    take the greater part: the participation of a state in a mode, of left and right eigenvector,
    has no unit.

    Args:
        A: Of the motion, shape (4, 4).
        nose: Indices of the states of the nose.
        names: Of the modes of the nose, and of the rest, the faster first.
    """
    values, right = np.linalg.eig(A)
    part = np.abs(right * np.linalg.inv(right).T)
    share = part[list(nose)].sum(axis=0) / part.sum(axis=0)
    swinging = [[k] for k in range(4) if values[k].imag > 0.0]
    aperiodic = sorted((k for k in range(4) if values[k].imag == 0.0), key=lambda k: -share[k])
    pairs = [*swinging, *(aperiodic[k : k + 2] for k in range(0, len(aperiodic), 2))]
    of_nose, rest = sorted(pairs, key=lambda pair: -share[pair].mean())
    own, faster, slower = names
    found = [(own, values[k]) for k in _by_speed(values, of_nose)]
    if len(rest) == 1:
        both = faster if faster == slower else f"{faster} and {slower}"
        return [_mode(*one) for one in (*found, (both, values[rest[0]]))]
    singles = zip((faster, slower), values[_by_speed(values, rest)], strict=True)
    return [_mode(*one) for one in (*found, *singles)]


def _by_speed(values: np.ndarray, which: list[int]) -> list[int]:
    return sorted(which, key=lambda k: -abs(values[k]))


def _mode(name: str, value: complex) -> Mode:
    if value.imag == 0.0:
        return Mode(name, float(abs(value.real)), -math.copysign(1.0, value.real))
    return Mode(name, float(abs(value)), float(-value.real / abs(value)))
