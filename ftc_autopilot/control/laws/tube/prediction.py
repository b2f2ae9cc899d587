"""Prediction of the outputs under held commands, by the nominal aircraft and its servos."""

import math
from typing import NamedTuple

import numpy as np

from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.actuators.lag import lagged
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.rigid_body import STILL_AIR, State, advance, state_derivative
from sitl_plant.vec3 import Vec3, clamp, norm


class ServoModel(NamedTuple):
    """The servos' model; without lag and limit they follow at once."""

    lag: float  # of the surfaces [s]
    limit: float  # of the surfaces [rad/s]
    throttle_lag: float  # s


class PredictionStart(NamedTuple):
    """What a prediction starts from."""

    state: State  # the velocity is that through the air, the position does not matter
    positions: np.ndarray  # of the servos [rad, N], shape (4,)
    servo: ServoModel
    disturbance: np.ndarray  # of v̇ and ω̇ [m/s², rad/s²], shape (6,)
    slope: np.ndarray  # its derivative, shape (6,)
    persistence: float  # of the slope [s]
    by_bank: bool = False  # heading is held by bank: minus the sideslip in place of the yaw angle


@compiled
def predict(
    start: PredictionStart,
    commands: np.ndarray,
    h: float,
    rows: int,
    aircraft: AircraftRecord,
    outputs: np.ndarray,
) -> None:
    """Predict airspeed [m/s] and attitude [rad] after h, 2h, ... by the midpoint rule.

    The disturbance's slope dies out: d(s) = d + τ (1 - e^{-s/τ}) d'.

    Args:
        start: Present state.
        commands: Held from now on: aileron, elevator, rudder [rad], thrust [N], shape (4,).
        h: Step [s].
        rows: Steps.
        aircraft: Nominal aircraft.
        outputs: Airspeed, roll, pitch, yaw, shape (4, at least rows), written.
    """
    state, servo = start.state, start.servo
    da, de, dr = start.positions[AILERON], start.positions[ELEVATOR], start.positions[RUDDER]
    thrust = start.positions[THROTTLE]
    half = 0.5 * h
    ageing, left = math.exp(-half / start.persistence), 1.0  # e^{-s/τ}, half a step after the other
    for k in range(rows):
        delta = (
            lagged(da, commands[AILERON], servo.lag, servo.limit, half),
            lagged(de, commands[ELEVATOR], servo.lag, servo.limit, half),
            lagged(dr, commands[RUDDER], servo.lag, servo.limit, half),
        )
        force = lagged(thrust, commands[THROTTLE], servo.throttle_lag, math.inf, half)
        da = lagged(da, commands[AILERON], servo.lag, servo.limit, h)
        de = lagged(de, commands[ELEVATOR], servo.lag, servo.limit, h)
        dr = lagged(dr, commands[RUDDER], servo.lag, servo.limit, h)
        thrust = lagged(thrust, commands[THROTTLE], servo.throttle_lag, math.inf, h)
        d_v, d_omega = _disturbance(start, left)
        derivative = state_derivative(state, force, delta, d_v, d_omega, STILL_AIR, aircraft)
        middle = advance(state, half, derivative)
        d_v, d_omega = _disturbance(start, left * ageing)
        left *= ageing * ageing
        derivative = state_derivative(middle, force, delta, d_v, d_omega, STILL_AIR, aircraft)
        state = advance(state, h, derivative)
        outputs[0, k] = norm(state[1])
        outputs[1, k], outputs[2, k], outputs[3, k] = state[2]
        if start.by_bank:
            outputs[3, k] = -math.asin(clamp(state[1][1] / outputs[0, k], -1.0, 1.0))


@compiled
def _disturbance(start: PredictionStart, left: float) -> tuple[Vec3, Vec3]:
    """Return the disturbances of v̇ and ω̇ when e^{-s/τ} of their slope is left."""
    d, slope = start.disturbance, start.slope
    share = start.persistence * (1.0 - left)
    return (
        (d[0] + share * slope[0], d[1] + share * slope[1], d[2] + share * slope[2]),
        (d[3] + share * slope[3], d[4] + share * slope[4], d[5] + share * slope[5]),
    )
