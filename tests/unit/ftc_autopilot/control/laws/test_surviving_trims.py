"""Trims of the surviving law are steady flights of the plant's model; its loops act about them."""

import math
from typing import Any

import numpy as np
import pytest
from steps import NOTHING, step_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.control.controller import parameter_record
from ftc_autopilot.control.laws.surviving import Surviving
from ftc_autopilot.control.laws.surviving.healthy import commanded_acceleration
from ftc_autopilot.control.laws.surviving.lateral import (
    aileron_for_roll,
    driven_aileron,
    lateral_trim,
    rudder_for_roll,
    turn_rates,
)
from ftc_autopilot.control.laws.surviving.law import at_stop, reaching_stops
from ftc_autopilot.control.laws.surviving.longitudinal import (
    PitchTrim,
    pitch_trim,
    thrust_for_pitch,
)
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.step import ALL, Command, Step, Thresholds
from ftc_autopilot.control.triggers.static import PerChannel
from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.airframe.aerodynamics import force
from sitl_plant.airframe.rigid_body import STILL_AIR, state_derivative

STOP = math.radians(35.0)


@pytest.fixture(scope="module")
def gains(scenario1: Scenario) -> np.void:
    law = Surviving().with_servos(ActuatorServos())
    record: np.void = parameter_record(law, PerChannel())["surviving"]
    law.derive(scenario1.aircraft, record)
    return record


@pytest.fixture
def state() -> np.void:
    record: np.void = np.zeros(1, Surviving.STATE)[0]
    record["diagnosis"]["actuators"]["effectiveness"] = 1.0
    return record


def seen(
    nominal: np.void,
    V: float = 45.0,
    beta: float = 0.0,
    alpha: float = 0.05,
    phi: tuple[float, float, float] = NOTHING,
    omega: tuple[float, float, float] = NOTHING,
    reference: tuple[float, float, float] = NOTHING,
) -> Step:
    """A step with this motion, and a reference attitude."""
    message = np.zeros(1, SIM_STATE)[0]
    along = np.array([math.cos(alpha) * math.cos(beta), math.sin(beta)])
    message["velocity"] = *(V * along), V * math.sin(alpha) * math.cos(beta)
    message["attitude"], message["rates"] = phi, omega
    now = step_of(motion_of(message, nominal))
    return now._replace(reference=Reference(45.0, 0.0, reference, NOTHING))


# pitch, with the elevator lost


@pytest.mark.parametrize("stuck", [-0.02, 0.03])
@pytest.mark.parametrize("pitch", [-0.1, 0.3])
def test_a_trim_of_pitch_is_a_steady_flight(
    stuck: float, pitch: float, nominal: np.void, gains: np.void, state: np.void
) -> None:
    wide = gains.copy()
    wide["airspeeds"][[0, -1]] = 1.0, 500.0
    state["diagnosis"]["actuators"][ELEVATOR]["stuck"] = stuck
    now = seen(nominal, reference=(0.0, pitch, 0.0))
    trim = pitch_trim(now, nominal, wide, state["diagnosis"])
    now = seen(nominal, trim.V, reference=(0.0, pitch, 0.0))
    trim = pitch_trim(now, nominal, wide, state["diagnosis"])
    v = (trim.V * math.cos(trim.alpha), 0.0, trim.V * math.sin(trim.alpha))
    steady = (NOTHING, v, (0.0, pitch, 0.0), NOTHING)
    _, v_dot, _, omega_dot = state_derivative(
        steady, trim.thrust, (0.0, stuck, 0.0), NOTHING, NOTHING, STILL_AIR, nominal
    )
    assert [v_dot[0], v_dot[2], omega_dot[1]] == pytest.approx([0.0] * 3, abs=1e-9)


def test_a_trim_of_pitch_stays_within_what_is_known(
    nominal: np.void, gains: np.void, state: np.void
) -> None:
    """An angle of attack of -0.1 to 0.45 rad, a path of at most 0.5 rad, airspeeds with gains."""
    slowest, fastest = 0.88 * gains["airspeeds"][0], 0.8 * gains["airspeeds"][-1]
    elevator = state["diagnosis"]["actuators"][ELEVATOR]
    elevator["stuck"] = -0.6
    up = seen(nominal, reference=(0.0, 1.2, 0.0))
    trim = pitch_trim(up, nominal, gains, state["diagnosis"])
    assert (trim.alpha, trim.V) == pytest.approx((0.45, slowest))
    elevator["stuck"] = 0.6
    trim = pitch_trim(seen(nominal), nominal, gains, state["diagnosis"])
    assert (trim.alpha, trim.V) == pytest.approx((-0.1, fastest))
    elevator["stuck"] = 0.0
    drag = 0.5 * nominal["rho"] * 45.0**2 * nominal["S"] * nominal["cD0"]
    weight = nominal["m"] * nominal["g"]
    for pitch, gamma in ((1.2, 0.5), (-1.2, -0.5)):
        now = seen(nominal, reference=(0.0, pitch, 0.0))
        trim = pitch_trim(now, nominal, gains, state["diagnosis"])
        along = trim.thrust * math.cos(trim.alpha)
        assert along == pytest.approx(drag + weight * math.sin(gamma))


def test_the_thrust_feeds_back_what_is_off_the_trim(
    nominal: np.void, gains: np.void, state: np.void
) -> None:
    V, row = float(gains["airspeeds"][2]), gains["thrust_gains"][2]
    trim = PitchTrim(V - 3.0, 0.02, 700.0)
    state["diagnosis"]["actuators"][THROTTLE]["offset"] = 50.0
    state["pitch_integral"] = 0.1
    now = seen(
        nominal, V, alpha=0.07, phi=(0.0, 0.2, 0.0), omega=(0.0, -0.3, 0.0),
        reference=(0.0, 0.15, 0.0),
    )  # fmt: skip
    thrust = thrust_for_pitch(now, trim, nominal, gains, state)
    x = [3.0, 0.05, -0.3, 0.05, 0.1 + 0.05e-3]
    assert thrust == pytest.approx(650.0 - row @ x)


@pytest.mark.parametrize(
    ("error", "before", "after"),
    [
        (0.34, 0.0, 0.34e-3),
        (-0.34, 0.0, -0.34e-3),
        (0.36, 0.2, 0.2),  # too far off to be integrated
        (-0.36, 0.2, 0.2),
        (-1.0, 0.2, 0.2),
        (0.3, 0.6, 0.6),
        (-0.3, -0.6, -0.6),
    ],
)
def test_the_integral_of_the_pitch_error(
    error: float, before: float, after: float, nominal: np.void, gains: np.void, state: np.void
) -> None:
    state["pitch_integral"] = before
    now = seen(nominal, phi=(0.0, error + 0.1, 0.0), reference=(0.0, 0.1, 0.0))
    thrust_for_pitch(now, PitchTrim(45.0, 0.05, 900.0), nominal, gains, state)
    assert state["pitch_integral"] == pytest.approx(after, abs=1e-12)


# roll, with aileron or rudder lost


@pytest.mark.parametrize("lost", [AILERON, RUDDER])
def test_a_lateral_trim_leaves_no_moment(lost: int, any_aircraft: np.void, state: np.void) -> None:
    """Of the surfaces, one stuck and the other with an offset; the side force bends the path."""
    other, stuck, offset = RUDDER if lost == AILERON else AILERON, 0.03, 0.02
    actuators = state["diagnosis"]["actuators"]
    actuators[other]["offset"] = offset
    now = seen(any_aircraft, reference=(0.3, 0.0, 0.0), phi=(0.0, 0.1, 0.0))
    trim = lateral_trim(now, lost, stuck, any_aircraft, state["diagnosis"])
    alpha, delta = 1e-9, [0.0, 0.0, 0.0]
    delta[lost], delta[other] = stuck, trim.delta + offset
    steady = seen(any_aircraft, 45.0, trim.beta, alpha, omega=(0.0, 0.0, trim.r)).motion
    _, _, _, omega_dot = state_derivative(
        (NOTHING, steady.v, (0.3, 0.1, 0.0), steady.omega),
        0.0, (delta[0], delta[1], delta[2]), NOTHING, NOTHING, STILL_AIR, any_aircraft,
    )  # fmt: skip
    assert [omega_dot[0], omega_dot[2]] == pytest.approx([0.0, 0.0], abs=1e-9)
    by_air = force(steady.air, (delta[0], delta[1], delta[2]))[1] / any_aircraft["m"]
    assert abs(trim.beta) > 0.02
    gravity = any_aircraft["g"] * math.sin(0.3) * math.cos(0.1)
    assert trim.r * now.motion.v[0] == pytest.approx(gravity + by_air, rel=0.03)  # linear in β


def test_the_rudder_feeds_back_what_is_off_the_trim(
    nominal: np.void, gains: np.void, state: np.void
) -> None:
    V, row = float(gains["airspeeds"][1]), gains["rudder_gains"][1]
    state["diagnosis"]["actuators"][RUDDER]["effectiveness"] = 0.8
    now = seen(
        nominal, V, 0.04, phi=(math.pi - 0.1, 0.0, 0.0), omega=(0.02, 0.0, 0.3),
        reference=(0.05 - math.pi, 0.0, 0.0),
    )  # fmt: skip
    trim = lateral_trim(
        now,
        AILERON,
        float(state["diagnosis"]["actuators"][AILERON]["stuck"]),
        nominal,
        state["diagnosis"],
    )
    state["rudder_mean"] = 0.1
    x = np.array([0.04 - trim.beta, 0.02, 0.3 - trim.r, -0.15])
    rudder = rudder_for_roll(now, trim, gains, state, (-STOP, STOP))
    assert rudder == pytest.approx((trim.delta - row @ x) / 0.8)
    stopped = min(max(rudder, -STOP), STOP)
    assert state["rudder_mean"] == pytest.approx(0.1 + 1e-3 / 0.7 * (stopped - 0.1))


@pytest.mark.parametrize(
    ("mean", "before_deg", "after_deg"),
    [
        (0.93, 10.0, 10.04),
        (-0.93, 10.0, 9.96),
        (0.91, 10.0, 10.0),
        (-0.91, -10.0, -10.0),
        (1.0, 25.0, 25.0),
        (-1.0, -25.0, -25.0),
    ],
)
def test_the_lost_aileron_is_driven_while_the_rudder_is_at_its_stop(
    mean: float, before_deg: float, after_deg: float, nominal: np.void, gains: np.void,
    state: np.void,
) -> None:  # fmt: skip
    state["rudder_mean"], state["aileron_driven"] = mean * STOP, math.radians(before_deg)
    aileron = state["diagnosis"]["actuators"][AILERON]
    aileron["lost"], aileron["stuck"], aileron["decided_s"] = 1, 0.1, 9.0
    sent = driven_aileron(seen(nominal), 0.0, gains, state, nominal)
    assert math.degrees(state["aileron_driven"]) == pytest.approx(after_deg)
    assert sent == pytest.approx(0.1 + math.radians(2.0 + after_deg))  # 2°: the probe


def test_an_aileron_that_comes_and_goes_is_sent_what_the_roll_needs(
    nominal: np.void, gains: np.void, state: np.void
) -> None:
    state["rudder_mean"], state["aileron_driven"] = STOP, 0.3
    aileron = state["diagnosis"]["actuators"][AILERON]
    aileron["lost"], aileron["stuck"], aileron["decided_s"], aileron["care_s"] = 1, 0.1, 9.0, 0.5
    sent = driven_aileron(seen(nominal), -0.2, gains, state, nominal)
    assert sent == pytest.approx(-0.2 + math.radians(2.0))
    assert state["aileron_driven"] == 0.0


TRIED = ((0.0, 0.2), (0.002, 0.2), (0.035, 0.5), (0.037, 0.5), (0.07, 0.1), (0.072, 0.4))
"""Times since the loss [s], and what the aileron is then moved about [rad]."""


@pytest.mark.parametrize(("jumped", "decided_s"), [(False, 0.0), (True, 0.0), (False, 0.6)])
def test_an_aileron_that_may_be_weak_is_sent_what_the_roll_needs(
    jumped: bool, decided_s: float, nominal: np.void, gains: np.void, state: np.void
) -> None:
    """As for the least effectiveness; it changes with the movements of the trial, or as far.

    One that has jumped is free.
    """
    aileron = state["diagnosis"]["actuators"][AILERON]
    aileron["lost"], aileron["stuck"], aileron["z_tail"] = 1, 0.1, float(jumped)
    for k, (time_s, base) in enumerate(TRIED):
        aileron["decided_s"] = decided_s + time_s
        needed = (0.2, 0.3, 9.0, 0.4, 0.1, 0.4)[k] * 0.13  # 0.13: weak_effectiveness
        sent = driven_aileron(seen(nominal), needed, gains, state, nominal)
        if decided_s > 0.0:
            assert sent == pytest.approx(0.1 + math.radians(2.0))
            continue
        first_half = time_s % 0.07 < 0.035
        room = math.radians(25.0)  # the stop less the movement
        free = (0.2, 0.2, 9.0, 0.4, 0.1, 0.1)[k] * 0.13  # as of an aileron with all its power
        about = min(free if jumped else base, room)
        assert sent == pytest.approx(about + math.radians(10.0 if first_half else -10.0))


@pytest.mark.parametrize(("effectiveness", "offset"), [(1.0, 0.0), (0.2, 0.0), (0.2, 0.05)])
def test_a_turn_leaves_the_aileron_room_for_the_roll(
    effectiveness: float, offset: float, nominal: np.void, gains: np.void, state: np.void
) -> None:
    """At its sideslip it turns as the trim with the rest does; away from there 5.2/s faster."""
    actuator = state["diagnosis"]["actuators"][AILERON]
    actuator["effectiveness"], actuator["offset"] = effectiveness, offset
    rest = effectiveness * STOP - math.radians(1.5)
    for beta in (-0.3, 0.0, 0.1):
        now = seen(nominal, beta=beta)
        trims = [
            lateral_trim(now, AILERON, offset + side * rest, nominal, state["diagnosis"])
            for side in (-1.0, 1.0)
        ]
        limits = sorted(trim.r + 5.2 * (beta - trim.beta) for trim in trims)
        assert turn_rates(now, nominal, gains, state["diagnosis"]) == pytest.approx(limits)


@pytest.mark.parametrize(("sticks", "changed"), [(-0.2, 1), (0.2, 0)])
def test_an_aileron_that_may_stick_again_turns_with_no_sideslip_on_the_wrong_side(
    sticks: float, changed: int, nominal: np.void, gains: np.void, state: np.void
) -> None:
    """It sticks at negative deflections with positive sideslip, in a turn to the left."""
    aileron, now = state["diagnosis"]["actuators"][AILERON], seen(nominal, beta=0.1)
    trusted = turn_rates(now, nominal, gains, state["diagnosis"])
    aileron["owed_s"], aileron["sticks"] = 0.1, sticks
    bounds = turn_rates(now, nominal, gains, state["diagnosis"])
    assert bounds[1 - changed] == trusted[1 - changed]
    assert trusted[0] < bounds[changed] < trusted[1]
    low, high = (lateral_trim(now, AILERON, a, nominal, state["diagnosis"]) for a in (-0.3, 0.3))
    straight = low.r - low.beta * (high.r - low.r) / (high.beta - low.beta)
    assert bounds[changed] == pytest.approx(straight + 5.2 * 0.1)


def test_the_aileron_alone_makes_the_roll_acceleration(nominal: np.void, state: np.void) -> None:
    """Beside a rudder whose deflection is measured, with an offset and 0.7 of its effect."""
    now = seen(nominal, beta=0.05, phi=(0.2, 0.1, 0.0), omega=(0.3, -0.2, 0.1))
    actuators = state["diagnosis"]["actuators"]
    actuators[RUDDER]["measured"] = -0.2
    actuators[AILERON]["offset"], actuators[AILERON]["effectiveness"] = 0.03, 0.7
    aileron = aileron_for_roll(now, (2.5, 9.0, 9.0), nominal, state["diagnosis"])
    motion = now.motion
    _, _, _, omega_dot = state_derivative(
        (NOTHING, motion.v, motion.phi, motion.omega),
        0.0, (0.7 * aileron + 0.03, 0.1, -0.2), NOTHING, NOTHING, STILL_AIR, nominal,
    )  # fmt: skip
    assert omega_dot[0] == pytest.approx(2.5)


# stops


def test_a_deflection_near_a_stop_becomes_the_stop(nominal: np.void) -> None:
    assert at_stop(0.52, 0.6, 0.1) == 0.6
    assert at_stop(-0.52, 0.6, 0.1) == -0.6
    assert at_stop(0.48, 0.6, 0.1) == 0.48
    assert at_stop(-0.48, 0.6, 0.1) == -0.48
    stop = float(nominal["stops"][RUDDER, 1])
    near = 0.1 * stop + 0.02
    thresholds = Thresholds((0.5, 100.0), (0.1, 0.02))
    for inside, moved in ((0.01, False), (-0.01, True)):
        delta = stop - near - inside
        command = Command((delta, -delta, delta), 1990.0, ALL)
        found: Any = reaching_stops(command, thresholds, nominal)
        expected = (stop, -stop, stop) if moved else command.delta
        assert found == (expected, 1990.0, ALL)


# the loops of the healthy aircraft


def test_the_commanded_rates_derivative_is_limited(
    nominal: np.void, gains: np.void, state: np.void
) -> None:
    """A jump of the commanded rates asks for no more than 20, 20 and 10 rad/s² besides."""
    now = seen(nominal, 45.0)
    rates, limits = (3.0, -2.0, 1.0), np.array([20.0, -20.0, 10.0])
    asked = commanded_acceleration(now, rates, gains, state)
    assert asked == pytest.approx(limits + gains["K2"] * rates)
