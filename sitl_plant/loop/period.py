"""One aircraft of the plant over one control period.

The actuator command is held over the period (zero-order hold) and followed by the servos; faults
and stops act on what these do. Eqs. (1) to (4) are integrated by the classical Runge-Kutta method
of fourth order with the period as its step.
"""

import math
from typing import NamedTuple

import numpy as np

from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.faults.actuators import MAX_FAULTS
from mavlink_defs.faults.table import FAULT
from mavlink_defs.runtime.jit import apart, compiled, inlined
from sitl_plant.actuators.faults import Controls, apply_faults
from sitl_plant.actuators.servo import SERVOS, end_period, positions
from sitl_plant.air.disturbance import Disturbances
from sitl_plant.air.turbulence import TURBULENCE
from sitl_plant.air.wind import WIND, air_around
from sitl_plant.airframe.aerodynamics import FLOW, aerodynamics_in, note_flow, noted_flow
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.airframe.contact import (
    GEAR,
    beside_the_ground,
    hold_points,
    launch,
    note_contact,
    note_nearness,
    rudder_share,
)
from sitl_plant.airframe.rigid_body import (
    R1,
    Air,
    State,
    advance,
    derivative_in,
    load_state,
    specific_force,
    store_state,
)
from sitl_plant.airframe.thrust import made_thrust
from sitl_plant.vec3 import Vec3, add, mul, norm, sub, vec3

PITCH_MAX_RAD = math.radians(89.0)
AIRSPEED_MIN_M_S = 3.0
AIRSPEED_MAX_M_S = 300.0


class Environment(NamedTuple):
    """An aircraft and what acts on it beside its commands."""

    servos: np.void  # dtype SERVOS
    faults: np.ndarray  # (MAX_FAULTS,), dtype FAULT
    wind: np.void  # dtype WIND
    turbulence: np.void  # dtype TURBULENCE
    aircraft: AircraftRecord  # dtype AIRCRAFT
    gear: np.void  # dtype GEAR
    flow: np.void  # dtype FLOW, at the last step


@compiled
def time_s(step: int, step_us: int) -> float:
    """Return the simulation time of a step [s]: the double nearest to the decimal number."""
    return step * step_us / 1e6


@inlined
def rk4_step(
    state: State,
    t: float,
    dt: float,
    disturbed: tuple[Disturbances, Disturbances, Disturbances],
    environment: Environment,
    begun: float,
    real: Controls,
    near: bool,
) -> State:
    """Integrate eqs. (1) to (4) from t to t + dt [s].

    Args:
        state: State at t.
        t: Start of the interval [s].
        dt: Its length [s].
        disturbed: As `sitl_plant.air.disturbance.disturbances_over` returns it: the same for all
            aircraft, so that it is evaluated once.
        environment: The aircraft and what acts on it.
        begun: When the control period began [s].
        real: What the actuators do at t.
        near: Whether the ground may be touched; a constant, which costs nothing in the air.
    """
    at_start, at_middle, at_end = disturbed
    servos, faults, aircraft = environment.servos, environment.faults, environment.aircraft
    steady = servos["ideal"] == 1 and faults[0]["target"] < 0
    here, reached = state, state
    for stage in range(4):  # once in machine code, which four times would not fit the cache
        ahead, now, acting, share = 0.5 * dt, t + 0.5 * dt, at_middle, dt / 3.0
        if stage == 0:
            now, acting, share = t, at_start, dt / 6.0
        elif stage == 2:
            ahead = dt
        elif stage == 3:
            now, acting, share = t + dt, at_end, dt / 6.0
        if stage > 0 and not steady:
            real = apply_faults(positions(servos, now - begun), now, begun, faults, aircraft)
        slope = _slope(here, now, real, acting, environment, near)
        reached = advance(reached, share, slope)
        here = advance(state, ahead, slope)
    return reached


@inlined
def _slope(
    state: State,
    t: float,
    real: Controls,
    disturbed: Disturbances,
    environment: Environment,
    near: bool,
) -> State:
    aircraft = environment.aircraft
    da, de, dr, thrust = real
    d_v, d_omega = disturbed
    air = air_around(environment.wind, environment.turbulence, state[0], state[2], t)
    if near:
        d_v, d_omega, air = beside_the_ground(
            state, (da, de, dr), d_v, d_omega, air, aircraft, environment.gear
        )
    flow = noted_flow(sub(state[1], air[0]), environment.flow)
    return derivative_in(flow, state, thrust, (da, de, dr), d_v, d_omega, air[1], aircraft)


@compiled
def step_aircraft(
    x: np.ndarray,
    t: float,
    dt: float,
    disturbed: tuple[Disturbances, Disturbances, Disturbances],
    environment: Environment,
    V: float,
    applied: np.ndarray,
) -> None:
    """Advance one aircraft and its servos in place by one control period.

    Near the ground it is advanced in steps that its gear is slow against; disturbances act in each
    of these as over the whole period.

    Args:
        x: State, shape (12,), in the order of `State`.
        t: Start of the period [s].
        dt: Control period [s].
        disturbed: Disturbances at the period's start, middle and end.
        environment: The aircraft and what acts on it; its servos have begun the period.
        V: Airspeed at the start of the period [m/s].
        applied: True positions and thrust then, shape (4,), written.
    """
    moved = positions(environment.servos, 0.0)
    real = apply_faults(moved, t, t, environment.faults, environment.aircraft)
    for i in range(N_CHANNELS):
        applied[i] = real[i]
    applied[THROTTLE] = made_thrust(real[THROTTLE], V, environment.aircraft)
    if environment.gear["near"] == 1:
        step_near_ground(x, t, dt, disturbed, environment)
    else:
        state = rk4_step(load_state(x), t, dt, disturbed, environment, t, real, False)
        store_state(state, x)
    end_period(environment.servos, dt)


_ANY = Environment(
    np.zeros(1, SERVOS)[0],
    np.zeros(MAX_FAULTS, FAULT),
    np.zeros(1, WIND)[0],
    np.zeros(1, TURBULENCE)[0],
    np.zeros(1, AIRCRAFT)[0],
    np.zeros(1, GEAR)[0],
    np.zeros(1, FLOW)[0],
)


@apart(x=np.zeros(12), environment=_ANY)
def step_near_ground(
    x: np.ndarray,
    t: float,
    dt: float,
    disturbed: tuple[Disturbances, Disturbances, Disturbances],
    environment: Environment,
) -> None:
    """Advance an aircraft near the ground, in steps that its gear is slow against.

    Disturbances act in each of these as over the whole period. Arguments are as of
    `step_aircraft`.
    """
    gear, aircraft = environment.gear, environment.aircraft
    servos, faults = environment.servos, environment.faults
    count = math.ceil(dt / gear["longest_step"])
    h, state = dt / count, load_state(x)
    for k in range(count):
        before, now = state, t + k * h
        real = apply_faults(positions(servos, now - t), now, t, faults, aircraft)
        state = rk4_step(before, now, h, disturbed, environment, t, real, True)
        real = apply_faults(positions(servos, (k + 1) * h), now + h, t, faults, aircraft)
        load = hold_points(state, rudder_share(real[RUDDER], aircraft), gear)
        note_contact(before, now, state[0], load, aircraft, gear)
    store_state(state, x)


@compiled
def actuators_over(
    t: float,
    dt: float,
    environment: Environment,
    V: float,
    applied: np.ndarray,
    at_end: np.ndarray,
) -> None:
    """Take the servos of one aircraft to the end of a control period, without any motion of it.

    Args:
        t: Start of the period [s].
        dt: Control period [s].
        environment: The aircraft and what acts on it; its servos have begun the period.
        V: Airspeed [m/s].
        applied: True positions and thrust at the start of the period, shape (4,), written.
        at_end: The same at its end.
    """
    aircraft, faults = environment.aircraft, environment.faults
    begun = apply_faults(positions(environment.servos, 0.0), t, t, faults, aircraft)
    ended = apply_faults(positions(environment.servos, dt), t + dt, t, faults, aircraft)
    for i in range(N_CHANNELS):
        applied[i], at_end[i] = begun[i], ended[i]
    applied[THROTTLE] = made_thrust(begun[THROTTLE], V, aircraft)
    at_end[THROTTLE] = made_thrust(ended[THROTTLE], V, aircraft)
    end_period(environment.servos, dt)


@compiled
def specific_force_at(
    x: np.ndarray,
    step: int,
    step_us: int,
    d_v: Vec3,
    surrounding: Air,
    environment: Environment,
) -> Vec3:
    """Return the specific force at a step [m/s²], body axes.

    The actuators count as they are at this instant: at the end of the period that ends here.

    Args:
        x: State, shape (12,).
        step: Step number.
        step_us: Control period [µs].
        d_v: Disturbance of the acceleration at the step [m/s²].
        surrounding: Motion of the air at the step.
        environment: The aircraft and what acts on it.
    """
    servos, aircraft = environment.servos, environment.aircraft
    t = time_s(step, step_us)
    _, v, _, omega = load_state(x)
    moved = servos["output"][0], servos["output"][1], servos["output"][2], servos["output"][3]
    real = apply_faults(moved, t, time_s(step - 1, step_us), environment.faults, aircraft)
    delta = real[AILERON], real[ELEVATOR], real[RUDDER]
    flow = note_flow(sub(v, surrounding[0]), environment.flow)
    air = aerodynamics_in(flow, sub(omega, surrounding[1]), aircraft)
    return add(specific_force(air, delta, real[THROTTLE], aircraft), d_v)


@apart(x=np.zeros(12), environment=_ANY)
def force_near_ground(
    x: np.ndarray, step: int, step_us: int, d_v: Vec3, surrounding: Air, environment: Environment
) -> Vec3:
    """Return what accelerometers feel near the ground, as `specific_force_at` does."""
    t, aircraft, servos = time_s(step, step_us), environment.aircraft, environment.servos
    moved = servos["output"][0], servos["output"][1], servos["output"][2], servos["output"][3]
    real = apply_faults(moved, t, time_s(step - 1, step_us), environment.faults, aircraft)
    delta = real[AILERON], real[ELEVATOR], real[RUDDER]
    d_v, _, surrounding = beside_the_ground(
        load_state(x), delta, d_v, (0.0, 0.0, 0.0), surrounding, aircraft, environment.gear
    )
    return specific_force_at(x, step, step_us, d_v, surrounding, environment)


GROUND_PARTS = (note_nearness, launch, step_near_ground, beside_the_ground, force_near_ground)
"""What an aircraft with gear needs near the ground."""


@compiled
def is_lost(x: np.ndarray, wind: np.ndarray) -> bool:
    """Return whether a state, shape (12,), has left the range in which the model is valid.

    That is: a number is not finite, the pitch angle is beyond ±89° (Euler angles), or the
    airspeed is outside 3 to 300 m/s.

    Args:
        x: The state.
        wind: Velocity of the air, body axes [m/s], shape (3,).
    """
    V = norm(sub(vec3(x[3:6]), vec3(wind)))
    return is_lost_on_ground(x, wind) or V < AIRSPEED_MIN_M_S


@compiled
def is_lost_on_ground(x: np.ndarray, wind: np.ndarray) -> bool:
    """Return the same of an aircraft that may stand on the ground, at no airspeed."""
    for i in range(12):
        if not math.isfinite(x[i]):
            return True
    V = norm(sub(vec3(x[3:6]), vec3(wind)))
    return abs(x[7]) > PITCH_MAX_RAD or V > AIRSPEED_MAX_M_S


def describe_loss(x: np.ndarray, wind: np.ndarray, stall: float = 0.0) -> str:
    """Describe in what way a state is lost, or the hit of the ground, and whether it had stalled.

    Args:
        x: As of `is_lost`.
        wind: As of `is_lost`.
        stall: Angle of attack at which the aircraft stalls [rad]; 0: none is known.
    """
    if not np.isfinite(x).all():
        return "its state is not finite"
    through = sub(vec3(x[3:6]), vec3(wind))
    alpha = math.atan2(through[2], through[0])
    stalled = ""
    if 0.0 < stall < abs(alpha):
        angles = f"{math.degrees(alpha):.1f}°, its stall is at {math.degrees(stall):.1f}°"
        stalled = f"; it had stalled: angle of attack {angles}"
    if not is_lost(x, wind):
        return f"it hit the ground, sinking at {_sink_rate_m_s(x):.1f} m/s{stalled}"
    pitch_deg, V = math.degrees(x[7]), norm(through)
    limits = f"pitch {pitch_deg:.1f}° (limit ±89°), airspeed {V:.1f} m/s (limits 3 to 300 m/s)"
    return f"{limits}{stalled}"


def _sink_rate_m_s(x: np.ndarray) -> float:
    """Return the rate of descent of a state, shape (12,) [m/s]."""
    return mul(R1(vec3(x[6:9])), vec3(x[3:6]))[2]
