"""One update of a member of a formation: its slot, its pace, its distance from the others."""

import math

import numpy as np

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.common.tuples import replaced
from ftc_autopilot.guidance.coordination import FORMATION, Coordination, Progress, coordinate
from ftc_autopilot.guidance.formation import LAYOUT
from ftc_autopilot.guidance.laws import intention_of, pace_of
from ftc_autopilot.guidance.laws.base import Intention, Situation
from ftc_autopilot.guidance.places import choose_relayed, relay
from ftc_autopilot.guidance.separation import keep_apart, nearest
from mavlink_defs.framing.codec import NEIGHBOUR, SIM_STATE
from mavlink_defs.runtime.jit import apart, compiled
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import Vec3, hypot, mul, sub, vec3

_EVADING_M_S = 0.5
"""Change of the velocity asked for that counts as evading [m/s]."""


@compiled
def fly_in_formation(
    now: Situation,
    step: int,
    dt: float,
    clock: float,
    in_slot: bool,
    path: np.void,
    edges: np.ndarray,
    signals: np.void,
    layout: np.void,
    parameters: np.void,
    law: np.void,
    state: np.void,
) -> Coordination:
    """Return where guidance is to fly, and with which corrections.

    Args:
        now: The situation.
        step: Present step.
        dt: Control period [s].
        clock: Time on the mission's clock [s].
        in_slot: Whether it flies in its slot, not on the path itself.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH`.
        edges: What is known of each neighbour, dtype `ftc_autopilot.control.edges.EDGE`, shape
            (degree,).
        signals: Of the step before, dtype `ftc_autopilot.control.signals.SIGNALS`.
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        parameters: Record of dtype `ftc_autopilot.control.controller.PARAMETERS`.
        law: State of the guidance law, dtype `ftc_autopilot.guidance.laws.GUIDANCE_STATE`.
        state: Record of dtype `ftc_autopilot.guidance.coordination.FORMATION`, updated in place.
    """
    gains = parameters["formation"]
    pace = pace_of(now, path, state["slot"]["place"][0], parameters["guidance"], law)
    progress = Progress(
        step=step,
        dt=dt,
        since=now.dt,
        clock=clock,
        in_slot=in_slot,
        path_id=path["id"],
        s=pace.s,
        s_dot=pace.s_dot,
        speed=pace.speed,
    )
    plain = coordinate(progress, edges, signals, layout, gains, state)
    now = replaced(now, "coordination", plain)
    intention = intention_of(now, path, parameters["guidance"], law)
    state["error"][1], state["error"][2] = intention.off_right, intention.off_up
    asked = _in_ned(intention)
    least, rate = gains["separation_m"], gains["separation_rate"]
    apart = keep_apart(
        asked,
        now.position,
        now.velocity,
        sub(now.velocity, now.air_velocity),
        parameters["guidance"]["common"]["airspeed_min_m_s"],
        state["places"],
        layout,
        state["table"],
        step,
        dt,
        least,
        rate,
    )
    change = sub(apart, asked)
    m, state["distance"] = nearest(now.position, state["places"], layout, step, dt)
    state["nearest"] = layout["ids"][m] if m >= 0 else 0
    state["relay_error"] = choose_relayed(
        step, dt, layout, state["places"], state["last_relayed"], state["relayed"]
    )
    state["evading"] = 1 if hypot(hypot(change[0], change[1]), change[2]) > _EVADING_M_S else 0
    sin_c, cos_c = math.sin(intention.course), math.cos(intention.course)
    return Coordination(
        plain.slot,
        plain.slot_rate,
        plain.speed + cos_c * change[0] + sin_c * change[1],
        cos_c * change[1] - sin_c * change[0],
        -change[2],
    )


@apart(message=NEIGHBOUR, measured=SIM_STATE, layout=LAYOUT, state=FORMATION)
def tell_place(
    message: np.void,
    path_id: int,
    measured: np.void,
    motion: MeasuredMotion,
    dt: float,
    layout: np.void,
    state: np.void,
) -> None:
    """Write the own place, and what is known of all members, into a message to the neighbours.

    Args:
        message: Payload of dtype `mavlink_defs.framing.codec.NEIGHBOUR` with the present step.
        path_id: Of the path that is flown.
        measured: FTC_SIM_STATE payload.
        motion: Own motion.
        dt: Control period [s].
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        state: Record of dtype `ftc_autopilot.guidance.coordination.FORMATION`.
    """
    age = np.int64(message["step"]) - state["updated"]
    message["path_id"] = path_id
    message["path_position"] = state["xi"] + age * dt * state["xi_rate"]
    message["path_rate"] = state["xi_rate"]
    velocity = mul(R1(motion.phi), vec3(measured["velocity"]))
    for k in range(3):
        message["position"][k] = measured["position"][k]
        message["ground_velocity"][k] = velocity[k]
    for m in range(len(message["report"])):
        message["report"][m] = state["table"][m]
    relay(state["relayed"], layout, state["places"], message)


@compiled
def _in_ned(intention: Intention) -> Vec3:
    sin_c, cos_c = math.sin(intention.course), math.cos(intention.course)
    return (
        cos_c * intention.along - sin_c * intention.right,
        sin_c * intention.along + cos_c * intention.right,
        -intention.up,
    )
