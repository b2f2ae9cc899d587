"""Prediction check: replan the channels whose outputs are predicted to leave their tubes."""

import math

import numpy as np

from ftc_autopilot.control.inversion import deflections_for, thrust_for
from ftc_autopilot.control.laws.tube.parameters import (
    AIRSPEED,
    CHANNELS,
    OUTPUTS,
    PITCH,
    ROLL,
    YAW,
)
from ftc_autopilot.control.laws.tube.plan import CommandChange, best_change, first_exit
from ftc_autopilot.control.laws.tube.prediction import PredictionStart, ServoModel, predict
from ftc_autopilot.control.laws.tube.tube import build_tube, to_errors
from ftc_autopilot.control.step import Step
from mavlink_defs.constants import AILERON, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.rigid_body import angular_acceleration
from sitl_plant.airframe.stops import range_of
from sitl_plant.airframe.thrust import available_thrust, reach_of, thrust_moment
from sitl_plant.vec3 import add, clamp, mat3, mul, scale, sub, vec3

_ORDER = (AIRSPEED, YAW, ROLL, PITCH, YAW, ROLL)  # in which outputs are planned
_AGAIN = 4  # from there on: if aileron and rudder go together, and are sent
_SMALL_ANGLE, _SMALL_THRUST = 0.01, 10.0  # change of a command that shows its influence [rad, N]
_NO_CHANGE = 1e-12
_ROUNDING_S = 1e-9
_CLOCK_SHARE = 0.9  # of a clock's period after which a plan keeps an error in its tube


@inlined
def check(
    now: Step,
    positions: np.ndarray,
    no_rudder: bool,
    aircraft: AircraftRecord,
    gains: np.void,
    state: np.void,
    commands: np.ndarray,
) -> int:
    """Predict under the commands in force; change those whose outputs are about to leave.

    A trigger that sends by the clock has its channels planned when they are due instead, and the
    plan begins no earlier than the next transmission.

    The outputs are planned one after the other, each with the commands of those before it. In the
    law's first step all are, from commands that balance moments and drag, at which the servos are
    at rest. Where aileron and rudder go together, what is sent for one of roll and yaw serves the
    other as well.

    Args:
        now: The present step.
        positions: Of the servos [rad, rad, rad, N], shape (4,).
        no_rudder: Whether yaw is left alone.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Tube`.
        state: Record of dtype `Tube.STATE`, updated in place.
        commands: In force [rad, rad, rad, N], shape (4,), updated.

    Returns:
        Bit mask of the channels that got a new command.
    """
    if now.first:
        trim(now, aircraft, commands)
    start = _start(now, positions, gains, state)
    lag, h, rows, lead = (
        start.servo.lag,
        gains["prediction_step_s"],
        gains["prediction_steps"],
        gains["lead_s"],
    )
    seen = min(int((max(lead[0], lead[1], lead[2], lead[3]) + lag) / h) + 2, rows)
    tables = np.empty((4, OUTPUTS, rows))
    path, width, error = tables[0], tables[1], tables[2]
    build_tube(now, seen, gains, path, width)
    _predict_errors(start, commands, h, seen, aircraft, path, error)
    mask, together = 0, _go_together(now, no_rudder, gains)
    for k in range(len(_ORDER)):
        o = _ORDER[k]
        j = CHANNELS[o]
        if no_rudder and o == YAW:
            state["exit"][j] = math.nan
            continue
        by_clock = now.clock_s[j] > 0.0
        channels = 1 << j
        if together and o in (ROLL, YAW):
            channels = 1 << AILERON | 1 << RUDDER
        is_sent = together and mask & channels == channels
        if k >= _AGAIN and not is_sent:
            continue
        leaves = first_exit(error[o, :seen], width[o, :seen])
        if k < _AGAIN:
            _note_exit(leaves * h, leaves == seen, j, gains, state)
        turn = leaves * h < lead[o] + lag and _have_rested(now, channels, gains, state)
        if by_clock:
            turn = bool(now.due & (1 << j))
        if not (now.first or turn or is_sent):
            continue
        if seen < rows:
            seen = rows
            build_tube(now, rows, gains, path, width)
            _predict_errors(start, commands, h, rows, aircraft, path, error)
        plan = _plan(now, o, together, start, commands, aircraft, gains, tables)
        least_s = 0.0 if is_sent else gains["gain_s"]
        # A rudder's plan begins later than it is sent for: what leaves before, no plan keeps in.
        # The moves of a suspect rudder show what it is.
        is_suspect = state["fallback"]["diagnosis"]["actuators"][RUDDER]["suspect_s"] > 0.0
        if o == YAW and not together and not is_suspect:
            leaves = plan.first + first_exit(error[o, plan.first :], width[o, plan.first :])
        worth = abs(plan.change) > _NO_CHANGE and (plan.leaves - leaves) * h >= least_s
        if not (now.first or by_clock or worth):
            continue
        for c in range(N_CHANNELS):
            if channels & (1 << c):
                commands[c] += plan.change * _move(o, c, together, gains)
                if not (mask & (1 << c) or by_clock):
                    state["event_rate"][c] += 1.0
        state["exit"][j] = plan.leaves * h
        mask |= channels
        _predict_errors(start, commands, h, rows, aircraft, path, error)
    return mask


@inlined
def _go_together(now: Step, no_rudder: bool, gains: np.void) -> bool:
    """Return whether aileron and rudder are moved together: coupled, and by the clock both due."""
    both = 1 << AILERON | 1 << RUDDER
    by_clock = now.clock_s[AILERON] > 0.0 or now.clock_s[RUDDER] > 0.0
    are_due = not by_clock or now.due & both == both
    return bool(gains["coupled"] != 0 and not no_rudder and are_due)


@inlined
def _move(o: int, c: int, together: bool, gains: np.void) -> float:
    """Return by how much a plan of output o moves channel c."""
    if together:
        return float(gains["moves"][o, c])
    return 1.0 if c == CHANNELS[o] else 0.0


@inlined
def _have_rested(now: Step, channels: int, gains: np.void, state: np.void) -> bool:
    """Return whether the last events of channels, a bit mask, are long enough ago."""
    for c in range(N_CHANNELS):
        rest = (state["step"] - state["sent"][c]) * now.dt
        if channels & (1 << c) and rest < gains["dwell_s"] - _ROUNDING_S:
            return False
    return True


@inlined
def _start(now: Step, positions: np.ndarray, gains: np.void, state: np.void) -> PredictionStart:
    """Return what the predictions of a step start from."""
    diagnosis = gains["fallback"]["diagnosis"]
    servo = ServoModel(
        diagnosis["servo_lag_s"],
        diagnosis["servo_rate_limit_rad_s"],
        diagnosis["throttle"]["lag_s"],
    )
    if now.first:
        servo = ServoModel(0.0, math.inf, 0.0)
    return PredictionStart(
        ((0.0, 0.0, 0.0), now.motion.v, now.motion.phi, vec3(state["omega"])),
        positions,
        servo,
        state["disturbance"],
        state["disturbance_slope"],
        gains["persistence_s"],
        now.by_bank != 0,
    )


@compiled
def _predict_errors(
    start: PredictionStart,
    commands: np.ndarray,
    h: float,
    rows: int,
    aircraft: AircraftRecord,
    path: np.ndarray,
    error: np.ndarray,
) -> None:
    """Write the errors against the paths after h, 2h, ... under commands; as `predict`."""
    predict(start, commands, h, rows, aircraft, error)
    to_errors(error, path, rows)


@inlined
def _plan(
    now: Step,
    o: int,
    together: bool,
    start: PredictionStart,
    commands: np.ndarray,
    aircraft: AircraftRecord,
    gains: np.void,
    tables: np.ndarray,
) -> CommandChange:
    """Plan the change of the commands by which output o is planned.

    Args:
        now: The present step.
        o: The output.
        together: Whether aileron and rudder are moved together.
        start: What the prediction starts from.
        commands: In force [rad, rad, rad, N], shape (4,).
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Tube`.
        tables: Path, width, error, and room for another error, shape (4, OUTPUTS, rows).
    """
    h, j, rows = gains["prediction_step_s"], CHANNELS[o], tables.shape[2]
    path, width, error, influence = tables[0], tables[1], tables[2], tables[3]
    small = _SMALL_THRUST if j == THROTTLE else _SMALL_ANGLE
    if j == THROTTLE and aircraft["thrust_rows"] > 0:
        highest = reach_of(aircraft, j, now.motion.V)[1]
        commands[j] = min(commands[j], highest)
        if commands[j] + small > highest:  # there is no more, and less shows the influence as well
            small = -small
    moved = np.empty(N_CHANNELS)
    low, high = -math.inf, math.inf
    for c in range(N_CHANNELS):
        move = _move(o, c, together, gains)
        moved[c] = commands[c] + small * move
        if move != 0.0:
            lowest, highest = reach_of(aircraft, c, now.motion.V)
            one, other = (lowest - commands[c]) / move, (highest - commands[c]) / move
            low, high = max(low, min(one, other)), min(high, max(one, other))
    if low > high:  # one is at its stop, and would have to go back before the other may move
        low = high = 0.0
    _predict_errors(start, moved, h, rows, aircraft, path, influence)
    for k in range(rows):
        influence[o, k] = (influence[o, k] - error[o, k]) / small
    settled_s = max(gains["settle_s"][o], _CLOCK_SHARE * now.clock_s[j])
    return best_change(
        error[o],
        influence[o],
        width[o],
        min(int(settled_s / h), rows - 1),
        gains["plan_share"][o],
        low,
        high,
    )


@compiled
def trim(now: Step, aircraft: AircraftRecord, commands: np.ndarray) -> None:
    """Write the commands that balance the nominal moments, and hold the speed's derivative.

    The thrust depends on the deflections, and these on its moment: they are found twice.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        commands: Aileron, elevator, rudder [rad], thrust [N], within the stops, shape (4,).
    """
    motion, J = now.motion, mat3(aircraft["J"])
    N = motion.air.N
    for _ in range(2):
        turning = angular_acceleration(motion.omega, N, J, mat3(aircraft["J_inv"]))
        delta = deflections_for(scale(-1.0, mul(J, turning)), motion.air.C, aircraft)
        for i in range(3):
            lowest, highest = range_of(aircraft, i)
            commands[i] = clamp(delta[i], lowest, highest)
        thrust = thrust_for(now.reference.V_dot, motion, vec3(commands), aircraft)
        commands[THROTTLE] = clamp(thrust, 0.0, available_thrust(motion.V, aircraft))
        by_thrust = thrust_moment(commands[THROTTLE], aircraft)
        N = add(sub(motion.air.N, motion.by_thrust), by_thrust)


@compiled
def _note_exit(exit_s: float, beyond: bool, j: int, gains: np.void, state: np.void) -> None:
    """Note when channel j's output will leave its tube; beyond what was seen, as last planned."""
    planned = state["exit"][j] - gains["check_s"]
    state["exit"][j] = planned if beyond and planned > exit_s else exit_s
