"""Roll and sideslip with one of aileron and rudder lost; heading is given up."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.control.diagnosis import is_in_care, may_be_weak, probe, probed
from ftc_autopilot.control.laws.surviving.gains import gain_at
from ftc_autopilot.control.step import Step
from mavlink_defs.constants import AILERON, RUDDER
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aerodynamics import lateral
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.rigid_body import angular_acceleration
from sitl_plant.airframe.stops import range_of
from sitl_plant.vec3 import Vec3, clamp, mat3, mul

_AT_THE_STOP = 0.92  # of the stop
_MAX_DRIVE = math.radians(25.0)


class LateralTrim(NamedTuple):
    """A steady turn with one surface given."""

    beta: float  # sideslip [rad]
    delta: float  # the other surface [rad]
    r: float  # yaw rate, body axes [rad/s]


@compiled
def turn_rates(
    now: Step, aircraft: AircraftRecord, gains: np.void, diagnosis: np.void
) -> tuple[float, float]:
    """Return between which yaw rates, body axes, the aileron can hold the roll angle [rad/s].

    A turn that bank does not make builds up sideslip, whose rolling moment the aileron balances.
    With its way to either stop, by what is left of it and less the room that the roll needs, it
    balances β*, in a steady turn of r*: no yaw rate may take the sideslip nearer to that than at
    the rate K1 of the heading.

        r* + K1 (β - β*)

    One that has been lost for longer than it has been back may stick again where it did: until
    then no sideslip is built up on the side away from what balances it there.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Surviving`.
        diagnosis: Record of dtype `DIAGNOSIS`.
    """
    aileron, stops = diagnosis["actuators"][AILERON], range_of(aircraft, AILERON)
    rho, f, k = aileron["effectiveness"], aileron["offset"], gains["K1"][2]
    room = gains["roll_room_rad"]
    least, most = f + rho * stops[0] + room, f + rho * stops[1] - room
    low = lateral_trim(now, AILERON, least, aircraft, diagnosis)
    high = lateral_trim(now, AILERON, most, aircraft, diagnosis)
    if aileron["owed_s"] > 0.0 and low.beta * high.beta < 0.0:
        share = low.beta / (low.beta - high.beta)  # of the way, where it balances no sideslip
        straight = LateralTrim(0.0, 0.0, low.r + share * (high.r - low.r))
        if aileron["sticks"] < least + share * (most - least):
            high = straight
        else:
            low = straight
    beta = sideslip(now.motion)
    one, other = low.r + k * (beta - low.beta), high.r + k * (beta - high.beta)
    return min(one, other), max(one, other)


@inlined
def sideslip(motion: MeasuredMotion) -> float:
    """Return the sideslip [rad]."""
    return math.asin(clamp(motion.v[1] / motion.V, -1.0, 1.0))


@compiled
def lateral_trim(
    now: Step, lost: int, stuck: float, aircraft: AircraftRecord, diagnosis: np.void
) -> LateralTrim:
    """Return the trim at the reference's roll angle with the aileron or the rudder stuck.

    It solves for β, the other surface δ and r from the rolling and the yawing moment and the side
    force without rotation of the velocity:

        l_0 + l_β β + l_r r + l_x f + l_δ (δ + f_δ) = 0,   and n in the same way
        r = g sin φ_r cos θ/v_x + (Y_0 + Y_β β + Y_r r + Y_x f + Y_δ (δ + f_δ))/(m v_x)

    Args:
        now: The present step.
        lost: AILERON or RUDDER.
        stuck: Where it stands, f [rad].
        aircraft: Nominal aircraft.
        diagnosis: Record of dtype `DIAGNOSIS`; f_δ is `offset` of the other one.
    """
    motion, actuators = now.motion, diagnosis["actuators"]
    air = lateral(motion.V, aircraft)
    l, n = air.rolling, air.yawing  # noqa: E741 - the field's symbol
    momentum = aircraft["m"] * motion.v[0]
    if lost == AILERON:
        l_lost, n_lost, l_delta, n_delta = l.aileron, n.aileron, l.rudder, n.rudder
        Y_lost, Y_delta = air.side.aileron, air.side.rudder
        offset = actuators[RUDDER]["offset"]
    else:
        l_lost, n_lost, l_delta, n_delta = l.rudder, n.rudder, l.aileron, n.aileron
        Y_lost, Y_delta = air.side.rudder, air.side.aileron
        offset = actuators[AILERON]["offset"]
    turn = aircraft["g"] * math.sin(now.reference.phi[0]) * math.cos(motion.phi[1]) / motion.v[0]
    turn += (air.side.bias + Y_lost * stuck + Y_delta * offset) / momentum
    by_r = 1.0 - air.side.r / momentum  # r = turn + side β + side_delta δ
    turn, side, side_delta = (
        turn / by_r,
        air.side.beta / momentum / by_r,
        Y_delta / momentum / by_r,
    )
    l_beta, n_beta = l.beta + l.r * side, n.beta + n.r * side
    l_0 = l.bias + motion.by_thrust[0] / air.scale
    n_0 = n.bias + motion.by_thrust[2] / air.scale
    rolling = -(l_0 + l_lost * stuck + l_delta * offset + l.r * turn)
    yawing = -(n_0 + n_lost * stuck + n_delta * offset + n.r * turn)
    l_delta, n_delta = l_delta + l.r * side_delta, n_delta + n.r * side_delta
    determinant = l_beta * n_delta - l_delta * n_beta
    beta = (rolling * n_delta - yawing * l_delta) / determinant
    delta = (l_beta * yawing - n_beta * rolling) / determinant
    return LateralTrim(beta, delta, turn + side * beta + side_delta * delta)


@compiled
def rudder_for_roll(
    now: Step, trim: LateralTrim, gains: np.void, state: np.void, stops: tuple[float, float]
) -> float:
    """Return the rudder [rad] with the aileron lost: δ* - K [β - β*, p, r - r*, φ - φ_r].

    Its mean shows whether the rudder alone suffices: see `driven_aileron`.
    """
    motion = now.motion
    x = (
        sideslip(motion) - trim.beta,
        motion.omega[0],
        motion.omega[2] - trim.r,
        wrap(motion.phi[0] - now.reference.phi[0]),
    )
    rudder: float = trim.delta
    for i in range(len(x)):
        rudder -= gain_at(gains["airspeeds"], gains["rudder_gains"], motion.V, i) * x[i]
    rudder /= state["diagnosis"]["actuators"][RUDDER]["effectiveness"]
    stopped = clamp(rudder, stops[0], stops[1])
    state["rudder_mean"] += now.dt / gains["stop_memory_s"] * (stopped - state["rudder_mean"])
    return rudder


@compiled
def driven_aileron(
    now: Step, needed: float, gains: np.void, state: np.void, aircraft: AircraftRecord
) -> float:
    """Return what the lost aileron is sent [rad]: its position, a probe, and a drive.

    Until it has shown whether it is only weak, it is sent what then makes the deflection that the
    roll needs: the rudder alone rolls the wrong way at first. One that jumps is free, and is sent
    what the roll needs. When the rudder has stood at its stop for long, the aileron is driven
    toward the helping side: that costs nothing if it is stuck, and decides if it is only very weak.
    One that comes and goes is sent what the roll needs: in the trim of the rudder that is where it
    sticks, so that it does the same then whether it sticks or not.
    """
    own, stops = range_of(aircraft, AILERON), range_of(aircraft, RUDDER)
    if is_in_care(AILERON, state["diagnosis"]):
        state["aileron_driven"] = 0.0
        return needed + float(probe(AILERON, gains["diagnosis"], state["diagnosis"]))
    lost, diagnosis = state["diagnosis"]["actuators"][AILERON], gains["diagnosis"]
    base, half_s = float(lost["stuck"]), diagnosis["dither_half_s"][AILERON]
    on_trial = lost["decided_s"] < diagnosis["trial_s"]
    jumped = on_trial and not may_be_weak(AILERON, diagnosis, state["diagnosis"])
    mean = state["rudder_mean"]
    if jumped:
        state["aileron_driven"] = 0.0
    elif mean < _AT_THE_STOP * stops[0] or mean > _AT_THE_STOP * stops[1]:
        more = math.copysign(now.dt * gains["driving_rad_s"], state["rudder_mean"])
        driven = state["aileron_driven"] + more
        state["aileron_driven"] = clamp(driven, -_MAX_DRIVE, _MAX_DRIVE)
    if on_trial:
        size = diagnosis["trial_rad"][AILERON]
        share = 1.0 if jumped else diagnosis["weak_effectiveness"]
        base = clamp(needed / share, own[0] + size, own[1] - size)
        is_sent_anyway = lost["decided_s"] % half_s < now.dt
        if is_sent_anyway or abs(base - state["aileron_tried"]) > size:
            state["aileron_tried"] = base
        base = float(state["aileron_tried"])
    aileron: float = probed(AILERON, base, diagnosis, state["diagnosis"])
    return aileron + float(state["aileron_driven"])


@compiled
def aileron_for_roll(
    now: Step, commanded: Vec3, aircraft: AircraftRecord, diagnosis: np.void
) -> float:
    """Return the aileron [rad] with the rudder lost, which alone makes the roll acceleration.

    Its share is what the rudder, whose deflection is measured, leaves; sideslip is left to the
    aircraft's own weathercock stability.
    """
    air, J_inv = now.motion.air, mat3(aircraft["J_inv"])
    by_itself = angular_acceleration(now.motion.omega, air.N, mat3(aircraft["J"]), J_inv)[0]
    by_aileron = mul(J_inv, (air.C[0][0], 0.0, air.C[2][0]))[0]
    by_rudder = mul(J_inv, (air.C[0][2], 0.0, air.C[2][2]))[0]
    aileron, rudder = diagnosis["actuators"][AILERON], diagnosis["actuators"][RUDDER]
    needed = (commanded[0] - by_itself - by_rudder * rudder["measured"]) / by_aileron
    corrected: float = (needed - aileron["offset"]) / aileron["effectiveness"]
    return corrected


@compiled
def waiting_rudder(
    now: Step, aircraft: AircraftRecord, gains: np.void, diagnosis: np.void
) -> float:
    """Return what the lost rudder is sent [rad]: its position and a probe.

    While the heading is so far off that its loop asks for the largest yaw rate, it is sent to the
    stop that would turn it back: that costs nothing while it is stuck, and ends the turn at once
    when it moves again.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Surviving`.
        diagnosis: Record of dtype `DIAGNOSIS`.
    """
    base = float(diagnosis["actuators"][RUDDER]["stuck"])
    error = now.errors.e[2]
    if gains["K1"][2] * abs(error) > gains["rate_limit_rad_s"][2]:
        room = gains["diagnosis"]["trial_rad"][RUDDER]  # for its movements
        lowest, highest = range_of(aircraft, RUDDER)
        yaw_by_rudder = now.motion.air.C[2][2]
        base = lowest + room if error * yaw_by_rudder > 0.0 else highest - room
    return float(probed(RUDDER, base, gains["diagnosis"], diagnosis))
