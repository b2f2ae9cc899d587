"""Path following by preview of the reference filter's delay.

What guidance commands passes the reference filter (ω/(s+ω))³, which delays it by Tf = 3/ω, and
then flies as commanded. So the law commands what the path asks for where the aircraft will be a
time Tf later; feedback only has to take care of the rest. Symbols: χ course over ground, V
airspeed, V_g ground speed, w wind, s path parameter, κ curvature, χ_p course and h_p height of
the path, d offset of the slot to the right, e distance from that to the right, γ angle of climb
through the air, φ bank, ψ heading, θ pitch, α angle of attack.

    lateral     s' = V_g cos(χ - χ_p)/(1 - (d + e) κ)          s⁺ = s + Tf s'
                χ_d = χ_p(s⁺) - atan(k_e (e + T_p e') + k_i ∫e dt)/V_g, limited to 40°
                χ_c' = V_g κ(s⁺)/(1 - d κ(s⁺)) + k_χ (χ_d - χ_c), limited to g tan(φ_max)/V_g
                φ_r = atan(V_g χ_c'/(g cos ψ_w)) + k_φ (ψ_f - ψ_w - α sin φ - χ)
                ψ_r = χ_c + ψ_w + α_r sin φ_r
    vertical    γ_d = (k_h e_h + k_hi ∫e_h dt + h_p'(t + Tf + τ_γ))/V
                θ_r = γ_d + α_r cos φ_r + k_γ (γ_d' - γ), the last difference limited to 8.5°
                α_r = (m g cos γ_d/(q̄ S cos φ_r) - C_L0)/(C_Lα + C_D0)
    speed       V_r = |(V_g0 + Δ)(1 - d κ(s⁺)) t(χ_p(s⁺)) - w|

χ_c is the course that the law commands; it starts at the one flown. ψ_w is the angle between
heading and course that balances the wind, sin ψ_w = -w_right/V; ψ_f the filtered ψ_r. τ_γ =
m V/(q̄ S (C_Lα + C_D0)) is the time with which γ follows θ, and γ_d' is γ_d with h_p'(t). V_g0 is
the ground speed that the path's airspeed gives where the formation will be, t(χ) the unit vector,
Δ the correction of the formation: so its members keep their distances along the path, and a UAV
that is alone flies the path's airspeed.

Energy: the control law turns V_r into thrust, pitch sets the climb; both at once are limited so
that their sum is what the thrust can pay for: sin γ_d <= (T_max - D)/(m g) - V_r'/g, and not
steeper downwards than drag takes away. So the airspeed comes first.

In a glide, of which there is a thrust T that cannot be chosen, the airspeed is held by the pitch
between the path's and the greatest one, and what is left between follows the path's height:

    (V - V_max)/(g (Tf + τ_γ)) <= sin γ_d - (T - D)/(m g) <= (V - V_r)/(g (Tf + τ_γ))

Corners of the height are rounded: what is flown is the mean of the path's height over a distance
before and after.
"""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.tuples import Four
from ftc_autopilot.guidance.coordination import Coordination
from ftc_autopilot.guidance.laws.base import GuidanceParameters, Intention, Pace, Situation
from ftc_autopilot.guidance.path import PathPoint, height_at, point_at
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aerodynamics import carried_linearly, drag
from sitl_plant.airframe.thrust import available_thrust
from sitl_plant.vec3 import hypot, square

_APPROACH_MAX = math.radians(40.0)
"""Largest angle between the commanded course and the path [rad]."""
_INTEGRATION_MAX = math.radians(10.0)
"""Largest such angle at which the distance is integrated: the way to a path is no error [rad]."""
_CLIMB_CORRECTION_MAX = math.radians(8.5)
"""Largest difference of angles of climb that the pitch corrects at a time [rad]."""
_BESIDE_MAX = math.radians(5.0)
"""Largest angle between a nose that is turned to the runway and the runway [rad]."""
_MOST_FEEDBACK = 0.3
"""Largest k_φ g/V on an approach, relative to ω: with (1 + s/ω)³ it leaves 45° of phase."""
_INTEGRAL_SHARE = 0.15
"""Most that an integral commands, as a share of the ground speed."""
_ROUNDING_SAMPLES = 8
_CLIMBING_SHARE = 0.5
"""Share of what is to spare that accelerates, when the aircraft climbs from the ground."""


class PathFollowing(GuidanceParameters):
    """Flies a mission's path by preview of its turns, at commanded airspeeds.

    Choose it for missions, the one of ours; without a mission none is needed.

    Attributes:
        kind: Name of the law.
        cross_track_1_s: Gain k_e of the distance from the path.
        cross_track_lead_s: Lead T_p of the distance from the path, beyond the filter's delay.
        cross_track_integral_1_s2: Gain k_i of the distance's integral.
        course_1_s: Gain k_chi of the course.
        bank_feedback: Gain k_phi from the error of the course to the bank.
        height_1_s: Gain k_h of the height.
        height_integral_1_s2: Gain k_hi of the height's integral.
        climb_feedback: Gain k_gamma from the error of the climb to the pitch.
        rounding_s: Time of flight before and after a corner of the height.
        wind_time_s: Time constant of the estimate of the wind.
    """

    PAGE: ClassVar[str] = "explanation/guidance.md"
    STATE: ClassVar[np.dtype] = np.dtype(
        [
            ("started", "i8"),
            ("course", "f8"),  # χ_c [rad]
            ("airspeed", "f8"),  # V_r [m/s]
            ("cross_track", "f8"),  # ∫e dt [m s]
            ("height", "f8"),  # ∫e_h dt [m s]
            ("wind", "f8", (3,)),  # estimate, NED [m/s]
        ]
    )

    kind: Literal["path"] = "path"

    cross_track_1_s: float = quantity("1/s", default=0.8, gt=0.0)
    cross_track_lead_s: float = quantity("s", default=0.3, ge=0.0)
    cross_track_integral_1_s2: float = quantity("1/s^2", default=0.08, ge=0.0)
    course_1_s: float = quantity("1/s", default=3.0, gt=0.0)
    bank_feedback: float = quantity("", default=3.0, ge=0.0)
    height_1_s: float = quantity("1/s", default=0.4, gt=0.0)
    height_integral_1_s2: float = quantity("1/s^2", default=0.03, ge=0.0)
    climb_feedback: float = quantity("", default=1.0, ge=0.0)
    rounding_s: float = quantity("s", default=0.6, gt=0.0)
    wind_time_s: float = quantity("s", default=2.0, gt=0.0)


class _PathPlace(NamedTuple):
    """How the UAV moves along the path, and where it will be after the filter's delay."""

    s_dot: float  # [m/s]
    e: float  # to the right of the slot [m]
    ground_speed: float  # [m/s]
    course: float  # over ground [rad]
    ahead: PathPoint


@compiled
def path_law(
    now: Situation,
    path: np.void,
    aircraft: np.void,
    limits: np.void,
    gains: np.void,
    state: np.void,
) -> Four:
    """Make one update.

    The first one commands the present motion, so that the reference filter starts from there.

    Args:
        now: The situation.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH` with at least one leg.
        aircraft: Nominal aircraft, dtype `sitl_plant.airframe.aircraft.AIRCRAFT`.
        limits: Record made of `ftc_autopilot.guidance.laws.base.GuidanceParameters`.
        gains: Record made of what `PathFollowing` has beyond that.
        state: Record of dtype `PathFollowing.STATE`, updated in place.

    Returns:
        Airspeed [m/s], roll, pitch, yaw [rad].
    """
    _estimate_wind(now, gains, state)
    V = max(now.motion.V, 1.0)
    wind = state["wind"][0], state["wind"][1]
    place = _place(now, path)
    if state["started"] == 0:
        state["started"] = 1
        state["course"] = wrap(now.motion.phi[2] - _drift(place.course, V, wind))
        state["airspeed"] = now.motion.V
        return now.motion.V, *now.motion.phi
    airspeed = _airspeed(now, path, place, wind, aircraft, limits, state)
    climb, climb_now = _climb(now, path, place, aircraft, limits, gains, state)
    if math.isfinite(now.glide):
        airspeed = V
    weight = aircraft["m"] * aircraft["g"] * math.cos(climb)
    lift = 0.5 * aircraft["rho"] * square(airspeed) * aircraft["S"]
    at_zero, slope = carried_linearly(aircraft)

    most = at_zero + slope * limits["incidence_max_rad"]
    load = max(lift * most / weight, 1.0)  # 1/cos of the bank at the largest angle of attack
    bank_max = min(limits["bank_max_rad"], math.acos(1.0 / load))
    roll, drift = _turn(now, place, V, wind, bank_max, aircraft["g"], gains, state)
    alpha = (weight / (lift * math.cos(roll)) - at_zero) / slope
    down = now.velocity[2] if now.over_ground != 0 else now.air_velocity[2]
    gamma = math.asin(min(max(-down / V, -1.0), 1.0))
    correction = min(max(climb_now - gamma, -_CLIMB_CORRECTION_MAX), _CLIMB_CORRECTION_MAX)
    pitch = climb + alpha * math.cos(roll) + gains["climb_feedback"] * correction
    yaw = state["course"] + drift + alpha * math.sin(roll)
    if math.isfinite(now.nose):
        beside = wrap(state["course"] - now.nose)
        yaw = now.nose + min(max(beside, -_BESIDE_MAX), _BESIDE_MAX)
    return airspeed, roll, pitch, wrap(yaw)


@compiled
def path_pace(now: Situation, path: np.void, ahead: float, state: np.void) -> Pace:
    """Return how a UAV whose slot lies ahead [m] gets on; other arguments as of `path_law`."""
    return _pace(now, path, _place(now, path), ahead, state)


@compiled
def _pace(now: Situation, path: np.void, place: _PathPlace, ahead: float, state: np.void) -> Pace:
    wind = state["wind"][0], state["wind"][1]
    if state["started"] == 0:
        wind = now.velocity[0] - now.air_velocity[0], now.velocity[1] - now.air_velocity[1]
    formation = point_at(path, now.s - ahead)
    speed = _ground_speed(formation.course, formation.airspeed, wind)
    return Pace(now.s, place.s_dot, speed)


@compiled
def path_intention(now: Situation, path: np.void, gains: np.void, state: np.void) -> Intention:
    """Return the velocity that `path_law` asks for with the same arguments, nobody evaded."""
    place, here, coordination = _place(now, path), now.here, now.coordination
    pace = _pace(now, path, place, coordination.slot[0], state)
    along = pace.speed + coordination.speed
    along *= max(1.0 - coordination.slot[1] * here.curvature, 0.2)
    speed = max(place.ground_speed, 1.0)
    approach = math.atan(_sideways(now, place, gains, state) / speed)
    right = -speed * math.sin(min(max(approach, -_APPROACH_MAX), _APPROACH_MAX))
    high = here.height + coordination.slot[2] + now.position[2]
    up = _upwards(high, coordination, gains, state) + here.climb * place.s_dot
    return Intention(here.course, along, right, up, place.e, -high)


@compiled
def _estimate_wind(now: Situation, gains: np.void, state: np.void) -> None:
    """Filter the difference of the velocities over ground and through the air."""
    share = 1.0 if state["started"] == 0 else 1.0 - math.exp(-now.dt / gains["wind_time_s"])
    for k in range(3):
        measured = now.velocity[k] - now.air_velocity[k]
        state["wind"][k] += share * (measured - state["wind"][k])


@compiled
def _place(now: Situation, path: np.void) -> _PathPlace:
    """Return how the UAV moves along its path."""
    ground_speed = hypot(now.velocity[0], now.velocity[1])
    course = math.atan2(now.velocity[1], now.velocity[0])
    # beyond it, the centre of the arc is too near
    room = max(1.0 - now.off * now.here.curvature, 0.2)
    s_dot = ground_speed * math.cos(course - now.here.course) / room
    ahead = point_at(path, now.s + 3.0 / now.bandwidth * s_dot)
    return _PathPlace(s_dot, now.off - now.coordination.slot[1], ground_speed, course, ahead)


@compiled
def _drift(course: float, V: float, wind: tuple[float, float]) -> float:
    """Return ψ_w, by which the heading differs from the course in a wind, north and east [rad]."""
    right = wind[1] * math.cos(course) - wind[0] * math.sin(course)
    return math.asin(min(max(-right / V, -0.7), 0.7))


@compiled
def _ground_speed(course: float, V: float, wind: tuple[float, float]) -> float:
    """Return the ground speed along a course at an airspeed."""
    along = wind[0] * math.cos(course) + wind[1] * math.sin(course)
    return V * math.cos(_drift(course, V, wind)) + along


@compiled
def _airspeed(
    now: Situation,
    path: np.void,
    place: _PathPlace,
    wind: tuple[float, float],
    aircraft: np.void,
    limits: np.void,
    state: np.void,
) -> float:
    """Return V_r, which rises no faster than the propulsion permits at the present airspeed."""
    ahead, right, _ = now.coordination.slot
    s = now.s + 3.0 / now.bandwidth * place.s_dot
    formation = point_at(path, s - ahead)
    speed = _ground_speed(formation.course, formation.airspeed, wind) + now.coordination.speed
    speed *= max(1.0 - right * place.ahead.curvature, 0.2)
    north = speed * math.cos(place.ahead.course) - wind[0]
    east = speed * math.sin(place.ahead.course) - wind[1]
    desired = hypot(north, east)
    desired = min(max(desired, limits["airspeed_min_m_s"]), limits["airspeed_max_m_s"])
    change = limits["acceleration_max_m_s2"] * now.dt
    faster = change
    if aircraft["thrust_rows"] > 0:
        thrust, D = _thrust_and_drag(now, aircraft, limits)
        faster = min(change, max(thrust - D, 0.0) / aircraft["m"] * now.dt)
    if math.isfinite(now.level):
        faster *= _CLIMBING_SHARE
    desired = min(max(desired, state["airspeed"] - change), state["airspeed"] + faster)
    state["airspeed"] = desired
    return float(desired)


@compiled
def _sideways(now: Situation, place: _PathPlace, gains: np.void, state: np.void) -> float:
    """Return the velocity to the left that brings the UAV to its slot [m/s]."""
    moving = now.coordination.slot_rate[1]
    e_dot = place.ground_speed * math.sin(place.course - now.here.course) - moving
    lead = 3.0 / now.bandwidth + gains["cross_track_lead_s"]
    sideways = gains["cross_track_1_s"] * (place.e + lead * e_dot) - moving
    return float(sideways + gains["cross_track_integral_1_s2"] * state["cross_track"])


@compiled
def _turn(
    now: Situation,
    place: _PathPlace,
    V: float,
    wind: tuple[float, float],
    bank_max: float,
    g: float,
    gains: np.void,
    state: np.void,
) -> tuple[float, float]:
    """Advance χ_c; return φ_r and ψ_w."""
    speed, coordination = max(place.ground_speed, 1.0), now.coordination
    gain = gains["cross_track_integral_1_s2"]
    sideways = _sideways(now, place, gains, state) - coordination.right
    approach = math.atan(sideways / speed)
    if abs(approach) < _INTEGRATION_MAX and gain > 0.0 and coordination.right == 0.0:
        limit = _INTEGRAL_SHARE * speed / gain
        state["cross_track"] = min(max(state["cross_track"] + place.e * now.dt, -limit), limit)
    desired = place.ahead.course - min(max(approach, -_APPROACH_MAX), _APPROACH_MAX)
    speed_ahead = max(_ground_speed(place.ahead.course, V, wind), 1.0)
    curvature = place.ahead.curvature
    rate = speed_ahead * curvature / max(1.0 - coordination.slot[1] * curvature, 0.2)
    rate += gains["course_1_s"] * wrap(desired - state["course"])
    fastest = g * math.tan(bank_max) / speed_ahead
    rate = min(max(rate, -fastest), fastest)
    state["course"] = wrap(state["course"] + now.dt * rate)

    drift = _drift(state["course"], V, wind)
    roll = math.atan(speed_ahead * rate / (g * math.cos(drift)))
    v, phi = now.motion.v, now.motion.phi
    flown = place.course + _drift(place.course, V, wind)
    flown += math.atan2(v[2], v[0]) * math.sin(phi[0])  # the heading that belongs to the course
    if not math.isfinite(now.nose):
        feedback = gains["bank_feedback"]
        if now.over_ground != 0:
            feedback = min(feedback, _MOST_FEEDBACK * V * now.bandwidth / g)
        roll += feedback * wrap(now.reference[3][0] - flown)
    return min(max(roll, -bank_max), bank_max), drift


@compiled
def _upwards(error: float, coordination: Coordination, gains: np.void, state: np.void) -> float:
    """Return the velocity upwards that brings the UAV to its slot, beside the path's climb [m/s].

    Args:
        error: Height of the slot above the UAV [m].
        coordination: Slot and corrections.
        gains: Of the law.
        state: Of the law.
    """
    integral = gains["height_integral_1_s2"] * state["height"]
    return float(gains["height_1_s"] * error + integral + coordination.slot_rate[2])


@compiled
def _climb(
    now: Situation,
    path: np.void,
    place: _PathPlace,
    aircraft: np.void,
    limits: np.void,
    gains: np.void,
    state: np.void,
) -> tuple[float, float]:
    """Return γ_d and γ_d'."""
    V = max(now.motion.V, 1.0)
    pressure = 0.5 * aircraft["rho"] * square(V) * aircraft["S"]
    weight = aircraft["m"] * aircraft["g"]
    _, lift_slope = carried_linearly(aircraft)
    lag = aircraft["m"] * V / (pressure * lift_slope)
    reach = gains["rounding_s"] * V
    s_later, coordination = now.s + (3.0 / now.bandwidth + lag) * place.s_dot, now.coordination
    slope, slope_ahead = _rounded_slope(path, now.s, reach), _rounded_slope(path, s_later, reach)
    error = _rounded_height(path, now.s, reach) + coordination.slot[2] + now.position[2]
    if math.isfinite(now.level):
        slope, slope_ahead, error = 0.0, 0.0, now.level + now.position[2]
    gain = gains["height_integral_1_s2"]
    sink = _upwards(error, coordination, gains, state) + coordination.up

    accelerating = now.reference[0][1] / aircraft["g"]
    thrust, D = _thrust_and_drag(now, aircraft, limits)
    most = math.sin(limits["climb_max_rad"])
    high = min(max((thrust - D) / weight - accelerating, -most), most)
    low = max(min(-D / weight - accelerating, most), -most)
    if math.isfinite(now.glide):
        balance, pace = (now.glide - D) / weight, aircraft["g"] * (3.0 / now.bandwidth + lag)
        high = min(balance + (V - now.here.airspeed) / pace, most)
        low = max(balance + (V - limits["airspeed_max_m_s"]) / pace, -most)
        high = max(high, low)
    desired = (sink + slope_ahead * place.s_dot) / V
    if low < desired < high and gain > 0.0 and coordination.up == 0.0:
        limit = _INTEGRAL_SHARE * V / gain
        state["height"] = min(max(state["height"] + error * now.dt, -limit), limit)
    present = (sink + slope * place.s_dot) / V
    return math.asin(min(max(desired, low), high)), math.asin(min(max(present, low), high))


@compiled
def _thrust_and_drag(now: Situation, aircraft: np.void, limits: np.void) -> tuple[float, float]:
    """Return the largest thrust that guidance counts on, and the drag, at present [N]."""
    V = max(now.motion.V, 1.0)
    pressure = 0.5 * aircraft["rho"] * square(V) * aircraft["S"]
    D = drag(pressure, math.atan2(now.motion.v[2], now.motion.v[0]), aircraft)
    return limits["thrust_share_max"] * available_thrust(V, aircraft), D


@compiled
def _rounded_height(path: np.void, s: float, reach: float) -> float:
    """Return the path's height at s, the mean over ± reach [m]."""
    total = 0.0
    for k in range(_ROUNDING_SAMPLES):
        share = (2 * k + 1) / _ROUNDING_SAMPLES - 1.0
        total += height_at(path, s + share * reach)
    return total / _ROUNDING_SAMPLES


@compiled
def _rounded_slope(path: np.void, s: float, reach: float) -> float:
    """Return the slope of that height at s."""
    return (height_at(path, s + reach) - height_at(path, s - reach)) / (2.0 * reach)
