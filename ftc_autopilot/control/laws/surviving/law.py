"""One step of the surviving law: diagnosis, healthy loops, and what replaces a lost actuator."""

import math

import numpy as np

from ftc_autopilot.control.diagnosis import diagnose, dithered, dithered_thrust, probe, probed
from ftc_autopilot.control.inversion import deflections_for, thrust_for_speed
from ftc_autopilot.control.laws.surviving.healthy import commanded_acceleration, commanded_rates
from ftc_autopilot.control.laws.surviving.lateral import (
    aileron_for_roll,
    driven_aileron,
    lateral_trim,
    rudder_for_roll,
    turn_rates,
    waiting_rudder,
)
from ftc_autopilot.control.laws.surviving.longitudinal import pitch_trim, thrust_for_pitch
from ftc_autopilot.control.laws.surviving.parameters import Surviving
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.step import ALL, Command, SignalsRecord, Step, Thresholds
from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import apart, compiled, inlined
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.airframe.rigid_body import angular_acceleration
from sitl_plant.airframe.stops import has_actuator, range_of, stop_beside
from sitl_plant.airframe.thrust import available_thrust
from sitl_plant.vec3 import clamp, mat3, mul, sub

_MIN_COSINE = 0.3  # of the roll angle, in the turn rate of a trim


@apart(aircraft=AIRCRAFT, gains=Surviving.record(), state=Surviving.STATE, signals=SIGNALS)
def surviving_law(
    now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void, signals: SignalsRecord
) -> Command:
    """Invert the nominal model, correct what the diagnosis found, fly on without what is lost.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Surviving`.
        state: Record of dtype `Surviving.STATE`, updated in place.
        signals: The diagnosis is written.
    """
    return reaching_stops(
        reconfigured(now, aircraft, gains, state, signals), now.thresholds, aircraft
    )


@inlined
def reconfigured(
    now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void, signals: SignalsRecord
) -> Command:
    """Return the law's commands whatever the trigger's thresholds; arguments as of the law."""
    motion, diagnosis, actuators = now.motion, state["diagnosis"], state["diagnosis"]["actuators"]
    diagnose(now, aircraft, gains["diagnosis"], diagnosis, signals)
    may = gains["reconfigure"] != 0
    no_aileron = may and actuators[AILERON]["lost"] != 0
    no_elevator = may and actuators[ELEVATOR]["lost"] != 0
    has_rudder = has_actuator(aircraft, RUDDER)
    no_rudder = not has_rudder or (may and actuators[RUDDER]["lost"] != 0)
    no_throttle = may and actuators[THROTTLE]["lost"] != 0

    rates = commanded_rates(now, gains, state)
    state["slows_turn"] = 0
    if no_aileron or no_rudder:  # yaw is left to the trim
        stuck = AILERON if no_aileron and has_rudder else RUDDER
        trim = lateral_trim(now, stuck, float(actuators[stuck]["stuck"]), aircraft, diagnosis)
        rates = rates[0], rates[1], trim.r / max(math.cos(motion.phi[0]), _MIN_COSINE)
    elif may:
        least, most = turn_rates(now, aircraft, gains, diagnosis)
        cosine = max(math.cos(motion.phi[0]), _MIN_COSINE)
        turning = clamp(rates[2], least / cosine, most / cosine)
        state["slows_turn"] = int(turning != rates[2])
        rates = rates[0], rates[1], turning
    commanded = commanded_acceleration(now, rates, gains, state)
    J = mat3(aircraft["J"])
    by_itself = angular_acceleration(motion.omega, motion.air.N, J, mat3(aircraft["J_inv"]))
    delta = deflections_for(mul(J, sub(commanded, by_itself)), motion.air.C, aircraft)
    aileron = _corrected(delta[0], actuators[AILERON])
    elevator = _corrected(delta[1], actuators[ELEVATOR])
    rudder = _corrected(delta[2], actuators[RUDDER])
    thrust = thrust_for_speed(now, aircraft, gains["c_v"]) - actuators[THROTTLE]["offset"]

    if no_aileron:
        if not no_rudder:
            rudder = rudder_for_roll(now, trim, gains, state, range_of(aircraft, RUDDER))
        needed = aileron_for_roll(now, commanded, aircraft, diagnosis)
        aileron = driven_aileron(now, needed, gains, state, aircraft)
    else:
        state["aileron_driven"], state["rudder_mean"] = 0.0, now.held[RUDDER]
        if no_rudder:
            aileron = aileron_for_roll(now, commanded, aircraft, diagnosis)
    if no_rudder and has_rudder:
        rudder = waiting_rudder(now, aircraft, gains, diagnosis)
    elif no_rudder:
        rudder = 0.0
    if no_elevator:
        if abs(now.errors.e[1]) > gains["pitch_error_limit_rad"] and not no_throttle:
            state["gave_up_speed"] = 1
        if state["gave_up_speed"] == 0:  # as if it were healthy, for the moment when it is
            elevator += probe(ELEVATOR, gains["diagnosis"], diagnosis)
        else:
            elevator = probed(
                ELEVATOR, float(actuators[ELEVATOR]["stuck"]), gains["diagnosis"], diagnosis
            )
            level = pitch_trim(now, aircraft, gains, diagnosis)
            thrust = thrust_for_pitch(now, level, aircraft, gains, state)
    else:
        state["gave_up_speed"], state["pitch_integral"] = 0, 0.0
    if no_throttle:
        thrust += probe(THROTTLE, gains["diagnosis"], diagnosis)
    return Command(
        (
            dithered(aileron, AILERON, range_of(aircraft, AILERON), gains["diagnosis"], diagnosis),
            dithered(
                elevator, ELEVATOR, range_of(aircraft, ELEVATOR), gains["diagnosis"], diagnosis
            ),
            dithered(rudder, RUDDER, range_of(aircraft, RUDDER), gains["diagnosis"], diagnosis),
        ),
        dithered_thrust(
            thrust, available_thrust(motion.V, aircraft), gains["diagnosis"], diagnosis
        ),
        ALL,
    )


@compiled
def reaching_stops(command: Command, thresholds: Thresholds, aircraft: AircraftRecord) -> Command:
    """Replace deflections that are nearer to the stop than the trigger's threshold by the stop.

    Else a surface that is held there would never be sent the rest: it is less than the threshold.

    Args:
        command: Before saturation.
        thresholds: Of the trigger.
        aircraft: Nominal aircraft, with its stops.
    """
    aileron, elevator, rudder = command.delta
    delta = (
        _reaching(aileron, AILERON, thresholds.b, aircraft),
        _reaching(elevator, ELEVATOR, thresholds.b, aircraft),
        _reaching(rudder, RUDDER, thresholds.b, aircraft),
    )
    return Command(delta, command.thrust, command.channels)


@compiled
def _reaching(delta: float, j: int, b: tuple[float, float], aircraft: AircraftRecord) -> float:
    """Return the deflection of surface j, or its stop if that is nearer than the threshold b."""
    lowest, highest = range_of(aircraft, j)
    stop = stop_beside(delta, lowest, highest)
    return at_stop(delta, stop, b[0] * stop + b[1])


@compiled
def at_stop(delta: float, stop: float, near: float) -> float:
    """Return a deflection, or the stop if it is nearer to it than `near` [rad]."""
    return math.copysign(stop, delta) if abs(delta) > stop - near else delta


@compiled
def _corrected(delta: float, actuator: np.void) -> float:
    """Return the command [rad] that makes an actuator with ρ and f do δ: (δ - f)/ρ."""
    corrected: float = (delta - actuator["offset"]) / actuator["effectiveness"]
    return corrected
