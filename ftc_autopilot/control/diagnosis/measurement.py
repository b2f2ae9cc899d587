"""Measurement of what each actuator does, beside what it is commanded.

The rates' derivative is never formed. Euler's equation (4), J ω̇ = C δ + N - ω × Jω, is passed
through 1/(τs + 1), which turns J ω̇ into J (ω - ω_f)/τ with ω_f the filtered rates:

    y = C0⁻¹ [J0 (ω - ω_f)/τ + h_f],   h = ω × J0 ω - N0

C0 is square, so every surface has a measurement of its own. The thrust's follows from V̇:

    y_T = m (V̇ - vᵀ(R1ᵀg + F0/m)/V) V/v_x

Commands, as old as those that the measurement shows, pass through a model of the servos and the
same filter, so that y = u while all is well; u of the throttle is no more than the airspeed
permits. All filters start at rest together with the law, and the servos at their first commands.
"""

import math

import numpy as np

from ftc_autopilot.control.diagnosis.state import HISTORY
from ftc_autopilot.control.inversion import deflections_for, thrust_for
from ftc_autopilot.control.step import Step
from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.thrust import made_thrust
from sitl_plant.vec3 import Vec3, add, clamp, cross, mat3, mul, scale, sub, vec3


@compiled
def servo_step(position: float, command: float, j: int, gains: np.void, dt: float) -> float:
    """Return the position of servo j after a period, by the model of the diagnosis.

    Args:
        position: Before [rad or N].
        command: Held over the period [rad or N].
        j: The actuator, number as FTC_ACTUATOR.
        gains: Parameters, record made of `DiagnosisParameters`; lag 0: no lag.
        dt: The period [s].
    """
    change = command - position
    lag_s, limit = gains["servo_lag_s"], gains["servo_rate_limit_rad_s"]
    if j == THROTTLE:
        lag_s, limit = gains["throttle"]["lag_s"], math.inf
    if lag_s > 0.0:
        change *= 1.0 - math.exp(-dt / lag_s)
    return position + clamp(change, -limit * dt, limit * dt)


@inlined
def measure(now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void) -> None:
    """Advance the filters; write `position`, `commanded` and `measured` of every actuator.

    After a gap the filters start where what is known of the actuators would have them.

    Args:
        now: The present step; in the law's first one the filters start.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `DiagnosisParameters`.
        state: Record of dtype `DIAGNOSIS`, updated in place.
    """
    motion, dt = now.seen.motion, now.dt
    omega_filtered, moment_filtered = state["omega_filtered"], state["moment_filtered"]
    _note_commands(now, state)
    if now.first:
        for i in range(3):
            omega_filtered[i] = motion.omega[i]
        return
    settled = state["age"] > 1.5 * dt and not now.seen.after_gap
    tau = gains["filter_s"]
    share = dt / tau
    J = mat3(aircraft["J"])
    moment = sub(cross(motion.omega, mul(J, motion.omega)), motion.air.N)
    actuators = state["actuators"]
    if now.seen.after_gap:
        _start_as_known(now, moment, tau, aircraft, state)
    change = sub(motion.omega, vec3(omega_filtered))
    for i in range(3):
        omega_filtered[i] += share * change[i]
        moment_filtered[i] += share * (moment[i] - moment_filtered[i])
    turning = mul(J, scale(1.0 / tau, change))
    y = deflections_for(add(turning, vec3(moment_filtered)), motion.air.C, aircraft)
    for j in range(N_CHANNELS):
        actuator = actuators[j]
        if j < THROTTLE:
            actuator["measured"] = y[j]
        command = state["held"][_row(steps_back(j, now, gains, state), state), j]
        if settled:
            actuator["position"] = servo_step(actuator["position"], command, j, gains, dt)
        else:
            actuator["position"] = command
        position = actuator["position"]
        if j == THROTTLE:
            position = made_thrust(position, motion.V, aircraft)
        actuator["commanded"] += share * (position - actuator["commanded"])
    throttle = actuators[THROTTLE]
    delta = (
        actuators[AILERON]["position"],
        actuators[ELEVATOR]["position"],
        actuators[RUDDER]["position"],
    )
    thrust = thrust_for(motion.V_dot, motion, delta, aircraft)
    throttle["measured"] += share * (thrust - throttle["measured"])


@compiled
def steps_back(j: int, now: Step, gains: np.void, state: np.void) -> int:
    """Return how many periods ago the command of actuator j was sent that is measured now."""
    before, dead = now.seen.ahead, int(state["actuators"][j]["dead_steps"])
    if j == THROTTLE:
        before = now.seen.links + int(gains["throttle"]["dead_time_s"] / now.dt + 0.5)
    return min(before + dead, HISTORY - 1)


@compiled
def moved(j: int, steps: int, now: Step, gains: np.void, state: np.void) -> float:
    """Return how far the command of actuator j that is measured has moved in the last steps."""
    back, way = steps_back(j, now, gains, state), 0.0
    for k in range(back, min(back + steps + 1, HISTORY - 1)):
        way += abs(state["held"][_row(k, state), j] - state["held"][_row(k + 1, state), j])
    return way


@compiled
def restart_command(
    j: int, now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void
) -> None:
    """Let the filters of the command of actuator j begin again, as a dead time was found."""
    actuator = state["actuators"][j]
    command = state["held"][_row(steps_back(j, now, gains, state), state), j]
    actuator["position"] = actuator["commanded"] = command
    if j == THROTTLE:
        actuator["commanded"] = made_thrust(command, now.seen.motion.V, aircraft)
    actuator["blanking_s"] = max(actuator["blanking_s"], 3.0 * gains["filter_s"])


@compiled
def past_dither(j: int, now: Step, gains: np.void, state: np.void) -> float:
    """Return the dither of actuator j that is measured now [rad or N]."""
    dither: float = state["dithers"][_row(steps_back(j, now, gains, state), state), j]
    return dither


@compiled
def dither_in_force(j: int, state: np.void) -> float:
    """Return the dither that the held command of actuator j has [rad or N]."""
    dither: float = state["dithers"][_row(0, state), j]
    return dither


@compiled
def _note_commands(now: Step, state: np.void) -> None:
    """Note the commands in force; the first ones, and those after a gap, were before, too."""
    starts = now.first or state["age"] <= 1.5 * now.dt or now.seen.after_gap
    before = _row(0, state)
    state["step"] += 1
    for j in range(N_CHANNELS):
        dither = state["dithers"][before, j]
        if now.held[j] != state["held"][before, j]:  # it was sent, perhaps later than made
            dither = state["actuators"][j]["dither"]
        for k in range(HISTORY if starts else 1):
            row = _row(k, state)
            state["held"][row, j] = now.held[j]
            state["dithers"][row, j] = dither if k == 0 else 0.0


@compiled
def _row(back: int, state: np.void) -> int:
    return int((state["step"] - back) % HISTORY)


@compiled
def _start_as_known(
    now: Step, moment: Vec3, tau: float, aircraft: AircraftRecord, state: np.void
) -> None:
    """Start all filters as if the aircraft had rested in what is commanded and known of faults."""
    actuators = state["actuators"]
    for j in range(N_CHANNELS):
        actuator = actuators[j]
        held = now.held[j]
        if j == THROTTLE:
            held = made_thrust(held, now.seen.motion.V, aircraft)
        actuator["commanded"] = held
        known = actuator["effectiveness"] * held + actuator["offset"]
        actuator["measured"] = actuator["stuck"] if actuator["lost"] != 0 else known
    y = actuators[0]["measured"], actuators[1]["measured"], actuators[2]["measured"]
    turning = sub(mul(now.seen.motion.air.C, y), moment)
    change = mul(mat3(aircraft["J_inv"]), scale(tau, turning))
    for i in range(3):
        state["omega_filtered"][i] = now.seen.motion.omega[i] - change[i]
        state["moment_filtered"][i] = moment[i]
