"""One step of one controller: from a measured state to the messages that it causes.

Processes and the flight in one process call the same functions, on the same payloads.
"""

import math

import numpy as np

from ftc_autopilot.common.motion import MeasuredMotion, fill_neighbour_state, motion_of
from ftc_autopilot.common.phases import LOST
from ftc_autopilot.common.tuples import four, replaced, rows_of
from ftc_autopilot.control import state_predictor
from ftc_autopilot.control.controller import Inputs, Records, control_step, count_events
from ftc_autopilot.control.controllers import NOT_STARTED, UAV, ReferenceSource
from ftc_autopilot.control.edges import EDGE
from ftc_autopilot.control.ground import ground_law
from ftc_autopilot.control.laws import heading_loop
from ftc_autopilot.control.neighbour_messages import (
    extrapolate,
    is_message_due,
    refer_to_reference,
)
from ftc_autopilot.control.reference import profile_value
from ftc_autopilot.control.signals import no_signals
from ftc_autopilot.control.step import Seen
from ftc_autopilot.guidance.coordination import no_coordination
from ftc_autopilot.guidance.formation_flight import fly_in_formation, tell_place
from ftc_autopilot.guidance.laws import guide
from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.path import PATH, locate, point_at
from ftc_autopilot.guidance.places import note_relayed, take_in
from ftc_autopilot.guidance.runway_phases import (
    advance,
    bank_near_ground,
    find_out,
    nose_for,
    note_path,
    on_final,
    uses_runway,
)
from ftc_autopilot.guidance.runway_sequence import lands_alone, note_others
from ftc_autopilot.guidance.runway_state import FINAL, FLARE, is_glide, on_ground
from ftc_autopilot.plugins.models import PLUGIN
from mavlink_defs.constants import AILERON, BRAKE, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.framing.codec import RELAYED_AT, REPORT_AT, SIM_STATE
from mavlink_defs.runtime.jit import apart, compiled, inlined
from mavlink_defs.runtime.memory import copy_record
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import mul, norm, vec3

_NO_SIGNALS = no_signals(1)
_MAX_UPDATE_S = 0.1
"""Longest time that counts as passed between two updates of guidance [s]."""


@compiled
def publish_own_state(uav: np.void, measured: np.void) -> None:
    """Set the message that a UAV sends to its neighbours before the first step.

    Args:
        uav: Record of dtype `ftc_autopilot.control.controllers.UAV`, updated in place.
        measured: FTC_SIM_STATE payload.
    """
    fill_neighbour_state(motion_of(measured, uav["aircraft"]), measured["step"], uav["own_state"])
    copy_record(uav["last_broadcast"], uav["own_state"])


@apart(uav=UAV, edges=np.zeros(1, EDGE), path=PATH, measured=SIM_STATE)
def controller_step(
    uav: np.void, edges: np.ndarray, path: np.void, measured: np.void, step_us: int
) -> int:
    """Make one step from a measured state: own state, guidance, control, actuator message.

    Of states lost before it the law makes the steps, too, but sends nothing. If there were many,
    these and the step after them count as after a gap; so does the first of a new process.

    Args:
        uav: Record of dtype `UAV`; own state, controller state, actuator message and signals are
            updated.
        edges: Of its neighbours, dtype `EDGE`, shape (degree,); what is known of each is updated.
        path: Record of dtype `PATH`.
        measured: FTC_SIM_STATE payload.
        step_us: Control period [µs].

    Returns:
        Bit mask of the channels that had an event; the actuator message is due unless it is 0.
    """
    delay, aircraft, state = uav["delay"], uav["aircraft"], uav["controller"]
    common = uav["parameters"]["common"]
    mask = lost = unresolved = 0
    gap = False
    if state["started"] != 0:
        lost = state_predictor.lost_states(delay, measured, step_us)
        unresolved = state_predictor.unresolved(delay, measured, step_us)
        gap = delay["started"] == 0 or state_predictor.is_after_gap(delay, measured, step_us)
    if gap or delay["started"] == 0:
        delay["begun"] = measured["step"]
    for k in range(lost + 1):
        may_send = k == lost
        if may_send and unresolved > 0:
            delay["begun"] = measured["step"]
        now = measured if may_send else state_predictor.interpolate(delay, measured)
        now = state_predictor.smoothed(delay, now, common["gyro_filter_s"], step_us)
        step, held = int(np.int64(now["step"])), state["held"]
        motion = motion_of(
            state_predictor.predicted(delay, now, common["delay_s"], step_us, aircraft),
            aircraft,
            state_predictor.thrust_believed(delay, step, 0, held),
        )
        fill_neighbour_state(motion, now["step"], uav["own_state"])
        if uav["guidance"]["active"] != 0:
            seen = _seen(uav, now, motion, step_us, gap, unresolved, may_send)
            mask = _control(uav, edges, path, now, motion, seen, step_us, may_send)
            delay["found"] = uav["signals"]["dead_steps"]
        elif may_send:
            mask = _cut_thrust(uav, motion)
        state_predictor.note_commands(
            delay, step, held, common["predicted_lag_s"], step_us, aircraft["thrust_lag"]
        )
    state_predictor.note_state(delay, measured)
    if mask != 0:
        state_predictor.note_event(delay, int(measured["step"]))
        count_events(mask, int(measured["step"]), state)
        uav["actuators"]["time_usec"] = measured["time_usec"]
    return mask


@inlined
def _seen(
    uav: np.void,
    measured: np.void,
    motion: MeasuredMotion,
    step_us: int,
    gap: bool,
    unresolved: int,
    received: bool,
) -> Seen:
    """Return what a measured state shows; the motion is the one predicted from it.

    Over states that were not received, but interpolated, a command stayed in force.
    """
    known_s = uav["parameters"]["common"]["delay_s"]
    delay = uav["delay"]
    ahead = state_predictor.periods_known(delay, known_s, step_us)
    links = state_predictor.periods_known(delay, 0.0, step_us)
    named = measured if received else delay["measured"]
    age = state_predictor.age_in_force(delay, int(measured["step"]), named, links, step_us)
    if age == state_predictor.UNKNOWN:  # what is on its way is to arrive first
        gap, delay["begun"] = True, measured["step"]
    if not gap:
        ahead, links = ahead + age - links, age
    if ahead + delay["found"] > 0:
        step, held = int(np.int64(measured["step"])), uav["controller"]["held"]
        thrust = state_predictor.thrust_believed(delay, step, links, held)
        motion = motion_of(measured, uav["aircraft"], thrust)
    lost = unresolved if received else -min(unresolved, 1)
    return Seen(motion, ahead, links, int(gap), lost)


@inlined
def broadcast_if_triggered(uav: np.void, step: int, step_us: int) -> bool:
    """Return whether a UAV sends `own_state` to its neighbours after a step; it is noted then.

    After step 0 it sends nothing: the neighbours know that state from before the start, and one
    that is slower than this UAV would take the message for that one.

    Args:
        uav: Record of dtype `UAV`; last broadcast, counter and signals are updated.
        step: The step, which `controller_step` has made.
        step_us: Control period [µs].
    """
    parameters, own = uav["parameters"], uav["own_state"]
    last = uav["last_broadcast"]
    formation = uav["formation"]
    if step == 0:
        uav["signals"]["neighbour_message"] = 0
        return False
    if parameters["formation_triggered"] != 0:
        dt, extrapolated = step_us / 1e6, uav["extrapolated"]
        extrapolate(last, step, dt, extrapolated)
        trigger = parameters["formation_trigger"]
        relays = own["relayed"][0] != 0 and formation["relay_error"] > trigger["position_m"]
        if not relays and not is_message_due(own, last, extrapolated, dt, trigger):
            uav["signals"]["neighbour_message"] = 0
            return False
    copy_record(last, own)
    if own["relayed"][0] != 0:
        note_relayed(own, uav["layout"], formation)
    uav["signals"]["neighbour_message"] = 1
    uav["controller"]["neighbour_messages"] += 1
    return True


@inlined
def hear(uav: np.void, edges: np.ndarray, d: int, message: np.void) -> None:
    """Let a UAV use the message of its neighbour d from now on.

    Args:
        uav: Record of dtype `UAV`; what it knows of the formation is updated.
        edges: Of its neighbours, dtype `EDGE`; the message in use is updated.
        d: Index of the neighbour.
        message: Payload of dtype NEIGHBOUR, newer than the one in use.
    """
    copy_record(edges[d]["message"], message)
    layout = uav["layout"]
    if layout["count"] > 0 and layout["neighbours"][d] >= 0:
        places = uav["formation"]["places"]
        take_in(message, layout["neighbours"][d], layout, places)


@inlined
def _note_known(uav: np.void, edges: np.ndarray, step: int, dt: float) -> None:
    """Bring what a UAV knows of its neighbours up to a step."""
    triggered = uav["parameters"]["formation_triggered"] != 0
    for d in range(len(edges)):
        message, known = edges[d]["message"], edges[d]["known"]
        if triggered:  # a step uses neighbour states of the step before
            extrapolate(message, max(step - 1, int(np.int64(message["step"]))), dt, known)
        else:
            copy_record(known, message)


@inlined
def _control(
    uav: np.void,
    edges: np.ndarray,
    path: np.void,
    measured: np.void,
    motion: MeasuredMotion,
    seen: Seen,
    step_us: int,
    may_send: bool,
) -> int:
    """Follow profile, path or command; the UAV is armed."""
    guidance = uav["guidance"]
    clock = 0.0  # schedules belong to the profile, so they run on the mission's clock
    if guidance["start_step"] != NOT_STARTED:
        clock = (measured["step"] - guidance["start_step"]) * step_us / 1e6
    dt = step_us / 1e6
    on_path = guidance["follows"] == ReferenceSource.PATH
    placed = guidance["unplaced"] == 0  # else the command stays, and neighbours hear of no place
    _note_known(uav, edges, int(np.int64(measured["step"])), dt)
    runway = guidance["runway"]
    if runway["known"] == 0:
        figures = uav["parameters"]["runway"]
        find_out(motion.V, norm(vec3(measured["velocity"])), figures, runway)
    if guidance["follows"] == ReferenceSource.PROFILE:
        profile_value(uav["profile"], clock, guidance["command"])
    elif on_path and placed:
        _guide(uav, edges, path, measured, motion, clock, dt)
    bank_max = runway["bank_max"] if runway["bank_max"] > 0.0 else math.inf
    inputs = Inputs(clock, dt, motion, seen, guidance["command"], edges, bank_max)
    records = Records(
        uav["aircraft"],
        uav["parameters"],
        uav["controller"],
        uav["actuators"]["controls"],
        uav["signals"],
        runway,
    )
    mask = control_step(inputs, records, may_send)
    if on_path and placed and uav["layout"]["count"] > 0:
        own, layout = uav["own_state"], uav["layout"]
        tell_place(own, path["id"], measured, motion, dt, layout, uav["formation"])
    _record_guidance(uav, on_path)
    if on_path or uav["parameters"]["formation_triggered"] != 0:
        # on a path each UAV has a reference of its own
        refer_to_reference(uav["own_state"], uav["signals"])
    return mask


@apart(uav=UAV, edges=np.zeros(1, EDGE), path=PATH, measured=SIM_STATE)
def _guide(
    uav: np.void,
    edges: np.ndarray,
    path: np.void,
    measured: np.void,
    motion: MeasuredMotion,
    clock: float,
    dt: float,
) -> None:
    """Update the command by the guidance law, if its period is over."""
    guidance, parameters = uav["guidance"], uav["parameters"]
    step, since = int(np.int64(measured["step"])), 0.0
    if guidance["guided_step"] != NOT_STARTED:
        period = parameters["guidance"]["common"]["period_s"]
        since = (step - guidance["guided_step"]) * dt
        if since < period - 0.5 * dt:
            return
    to_ned, position = R1(motion.phi), vec3(measured["position"])
    s, off = locate(path, position[0], position[1], guidance["path_position"])
    now = Situation(
        dt=min(since, _MAX_UPDATE_S),
        s=s,
        bandwidth=parameters["common"]["reference_bandwidth_rad_s"],
        command=four(guidance["command"]),
        position=position,
        velocity=mul(to_ned, vec3(measured["velocity"])),
        air_velocity=mul(to_ned, motion.v),
        reference=rows_of(uav["controller"]["reference"]),
        coordination=no_coordination(),
        here=point_at(path, s),
        motion=motion,
        off=off,
        level=math.nan,
        over_ground=0,
        nose=math.nan,
        glide=math.nan,
    )
    if uav["layout"]["count"] > 0:
        coordination = fly_in_formation(
            now,
            step,
            dt,
            clock,
            guidance["in_slot"] != 0,
            path,
            edges,
            uav["signals"],
            uav["layout"],
            parameters,
            guidance["law"],
            uav["formation"],
        )
        now = replaced(now, "coordination", coordination)
    if uses_runway(path, guidance["runway"]):
        _fly_near_ground(uav, path, now, step, dt)
    else:
        command = guide(now, path, uav["aircraft"], parameters["guidance"], guidance["law"])
        for k in range(4):
            guidance["command"][k] = command[k]
    guidance["path_position"] = s
    guidance["guided_step"] = step


@apart(uav=UAV, path=PATH)
def _fly_near_ground(uav: np.void, path: np.void, now: Situation, step: int, dt: float) -> None:
    """Update the command on a path that has a runway; a phase begins with a message."""
    guidance, parameters, aircraft = uav["guidance"], uav["parameters"], uav["aircraft"]
    runway, figures, command = guidance["runway"], parameters["runway"], guidance["command"]
    limits, before = parameters["guidance"]["common"], runway["phase"]
    if guidance["guided_step"] == NOT_STARTED:
        note_path(path, runway)
    if uav["layout"]["count"] > 0:
        if lands_alone(path, now.s):
            now = replaced(now, "coordination", no_coordination())
        note_others(now, step, dt, path, uav)
    if before in (FINAL, FLARE) and not is_glide(path):
        now = on_final(now, path, figures, runway)
    now = replaced(now, "level", advance(now, path, aircraft, limits, figures, runway))
    if on_ground(runway["phase"]):
        command[0], command[1] = now.motion.V, 0.0
        command[2], command[3] = runway["pitch"], runway["heading"]
    else:
        approaches = runway["phase"] in (FINAL, FLARE)
        now = replaced(now, "over_ground", int(approaches))
        signals, lost = uav["signals"], uav["signals"]["phase"]
        steers = lost[AILERON] != LOST and lost[RUDDER] != LOST
        if steers and not heading_loop(parameters).by_bank:
            now = replaced(now, "nose", nose_for(now, path, figures, runway))
        if is_glide(path) and lost[THROTTLE] == LOST:
            now = replaced(now, "glide", float(signals["offset"][THROTTLE]))
        flown = guide(now, path, aircraft, parameters["guidance"], guidance["law"])
        for k in range(4):
            command[k] = flown[k]
        command[0] += runway["faster"] if approaches else 0.0
        command[1] = bank_near_ground(flown[1], now, path, limits, figures, runway)
    if runway["phase"] != before and (on_ground(before) or on_ground(runway["phase"])):
        uav["controller"]["started"] = 0
    uav["actuators"]["controls"][BRAKE] = runway["brake"] if on_ground(runway["phase"]) else 0.0


PATH_PARTS = (_guide, tell_place)
"""What a UAV flies a path by, and no profile."""
RUNWAY_PARTS = (_fly_near_ground, ground_law)
"""What an aircraft with gear takes off and lands by."""


@inlined
def has_failed(uav: np.void) -> bool:
    """Return whether a plug-in of a UAV has failed, and so is not called any more."""
    state, guidance = uav["controller"], uav["guidance"]["law"]
    return bool(
        state["law_failure"] != 0
        or state["trigger"][PLUGIN]["failure"] != 0
        or guidance[PLUGIN]["failure"] != 0
    )


@inlined
def _record_guidance(uav: np.void, on_path: bool) -> None:
    """Write where on the path a UAV is, and its slot; NaN off a path."""
    signals, formation = uav["signals"], uav["formation"]
    signals["path_position"] = uav["guidance"]["path_position"] if on_path else math.nan
    for k in range(3):
        signals["slot"][k] = formation["slot"]["place"][k] if on_path else math.nan
    size, relayed = 0, uav["own_state"]["relayed"]
    if on_path:
        size = uav["layout"]["count"]
        while size > 0 and formation["table"][size - 1] == 0:
            size -= 1
        for r in range(len(relayed)):
            if relayed[r] != 0:
                size = RELAYED_AT - REPORT_AT + r + 1
    signals["report_size"] = size


@compiled
def _cut_thrust(uav: np.void, motion: MeasuredMotion) -> int:
    """Set the thrust to zero, an event of the throttle; the surfaces stay. The UAV is disarmed.

    Only measured and held signals are recorded; no law is evaluated.
    """
    held, signals = uav["controller"]["held"], uav["signals"]
    mask = 0
    if held[THROTTLE] != 0.0:
        uav["actuators"]["controls"][THROTTLE] = 0.0
        held[THROTTLE] = 0.0
        mask = 1 << THROTTLE
    copy_record(signals, _NO_SIGNALS[0])
    signals["V"], signals["V_dot"], signals["events"] = motion.V, motion.V_dot, mask
    for k in range(3):
        signals["attitude"][k] = motion.phi[k]
    for c in range(N_CHANNELS):
        signals["held"][c] = held[c]
    return mask
