"""The propulsion of an aircraft: its table, its propeller, and what a file may say of them."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.optimize import brentq

from gcs.scenario.aircraft_file import load_aircraft
from mavlink_defs.config.files import problems_of
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.propulsion import Propeller, Propulsion
from sitl_plant.airframe.thrust import (
    available_thrust,
    is_short,
    made_thrust,
    reach_of,
    thrust_moment,
)

RHO = 1.2682  # of the Aerosonde
_STEPS = st.lists(st.floats(0.1, 30.0), min_size=2, max_size=8)


def with_propulsion(aircraft: Aircraft, propulsion: dict[str, Any], **keys: Any) -> Aircraft:
    return Aircraft.model_validate(aircraft.model_dump() | {"propulsion": propulsion} | keys)


@pytest.fixture(scope="module")
def aerosonde() -> Aircraft:
    return load_aircraft("aerosonde_propeller")


@pytest.fixture(scope="module")
def propeller(aerosonde: Aircraft) -> Propeller:
    assert aerosonde.propulsion is not None
    assert aerosonde.propulsion.propeller is not None
    return aerosonde.propulsion.propeller


# the table


@given(steps=_STEPS, data=st.data(), V=st.floats(0.0, 300.0))
def test_the_largest_thrust_is_linear_between_the_rows(
    steps: list[float], data: Any, V: float
) -> None:
    airspeeds = np.cumsum(steps)
    sizes = st.lists(st.floats(0.0, 500.0), min_size=len(steps), max_size=len(steps))
    thrusts = data.draw(sizes)
    rows = [
        {"airspeed_m_s": float(x), "thrust_n": y} for x, y in zip(airspeeds, thrusts, strict=True)
    ]
    limit = data.draw(st.floats(1.0, 600.0))
    paper = load_aircraft("paper")
    record = aircraft_record(with_propulsion(paper, {"thrust": rows}, thrust_limit_n=limit))
    most = available_thrust(V, record)
    assert most == pytest.approx(min(np.interp(V, airspeeds, thrusts), limit), abs=1e-9)
    assert 0.0 <= most <= limit
    for asked in (0.0, 0.5 * most, most, most + 1.0):
        assert made_thrust(asked, V, record) == min(asked, most)
        assert is_short(asked, V, record) == (asked > most)
    assert reach_of(record, 3, V) == (0.0, most)


def test_without_propulsion_any_thrust_is_made_at_once_and_turns_nothing(nominal: np.void) -> None:
    for V in (5.0, 45.0, 200.0):
        assert available_thrust(V, nominal) == 2000.0
        assert made_thrust(3000.0, V, nominal) == 3000.0
        assert not is_short(3000.0, V, nominal)
    assert thrust_moment(1000.0, nominal) == (0.0, 0.0, 0.0)
    assert nominal["thrust_lag"] == 0.0


def test_arms_and_lag_are_as_given(propelled: np.void) -> None:
    assert thrust_moment(200.0, propelled) == pytest.approx((-10.0, 20.0, 6.0))
    assert propelled["thrust_lag"] == 0.3


# the propeller


def balance(propeller: Propeller, V: float) -> tuple[float, float]:
    """Thrust and torque where the motor's torque, (U - KΩ)K/R - K i_0, is the propeller's."""
    K = 60.0 / (2.0 * math.pi * propeller.kv_rpm_v)
    D = propeller.diameter_m

    def of_propeller(speed: float) -> tuple[float, float]:
        n = speed / (2.0 * math.pi)
        J = V / (n * D)
        C_T = np.polyval(propeller.thrust_coefficients[::-1], J)
        C_Q = np.polyval(propeller.torque_coefficients[::-1], J)
        return float(RHO * n**2 * D**4 * C_T), float(RHO * n**2 * D**5 * C_Q)

    def excess(speed: float) -> float:
        current = (propeller.voltage_v - K * speed) / propeller.resistance_ohm
        return K * (current - propeller.no_load_current_a) - of_propeller(speed)[1]

    return of_propeller(brentq(excess, 100.0, 2000.0, xtol=1e-12))


@pytest.mark.parametrize("V", [0.0, 15.0, 25.0, 30.0, 36.0])
def test_a_propeller_turns_where_the_motor_has_its_torque(propeller: Propeller, V: float) -> None:
    found = propeller.at(V, RHO)
    assert (found.thrust_n, found.torque_n_m) == pytest.approx(balance(propeller, V), rel=1e-9)


def test_the_table_is_the_propellers(aerosonde: Aircraft, propeller: Propeller) -> None:
    """To 0.3 N: its curve is nearly straight. Beyond the airspeed without thrust there is none."""
    record = aircraft_record(aerosonde.model_copy(update={"thrust_limit_n": 1e3}))
    for V in np.linspace(0.0, 37.0, 30).tolist():
        assert available_thrust(V, record) == pytest.approx(balance(propeller, V)[0], abs=0.3)
    last = float(record["thrust_airspeeds"][-1])
    assert balance(propeller, last)[0] == pytest.approx(0.0, abs=1e-5)
    assert available_thrust(last + 20.0, record) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("turns", "sign"), [("clockwise", -1.0), ("counterclockwise", 1.0)])
def test_the_reaction_rolls_against_the_propeller(
    aerosonde: Aircraft, propeller: Propeller, turns: str, sign: float
) -> None:
    """The arm is that of full throttle at the airspeed of the design, 24 m/s amid the range."""
    changed = {"propeller": propeller.model_dump() | {"turns": turns}}
    record = aircraft_record(with_propulsion(aerosonde, changed))
    thrust, torque = balance(propeller, 24.0)
    assert record["thrust_arms"] == pytest.approx([sign * torque / thrust, 0.0, 0.0])
    given = aircraft_record(with_propulsion(aerosonde, changed | {"torque_arm_m": 0.2}))
    assert given["thrust_arms"][0] == 0.2


def test_a_propeller_that_always_pulls_has_a_table_up_to_the_models_end() -> None:
    """With a thrust coefficient that does not fall, there is thrust at any airspeed."""
    endless = Propeller(
        diameter_m=0.5, thrust_coefficients=(0.1, 0.0, 0.0),
        torque_coefficients=(0.005, 0.0, 0.0), kv_rpm_v=150.0, resistance_ohm=0.04,
        no_load_current_a=1.0, voltage_v=40.0,
    )  # fmt: skip
    rows = endless.table(RHO)
    assert rows[-1].airspeed_m_s == pytest.approx(300.0)
    assert {round(row.thrust_n, 9) for row in rows} == {round(endless.at(0.0, RHO).thrust_n, 9)}


# files


def rows(*pairs: tuple[float, float]) -> list[dict[str, float]]:
    return [{"airspeed_m_s": V, "thrust_n": T} for V, T in pairs]


@pytest.mark.parametrize(
    ("propulsion", "expected"),
    [
        (
            {"thrust": rows((20, 50), (20, 40))},
            "thrust[1].airspeed_m_s: expected > 20.0 m/s, as in the row before, got 20.0",
        ),
        ({"thrust": rows((20, 50), (30, -1))}, "thrust[1].thrust_n: expected >= 0 N, got -1"),
        ({"thrust": rows((20, 50))}, "thrust: expected 2 to 8 rows, got 1"),
        (
            {"thrust": rows(*((V, 50) for V in range(9)))},
            "thrust: expected at most 8 rows, got 9",
        ),
        ({"thrust": rows((20, 50), (30, 9)), "propeller": "aerosonde"}, "got both"),
        ({"propeller": {"thrust_coefficients": [-0.1, 0.0, 0.0]}}, "of the standing aircraft"),
        ({"propeller": {"torque_coefficients": [0.0, 0.0, 0.0]}}, "of the standing aircraft"),
        ({"propeller": {"resistance_ohm": 40.0}}, "voltage_v: expected > no_load_current_a"),
        ({"lag_s": -0.1}, "lag_s: expected [0, 10] s, got -0.1"),
    ],
)
def test_bad_input_has_one_message(
    propulsion: dict[str, Any], expected: str, aerosonde: Aircraft, propeller: Propeller
) -> None:
    if "propeller" in propulsion:
        changes = {} if propulsion["propeller"] == "aerosonde" else propulsion["propeller"]
        propulsion = propulsion | {"propeller": propeller.model_dump() | changes}
    with pytest.raises(ValidationError) as caught:
        with_propulsion(aerosonde, propulsion)
    (line,) = (str(problem) for problem in problems_of(Aircraft, caught.value))
    assert expected in line


def test_a_section_may_have_moments_alone(aerosonde: Aircraft) -> None:
    record = aircraft_record(with_propulsion(aerosonde, {"pitch_arm_m": 0.1}))
    assert available_thrust(30.0, record) == aerosonde.thrust_limit_n
    assert thrust_moment(10.0, record) == (0.0, 1.0, 0.0)
    assert Propulsion().table(RHO) == ()
