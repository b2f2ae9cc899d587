"""The law of path following: its equations, and limits that hold whatever it is reported."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steps import on_path, situation_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.guidance.aircraft_limits import HOME
from ftc_autopilot.guidance.coordination import Coordination, no_coordination
from ftc_autopilot.guidance.laws import GUIDANCE_STATE, guidance_record, guide
from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_autopilot.guidance.legs import Leg
from ftc_autopilot.guidance.path import path_record
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import vec3

DT, OMEGA = 0.02, 2.5
DEFAULT = PathFollowing(**HOME._asdict())
STRAIGHT = path_record([Leg(0.0, 0.0, 0.0, 0.0, math.inf, 100.0, 0.0, 40.0, 1)], 1)


def situation(
    nominal: np.void,
    position: tuple[float, float, float],
    attitude: tuple[float, float, float],
    through_air: tuple[float, float, float],
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
    dt: float = DT,
) -> Situation:
    """Position and wind in NED axes, velocity through the air in body axes."""
    to_ned = np.array(R1(attitude))
    measured = np.zeros(1, SIM_STATE)[0]
    measured["position"], measured["attitude"] = position, attitude
    measured["wind"] = to_ned.T @ wind
    measured["velocity"] = through_air + measured["wind"]
    motion = motion_of(measured, nominal)
    ground, air = vec3(to_ned @ measured["velocity"]), vec3(to_ned @ through_air)
    return situation_of(motion, position, ground, air, dt, yaw=attitude[2])


class Flight:
    """The law between two updates."""

    def __init__(
        self, nominal: np.void, path: np.void = STRAIGHT, guidance: PathFollowing = DEFAULT
    ) -> None:
        self.nominal, self.path = nominal, path
        self.parameters = guidance_record(guidance)
        self.state = np.zeros(1, GUIDANCE_STATE)[0]
        self.command = (0.0, 0.0, 0.0, 0.0)
        self.s = 0.0

    def update(
        self, now: Situation, coordination: Coordination | None = None
    ) -> tuple[float, float, float, float]:
        now = on_path(now, self.path, self.s)
        now = now._replace(coordination=coordination or no_coordination())
        self.command = guide(now, self.path, self.nominal, self.parameters, self.state)
        self.s = now.s
        return self.command


def test_the_first_command_is_the_present_motion(nominal: np.void) -> None:
    """The reference filter starts from it, so that nothing jumps."""
    now = situation(nominal, (50.0, 30.0, -80.0), (0.3, 0.1, 1.2), (36.0, 1.0, 2.0))
    command = Flight(nominal).update(now)
    assert command == pytest.approx((math.sqrt(36.0**2 + 5.0), 0.3, 0.1, 1.2))


def test_on_the_path_and_trimmed_it_commands_the_trim(nominal: np.void) -> None:
    alpha = (nominal["m"] * nominal["g"] / (0.5 * nominal["rho"] * 40.0**2 * nominal["S"])) - 0.1
    alpha /= nominal["cL_alpha"] + nominal["cD0"]
    through_air = (40.0 * math.cos(alpha), 0.0, 40.0 * math.sin(alpha))
    now = situation(nominal, (0.0, 0.0, -100.0), (0.0, alpha, 0.0), through_air)
    flight = Flight(nominal)
    for _ in range(2):
        command = flight.update(now)
    assert command == pytest.approx((40.0, 0.0, alpha, 0.0), abs=1e-12)


def expected_in_a_turn(
    nominal: np.void,
    guidance: PathFollowing,
    now: Situation,
    radius: float,
    slot: tuple[float, float, float],
    wind: np.ndarray,
) -> tuple[float, ...]:
    """The equations of the docstring for a circle to the right around the origin, at the top.

    The course commanded before was the one flown; the integrals are zero.
    """
    g, p = float(nominal["g"]), guidance
    kappa, V = 1.0 / radius, now.motion.V
    ground = np.array(now.velocity[:2])
    Vg, chi = math.hypot(*ground), math.atan2(ground[1], ground[0])
    # the aircraft is due north of the centre; there the path leads east
    chi_p, off = math.pi / 2, radius - now.position[0]
    d, e = slot[1], off - slot[1]
    s_dot = Vg * math.cos(chi - chi_p) / (1.0 - off * kappa)
    Tf = 3.0 / OMEGA

    def tangent(course: float) -> np.ndarray:
        return np.array([math.cos(course), math.sin(course)])

    def drift(course: float) -> float:
        north, east = tangent(course)
        return -math.asin((north * wind[1] - east * wind[0]) / V)

    def speed_over_ground(course: float, airspeed: float) -> float:
        """The root of |v t - w| = airspeed."""
        along = float(tangent(course) @ wind)
        return along + math.sqrt(along**2 + airspeed**2 - float(wind @ wind))

    # speed
    chi_ahead = chi_p + Tf * s_dot * kappa
    chi_formation = chi_ahead - slot[0] * kappa
    U = speed_over_ground(chi_formation, 40.0)
    V_r = float(np.hypot(*(U * (1.0 - d * kappa) * tangent(chi_ahead) - wind)))
    # lateral
    e_dot = Vg * math.sin(chi - chi_p)
    k_e, T_p = p.cross_track_1_s, Tf + p.cross_track_lead_s
    chi_d = chi_ahead - math.atan(k_e * (e + T_p * e_dot) / Vg)
    chi_c = now.motion.phi[2] - drift(chi)
    Vg_ahead = speed_over_ground(chi_ahead, V)
    rate = Vg_ahead * kappa / (1.0 - d * kappa)
    rate += p.course_1_s * math.remainder(chi_d - chi_c, 2 * math.pi)
    chi_c += DT * rate
    alpha = math.atan2(now.motion.v[2], now.motion.v[0])
    due = chi + drift(chi) + alpha * math.sin(now.motion.phi[0])
    roll = math.atan(Vg_ahead * rate / (g * math.cos(drift(chi_c))))
    roll += p.bank_feedback * math.remainder(float(now.reference[3][0]) - due, 2 * math.pi)
    # vertical
    e_h = 100.0 + slot[2] + now.position[2]
    gamma_d = math.asin(p.height_1_s * e_h / V)
    gamma = math.asin(-now.air_velocity[2] / V)
    weight = float(nominal["m"]) * g * math.cos(gamma_d)
    lift = 0.5 * float(nominal["rho"]) * V_r**2 * float(nominal["S"])
    alpha_r = weight / (lift * math.cos(roll)) - float(nominal["cL0"])
    alpha_r /= float(nominal["cL_alpha"] + nominal["cD0"])
    pitch = gamma_d + alpha_r * math.cos(roll) + p.climb_feedback * (gamma_d - gamma)
    return V_r, roll, pitch, chi_c + drift(chi_c) + alpha_r * math.sin(roll)


def test_a_turn_in_wind_beside_the_path_is_as_the_equations_say(nominal: np.void) -> None:
    radius, slot, wind = 400.0, (-20.0, 15.0, 4.0), np.array([3.0, -4.0])
    path = path_record([Leg(400.0, 0.0, math.pi / 2, 1 / radius, math.inf, 100.0, 0.0, 40.0, 1)], 1)
    gains = {
        "cross_track_integral_1_s2": 0.0,
        "height_integral_1_s2": 0.0,
        "course_1_s": 0.5,
        "bank_feedback": 1.5,
        "acceleration_max_m_s2": 1000.0,
    }
    guidance = DEFAULT.model_copy(update=gains)
    flight = Flight(nominal, path, guidance)
    now = situation(
        nominal,
        (388.0, 0.0, -102.0),
        (0.35, 0.06, math.pi / 2 + 0.11),
        (40.5, 0.2, 2.0),
        (float(wind[0]), float(wind[1]), 0.0),
    )
    coordination = no_coordination()._replace(slot=slot)
    flight.update(now, coordination)
    command = flight.update(now, coordination)
    expected = expected_in_a_turn(nominal, guidance, now, radius, slot, wind)
    assert command[:3] == pytest.approx(expected[:3], rel=1e-9)
    assert math.remainder(command[3] - expected[3], 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert 0.1 < command[1] < math.radians(40.0)  # nothing is at a limit


def test_it_climbs_before_the_path_does_and_rounds_the_corner(nominal: np.void) -> None:
    legs = [
        Leg(0.0, 0.0, 0.0, 0.0, 500.0, 100.0, 0.0, 40.0, 1),
        Leg(500.0, 0.0, 0.0, 0.0, math.inf, 100.0, 0.1, 40.0, 2),
    ]
    pitches = {}
    for north in (300.0, 440.0, 480.0):
        flight = Flight(nominal, path_record(legs, 1))
        flight.s = north
        now = situation(nominal, (north, 0.0, -100.0), (0.0, 0.058, 0.0), (39.93, 0.0, 2.3))
        for _ in range(2):
            pitches[north] = flight.update(now)[2]
    climb = math.atan(0.1)
    assert pitches[440.0] > pitches[300.0] + 0.5 * climb
    assert pitches[480.0] > pitches[440.0]


def test_thrust_that_is_needed_for_the_airspeed_is_not_climbed_with(nominal: np.void) -> None:
    """At 60 m/s drag takes 1600 N; a weak engine leaves nothing to climb with."""
    weak = nominal.copy()
    weak["thrust_limit"] = 1700.0
    now = situation(nominal, (0.0, 0.0, -50.0), (0.0, -0.05, 0.0), (60.0, 0.0, -3.0))
    strong, feeble = Flight(nominal), Flight(weak)
    for flight in (strong, feeble):
        for _ in range(2):
            flight.update(now)
    assert strong.command[2] > feeble.command[2] + math.radians(10.0)


ANGLES = st.floats(-3.1, 3.1)
PLACES = st.floats(-3000.0, 3000.0)
SPEEDS = st.floats(-30.0, 30.0)


@given(
    st.lists(
        st.tuples(
            st.tuples(PLACES, PLACES, st.floats(-2000.0, 500.0)),
            st.tuples(ANGLES, st.floats(-1.4, 1.4), ANGLES),
            st.tuples(st.floats(3.0, 100.0), SPEEDS, SPEEDS),
            st.tuples(SPEEDS, SPEEDS, SPEEDS),
            st.tuples(st.floats(-50.0, 50.0), st.floats(-300.0, 300.0), st.floats(-50.0, 50.0)),
        ),
        min_size=2,
        max_size=5,
    ),
    st.sampled_from([0.0, 1 / 60.0, -1 / 150.0, 1 / 450.0]),
    st.floats(-0.5, 0.5),
)
def test_whatever_happens_commands_stay_within_limits(
    nominal: np.void, updates: list[tuple[Any, ...]], curvature: float, climb: float
) -> None:
    leg = Leg(0.0, 0.0, 0.0, curvature, math.inf, 100.0, climb, 40.0, 1)
    flight, limits = Flight(nominal, path_record([leg], 1)), HOME
    for k, (position, attitude, through_air, wind, slot) in enumerate(updates):
        before = flight.command[0]
        now = situation(nominal, position, attitude, through_air, wind)
        command = flight.update(now, no_coordination()._replace(slot=slot))
        assert np.isfinite(command).all()
        if k == 0:
            continue
        airspeed, roll, pitch, yaw = command
        change = limits.acceleration_max_m_s2 * DT
        outside = not limits.airspeed_min_m_s <= before <= limits.airspeed_max_m_s
        assert outside or limits.airspeed_min_m_s <= airspeed <= limits.airspeed_max_m_s
        assert abs(airspeed - before) <= change + 1e-9
        assert abs(roll) <= math.radians(DEFAULT.bank_max_deg) + 1e-9
        assert abs(yaw) <= math.pi + 1e-9
        if airspeed >= limits.airspeed_min_m_s:
            most = limits.climb_max_deg + limits.incidence_max_deg + 8.5 * DEFAULT.climb_feedback
            assert abs(pitch) <= math.radians(most) + 1e-9


def test_a_slow_aircraft_keeps_its_lift_to_fly_level(nominal: np.void) -> None:
    """At 30 m/s level flight takes 11.7° of 15°; the bank that takes 15° is 31°."""
    flight = Flight(nominal, guidance=DEFAULT.model_copy(update={"bank_max_deg": 60.0}))
    leg = Leg(0.0, 0.0, 0.0, 0.0, math.inf, 100.0, 0.0, 30.0, 1)
    flight.path = path_record([leg], 1)
    now = situation(nominal, (0.0, -300.0, -100.0), (0.0, 0.2, -1.0), (29.4, 0.0, 6.0))
    for _ in range(2):
        command = flight.update(now)
    assert math.degrees(command[1]) == pytest.approx(30.9, abs=0.2)
    assert command[2] < math.radians(16.0)


@pytest.mark.parametrize(("V", "omega"), [(36.0, 2.5), (37.0, 1.0), (40.0, 0.7)])
def test_on_an_approach_bank_and_course_are_a_stable_loop(
    nominal: np.void, V: float, omega: float
) -> None:
    """A bank k turns the course by k g/V, behind the filter's three lags: 45° of phase are left."""
    rolls = []
    for yaw in (0.0, 0.01):
        now = situation(nominal, (0.0, 0.0, -100.0), (0.0, 0.05, 0.0), (V, 0.0, 0.05 * V))
        rest = (0.0, 0.0, 0.0)
        now = now._replace(
            bandwidth=omega, over_ground=1, reference=(rest, rest, rest, (yaw, 0, 0))
        )
        flight = Flight(nominal)
        for _ in range(2):
            command = flight.update(now)
        rolls.append(command[1])
    gain = (rolls[1] - rolls[0]) / 0.01 * nominal["g"] / now.motion.V
    omegas = np.linspace(0.01, 1.0, 1000) * omega
    loop = gain / (1j * omegas * (1.0 + 1j * omegas / omega) ** 3)
    crossing = np.argmax(np.abs(loop) < 1.0)
    assert math.degrees(np.angle(loop[crossing])) == pytest.approx(-135.0, abs=1.0)


def test_in_the_air_the_bank_follows_the_course_as_the_gain_says(nominal: np.void) -> None:
    now = situation(nominal, (0.0, 0.0, -100.0), (0.0, 0.05, 0.0), (36.0, 0.0, 1.8))
    flight = Flight(nominal)
    for yaw in (0.0, 0.0, 0.01):
        rest = (0.0, 0.0, 0.0)
        command = flight.update(now._replace(reference=(rest, rest, rest, (yaw, 0.0, 0.0))))
    assert command[1] == pytest.approx(0.01 * DEFAULT.bank_feedback, rel=1e-6)


@pytest.mark.parametrize(("east", "least", "most"), [(1.0, -5.0, -0.1), (-30.0, 5.0, 5.0)])
def test_a_nose_that_turns_to_the_runway_still_leads_to_its_line(
    nominal: np.void, east: float, least: float, most: float
) -> None:
    """A wind from the left would take 14° of crab; the nose takes no more than 5° for the line."""
    wind = (0.0, 10.0, 0.0)
    now = situation(nominal, (0.0, east, -100.0), (0.0, 0.05, -0.25), (40.0, 0.0, 2.0), wind)
    flight = Flight(nominal)
    for _ in range(100):
        command = flight.update(now._replace(nose=0.0))
    assert least - 1e-9 <= math.degrees(command[3]) <= most + 1e-9
