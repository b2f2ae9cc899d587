"""State predictor: compensates a known delay and bridges lost samples with the nominal model.

A law that is given the present state commands what acts only later. With a known delay it is given
the state at that time instead: the measured one, predicted over the delay under the commands that
are on their way. And a state that was lost is replaced, once the next one is there, by one between
its neighbours, so that filters and estimates advance by every control period.

A state names the command in force. That tells how late commands are at each state, and when nothing
is known of it; a diagnosis needs that, as it compares commands with what they do.
"""

import math

import numpy as np

from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.framing.codec import SIM_STATE
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_record
from sitl_plant.airframe.aerodynamics import aerodynamics
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.rigid_body import (
    STILL_AIR,
    State,
    advance,
    specific_force,
    state_derivative,
)
from sitl_plant.vec3 import add, sub, vec3

MAX_DELAY_S = 0.1
"""Longest delay that is predicted over, and longest gap that is interpolated [s]."""
_RESOLVED_S = 0.003
"""Longest gap of which interpolated states show when a command came into force in it [s]."""
UNKNOWN = -1
"""In place of an age: it is not known which command was in force."""
_HISTORY = 128  # periods that are remembered
_EVENTS = 64  # that are remembered

DELAY = np.dtype(
    [
        ("periods", "i8"),  # delay of the links [control periods]
        ("found", "i8"),  # dead time that the law has found besides [control periods]
        ("step", "i8"),  # last step whose commands are noted
        ("started", "i8"),  # 0: nothing is noted yet
        ("begun", "i8"),  # step since which no gap was too long to be resolved
        ("n_events", "i8"),  # events noted
        ("events", "i8", (_EVENTS,)),  # steps of the last ones
        ("commands", "f8", (N_CHANNELS,)),  # of the last step noted
        ("positions", "f8", (_HISTORY, N_CHANNELS)),  # of the servos' model after the last steps
        ("measured", SIM_STATE),  # last state received
        ("between", SIM_STATE),  # in place of a lost one
        ("predicted", SIM_STATE),
        ("smoothed", SIM_STATE),
        ("rates", "f8", (3,)),  # output of the low-pass [rad/s]
    ]
)
"""What is remembered of the link between an autopilot and its aircraft."""


@compiled
def lost_states(delay: np.void, measured: np.void, step_us: int) -> int:
    """Return how many states before this one are to be interpolated; none if they are too many.

    Args:
        delay: Record of dtype `DELAY`.
        measured: FTC_SIM_STATE payload.
        step_us: Control period [µs].
    """
    return 0 if is_after_gap(delay, measured, step_us) else _missing(delay, measured)


@compiled
def is_after_gap(delay: np.void, measured: np.void, step_us: int) -> bool:
    """Return whether states before this one were lost, too many to be interpolated.

    Args:
        delay: Record of dtype `DELAY`.
        measured: FTC_SIM_STATE payload.
        step_us: Control period [µs].
    """
    missing = _missing(delay, measured)
    return missing > 0 and missing > _periods(MAX_DELAY_S, step_us)


@compiled
def unresolved(delay: np.void, measured: np.void, step_us: int) -> int:
    """Return how many states before this one were lost if a command came into force meanwhile.

    It is not known when. If none did, interpolated states show what the actuators do.

    Args:
        delay: Record of dtype `DELAY`.
        measured: FTC_SIM_STATE payload.
        step_us: Control period [µs].
    """
    lost, before = lost_states(delay, measured, step_us), delay["measured"]["actuator_time_usec"]
    if measured["actuator_time_usec"] == before or lost <= _periods(_RESOLVED_S, step_us):
        return 0
    return lost


@compiled
def note_event(delay: np.void, step: int) -> None:
    """Note that a command was made in a step.

    Args:
        delay: Record of dtype `DELAY`, updated in place.
        step: The step.
    """
    delay["events"][delay["n_events"] % _EVENTS] = step
    delay["n_events"] += 1


@compiled
def age_in_force(delay: np.void, step: int, named: np.void, links: int, step_us: int) -> int:
    """Return by how many control periods the commands that a state shows are older than the step.

    That is `links`, unless the command that the state names says otherwise.

    Args:
        delay: Record of dtype `DELAY`.
        step: The step.
        named: FTC_SIM_STATE payload that names the command in force at it.
        links: Delay of the links [control periods].
        step_us: Control period [µs].

    Returns:
        The age, or UNKNOWN: a command made before the last gap is still on its way, or one made
        longer ago than `MAX_DELAY_S`.
    """
    count, events = delay["n_events"], delay["events"]
    applied = np.int64(named["actuator_time_usec"]) // step_us  # -1: none yet
    k = count - 1
    if k < 0 or (events[k % _EVENTS] <= applied and events[k % _EVENTS] < step - links):
        return links
    least = 0
    while k >= 0 and events[k % _EVENTS] > applied:
        if k == count - _EVENTS or events[k % _EVENTS] < delay["begun"]:
            return UNKNOWN
        least = step - events[k % _EVENTS]
        k -= 1
    age = max(links, least)
    if k >= max(0, count - _EVENTS):
        age = min(age, step - 1 - events[k % _EVENTS])
    longest = min(_periods(MAX_DELAY_S, step_us), _HISTORY - 1)
    return int(age) if age <= longest else UNKNOWN


@compiled
def _missing(delay: np.void, measured: np.void) -> int:
    """Return the number of states between the last step noted and this one."""
    if delay["started"] == 0:
        return 0
    return int(np.int64(measured["step"]) - delay["step"] - 1)


@compiled
def interpolate(delay: np.void, measured: np.void) -> np.void:
    """Return a state for the step after the last one, in place of that which was lost.

    Args:
        delay: Record of dtype `DELAY`; its field `between` is written and returned.
        measured: FTC_SIM_STATE payload, the first one after the gap.
    """
    before = delay["measured"]
    between: np.void = delay["between"]
    first, step = np.int64(before["step"]), delay["step"] + 1
    share = (step - first) / (np.int64(measured["step"]) - first)
    copy_record(between, measured)
    between["step"] = step
    _mix(before["velocity"], measured["velocity"], share, between["velocity"])
    _mix(before["attitude"], measured["attitude"], share, between["attitude"])
    _mix(before["rates"], measured["rates"], share, between["rates"])
    force = between["specific_force"]
    _mix(before["specific_force"], measured["specific_force"], share, force)
    _mix(before["wind"], measured["wind"], share, between["wind"])
    return between


@compiled
def _mix(before: np.ndarray, after: np.ndarray, share: float, result: np.ndarray) -> None:
    for k in range(3):
        result[k] = before[k] + share * (after[k] - before[k])


@compiled
def smoothed(delay: np.void, measured: np.void, filter_s: float, step_us: int) -> np.void:
    """Return the state with angular velocities that have passed a first-order low-pass.

    It starts at the first state, and again after a gap.

    Args:
        delay: Record of dtype `DELAY`; its fields `smoothed` and `rates` are written.
        measured: FTC_SIM_STATE payload.
        filter_s: Time constant of the low-pass [s]; 0: the measured state is returned.
        step_us: Control period [µs].
    """
    if filter_s == 0.0:
        return measured
    share = 1.0 - math.exp(-step_us / 1e6 / filter_s)
    if delay["started"] == 0 or is_after_gap(delay, measured, step_us):
        share = 1.0
    result: np.void = delay["smoothed"]
    copy_record(result, measured)
    for k in range(3):
        delay["rates"][k] += share * (measured["rates"][k] - delay["rates"][k])
        result["rates"][k] = delay["rates"][k]
    return result


@compiled
def note_state(delay: np.void, measured: np.void) -> None:
    """Note the last state received.

    Args:
        delay: Record of dtype `DELAY`, updated in place.
        measured: FTC_SIM_STATE payload.
    """
    copy_record(delay["measured"], measured)


@compiled
def note_commands(
    delay: np.void,
    step: int,
    held: np.ndarray,
    lag_s: float,
    step_us: int,
    thrust_lag_s: float = 0.0,
) -> None:
    """Note where servos are a period after a step: by a lag.

    Over steps that were not noted the commands of the last one noted were in force; before the
    first, its own: after a restart the aircraft holds them.

    Args:
        delay: Record of dtype `DELAY`, updated in place.
        step: The step.
        held: Commands in force after it: aileron, elevator, rudder [rad], thrust [N], shape (4,).
        lag_s: Lag of the surfaces [s].
        step_us: Control period [µs].
        thrust_lag_s: Lag of the aircraft's propulsion [s].
    """
    positions, commands = delay["positions"], delay["commands"]
    lagged, thrust_lagged = _closed(lag_s, step_us), _closed(thrust_lag_s, step_us)
    since = delay["step"] if delay["started"] != 0 else step - _HISTORY
    for s in range(max(since + 1, step - _HISTORY + 1), step + 1):
        for c in range(N_CHANNELS):
            if s == step or delay["started"] == 0:
                commands[c] = held[c]
            share = thrust_lagged if c == THROTTLE else lagged
            before = held[c] if delay["started"] == 0 else positions[(s - 1) % _HISTORY, c]
            positions[s % _HISTORY, c] = before + share * (commands[c] - before)
    delay["step"], delay["started"] = step, 1


@compiled
def _closed(lag_s: float, step_us: int) -> float:
    """Return which share of its way a servo with a lag [s] covers in a control period [µs]."""
    return 1.0 - math.exp(-step_us / 1e6 / lag_s) if lag_s > 0.0 else 1.0


@compiled
def thrust_believed(delay: np.void, step: int, back: int, held: np.ndarray) -> float:
    """Return the thrust that the commands ask for [N], by the model of `note_commands`.

    Args:
        delay: Record of dtype `DELAY`.
        step: The step.
        back: How many control periods before it.
        held: Commands in force, shape (4,): of a UAV of which nothing is noted yet.
    """
    if delay["started"] == 0:
        return float(held[THROTTLE])
    last = min(step - 1, int(delay["step"]))
    return float(delay["positions"][(last - back) % _HISTORY, THROTTLE])


@compiled
def periods_known(delay: np.void, known_s: float, step_us: int) -> int:
    """Return the delay of the links and the one besides, without that which was found.

    Args:
        delay: Record of dtype `DELAY`.
        known_s: Delay besides the delay of the links [s].
        step_us: Control period [µs].
    """
    if delay["started"] == 0 or (delay["periods"] == 0 and known_s == 0.0):
        return 0
    longest = min(_periods(MAX_DELAY_S, step_us), _HISTORY - 1)
    return max(min(int(delay["periods"]) + _periods(known_s, step_us), longest), 0)


@compiled
def predicted(
    delay: np.void, measured: np.void, known_s: float, step_us: int, aircraft: AircraftRecord
) -> np.void:
    """Return the state at which the commands of this step will act; the measured one if at once.

    What the nominal model does not explain of the specific force is taken to stay. The thrust has
    the delay of the links alone: what is known besides, surfaces and gyro have.

    Args:
        delay: Record of dtype `DELAY`; its field `predicted` is written.
        measured: FTC_SIM_STATE payload.
        known_s: Delay besides the delay of the links [s].
        step_us: Control period [µs].
        aircraft: Nominal aircraft.
    """
    ahead = min(periods_known(delay, known_s, step_us) + delay["found"], _HISTORY - 1)
    if ahead == 0:
        return measured
    step, dt = int(np.int64(measured["step"])), step_us / 1e6
    wind = vec3(measured["wind"])
    v, omega = sub(vec3(measured["velocity"]), wind), vec3(measured["rates"])
    state: State = (vec3(measured["position"]), v, vec3(measured["attitude"]), omega)
    links, positions = periods_known(delay, 0.0, step_us), delay["positions"]
    thrust = float(positions[(step - links - 1) % _HISTORY, THROTTLE])
    air = aerodynamics(v, omega, aircraft)
    row = positions[(step - ahead - 1) % _HISTORY]
    delta = row[AILERON], row[ELEVATOR], row[RUDDER]
    d_v = sub(vec3(measured["specific_force"]), specific_force(air, delta, thrust, aircraft))
    for k in range(ahead):
        row = positions[(step - ahead + k) % _HISTORY]
        delta = row[AILERON], row[ELEVATOR], row[RUDDER]
        thrust = float(positions[min(step - links + k, step - 1) % _HISTORY, THROTTLE])
        middle = state
        for share in (0.5, 1.0):
            derivative = state_derivative(
                middle, thrust, delta, d_v, (0.0, 0.0, 0.0), STILL_AIR, aircraft
            )
            middle = advance(state, share * dt, derivative)
        state = middle
    result: np.void = delay["predicted"]
    copy_record(result, measured)
    velocity = add(state[1], wind)
    air = aerodynamics(state[1], state[3], aircraft)
    force = add(specific_force(air, delta, thrust, aircraft), d_v)
    for i in range(3):
        result["velocity"][i] = velocity[i]
        result["attitude"][i] = state[2][i]
        result["rates"][i] = state[3][i]
        result["specific_force"][i] = force[i]
    return result


@compiled
def _periods(time_s: float, step_us: int) -> int:
    return math.floor(time_s * 1e6 / step_us + 0.5)
