"""Straight, level flight of an aircraft: its trim, its modes, and what its surfaces can do."""

import math
from typing import NamedTuple

import numpy as np

from mavlink_defs.constants import SURFACES
from sitl_plant.airframe.aerodynamics import control_effectiveness
from sitl_plant.airframe.aircraft import AircraftRecord, aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import R1, STILL_AIR, State, state_derivative
from sitl_plant.airframe.thrust import available_thrust, with_any_thrust
from sitl_plant.vec3 import Vec3, mul

_NEWTONS = 1000.0  # thrust is of the order of one in the solver's unit
_STEP = 1e-6  # of the differences
_LONGITUDINAL, _LATERAL = (0, 2, 3, 6), (1, 4, 5, 7)  # u, w, θ, q and v, φ, p, r of the states
_REST = (0.0, 0.0, 0.0)
_ALONG = "short period", "phugoid", "phugoid"
_ACROSS = "dutch roll", "roll", "spiral"
"""Names of the modes: of what mostly moves the nose, and of the rest, the faster first."""
_OF_THE_NOSE = (1, 3), (0, 3)  # w, q and v, r of those states
_LARGEST = math.radians(30.0)  # of α and β: the coefficients are linear, and say nothing beyond
_AIRSPEEDS = 25  # at which level flight is looked for
_SPEED_ENDS = 0.01  # m/s
_LEFT = 1e-6  # m/s², rad/s² and m/s that a trim may leave


class LevelFlight(NamedTuple):
    """Trim of straight, level flight; angles in degrees.

    Without a rudder, a bank takes its part, which is 0 if the aircraft is symmetric.
    """

    airspeed_m_s: float
    alpha_deg: float
    beta_deg: float
    aileron_deg: float
    elevator_deg: float
    rudder_deg: float
    thrust_n: float
    roll_deg: float = 0.0


class Mode(NamedTuple):
    """A mode of straight, level flight."""

    name: str
    frequency_rad_s: float  # natural frequency; of an aperiodic mode 1/|time constant|
    damping: float  # ratio; of an aperiodic mode 1, of one that grows -1

    @property
    def is_aperiodic(self) -> bool:
        """Whether it does not swing."""
        return abs(self.damping) == 1.0


def level_flight(aircraft: Aircraft, airspeed_m_s: float) -> LevelFlight | None:
    """Return straight, level flight at an airspeed, within stops or not; None if there is none.

    The thrust is what the flight takes, whether the propulsion can make it or not.
    """
    from scipy.optimize import root

    record = with_any_thrust(aircraft_record(aircraft))

    has_rudder = aircraft.has("rudder")

    def unrest(x: np.ndarray) -> list[float]:
        state, delta, thrust = _unpacked(x, airspeed_m_s, has_rudder)
        _, v_dot, _, omega_dot = _derivative(state, delta, thrust, record)
        return [*v_dot, *omega_dot, mul(R1(state[2]), state[1])[2]]

    found = root(unrest, [0.05, 0.0, 0.05, 0.0, 0.0, 0.0, 0.1], tol=1e-10)
    alpha, beta, _, aileron, elevator, last, thrust = (float(part) for part in found.x)
    rudder, roll = (last, 0.0) if has_rudder else (0.0, last)
    is_solved = found.success and max(map(abs, unrest(found.x))) <= _LEFT
    if not is_solved or max(abs(alpha), abs(beta)) > _LARGEST:
        return None
    return LevelFlight(
        airspeed_m_s=airspeed_m_s,
        alpha_deg=math.degrees(alpha),
        beta_deg=math.degrees(beta),
        aileron_deg=math.degrees(aileron),
        elevator_deg=math.degrees(elevator),
        rudder_deg=math.degrees(rudder),
        thrust_n=_NEWTONS * thrust,
        roll_deg=math.degrees(roll),
    )


def modes(aircraft: Aircraft, flight: LevelFlight) -> list[Mode]:
    """Return the modes of small motions about a level flight, the longitudinal ones first.

    The thrust is held: a command asks for it in N.
    """
    record = with_any_thrust(aircraft_record(aircraft))
    has_rudder = aircraft.has("rudder")
    last = flight.rudder_deg if has_rudder else flight.roll_deg
    angles = [flight.alpha_deg, flight.beta_deg, flight.alpha_deg, *flight[3:5], last]
    packed = np.array([*np.radians(angles), flight.thrust_n / _NEWTONS])
    state, delta, thrust = _unpacked(packed, flight.airspeed_m_s, has_rudder)

    def slope(x: np.ndarray) -> np.ndarray:
        v, phi, omega = x[:3], (float(x[4]), float(x[3]), 0.0), x[5:]
        moved = (_REST, tuple(v.tolist()), phi, tuple(omega[[0, 1, 2]].tolist()))
        _, v_dot, phi_dot, omega_dot = _derivative(moved, delta, thrust, record)
        return np.array([*v_dot, phi_dot[1], phi_dot[0], *omega_dot])

    at = np.array([*state[1], state[2][1], state[2][0], *state[3]])
    steps = _STEP * np.eye(8)
    A = np.column_stack([(slope(at + h) - slope(at - h)) / (2.0 * _STEP) for h in steps])
    along, across = (A[np.ix_(part, part)] for part in (_LONGITUDINAL, _LATERAL))
    return [
        *_named(along, _OF_THE_NOSE[0], _ALONG),
        *_named(across, _OF_THE_NOSE[1], _ACROSS),
    ]


def largest_thrust(aircraft: Aircraft, airspeed_m_s: float) -> float:
    """Return the largest thrust at an airspeed [N]."""
    return float(available_thrust(airspeed_m_s, aircraft_record(aircraft)))


def fastest_level_flight(aircraft: Aircraft) -> float | None:
    """Return the highest airspeed within its limits at which its thrust holds level flight [m/s].

    It is searched from the fastest one down; None if there is no such flight.
    """
    low, high = aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s

    def is_held(V: float) -> bool:
        flight = level_flight(aircraft, V)
        return flight is not None and flight.thrust_n <= largest_thrust(aircraft, V)

    tried = np.linspace(high, low, _AIRSPEEDS).tolist()
    first = next((k for k, V in enumerate(tried) if is_held(V)), None)
    if first is None or first == 0:
        return None if first is None else high
    slow, fast = tried[first], tried[first - 1]
    while fast - slow > _SPEED_ENDS:
        middle = (slow + fast) / 2.0
        slow, fast = (middle, fast) if is_held(middle) else (slow, middle)
    return float(slow)


def authority(aircraft: Aircraft, airspeed_m_s: float) -> dict[str, float]:
    """Return the angular acceleration by full deflection of each surface [rad/s²].

    It is that to the side of the nearer stop.
    """
    effect = control_effectiveness(aircraft_record(aircraft)) * airspeed_m_s**2
    stops = np.radians(aircraft.stops_deg)
    return {
        name: abs(float(effect[i, i])) * float(np.abs(stops[i]).min())
        for i, name in enumerate(SURFACES)
        if aircraft.has(name)
    }


def _unpacked(x: np.ndarray, V: float, has_rudder: bool) -> tuple[State, Vec3, float]:
    alpha, beta, pitch, da, de, last, thrust = (float(part) for part in x)
    dr, roll = (last, 0.0) if has_rudder else (0.0, last)
    v = (
        V * math.cos(alpha) * math.cos(beta),
        V * math.sin(beta),
        V * math.sin(alpha) * math.cos(beta),
    )
    return (_REST, v, (roll, pitch, 0.0), _REST), (da, de, dr), _NEWTONS * thrust


def _derivative(state: State, delta: Vec3, thrust: float, record: AircraftRecord) -> State:
    found: State = state_derivative(state, thrust, delta, _REST, _REST, STILL_AIR, record)
    return found


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
