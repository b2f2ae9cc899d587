"""Laws beside the paper's, chosen by name, and the records that they are given."""

import math
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field
from steps import step_alone

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.common.schedule import Schedule, schedule
from ftc_autopilot.control.controller import CONTROLLER, new_controller, parameter_record
from ftc_autopilot.control.inversion import surfaces_for
from ftc_autopilot.control.laws import KINDS, LAWS
from ftc_autopilot.control.laws.backstepping import Backstepping
from ftc_autopilot.control.laws.pid import Pid
from ftc_autopilot.control.triggers import MODES
from ftc_autopilot.control.triggers.periodic import Periodic
from gcs.fleet.in_process import fly_in_process
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.config.models import ConfigError, Model
from mavlink_defs.framing.codec import ACTUATORS, SIM_STATE
from sitl_plant.airframe.rigid_body import R2, R2_inv, angular_acceleration, gravity_body
from sitl_plant.vec3 import Vec3, mat3

DT = 1e-3
angle = st.floats(-0.5, 0.5)
rate = st.floats(-1.0, 1.0)


class Pilot:
    """One law, one aircraft, no neighbours."""

    def __init__(self, law: Backstepping | Pid, nominal: np.void) -> None:
        self.nominal = nominal
        self.parameters = parameter_record(law, Periodic())
        self.state = new_controller()

    def step(self, phi: Vec3, omega: Vec3 = (0.0, 0.0, 0.0), V: float = 45.0) -> np.void:
        """One step towards level flight at 45 m/s; gives the signals."""
        message = np.zeros(1, SIM_STATE)[0]
        message["velocity"] = (V, 0.0, 0.0)
        message["attitude"], message["rates"] = phi, omega
        message["specific_force"] = -np.array(gravity_body(phi, self.nominal["g"]))
        self.motion = motion_of(message, self.nominal)
        level, actuators = (45.0, 0.0, 0.0, 0.0), np.zeros(1, ACTUATORS)[0]
        return step_alone(self.motion, level, self.nominal, self.parameters, self.state, actuators)


@given(st.tuples(rate, rate, rate))
def test_surfaces_make_the_desired_moment(
    nominal: np.void, moment: tuple[float, float, float]
) -> None:
    C = motion_of(_straight(), nominal).air.C
    assert np.allclose(np.array(C) @ surfaces_for(moment, C), moment, atol=1e-12)


def _straight() -> np.void:
    message: np.void = np.zeros(1, SIM_STATE)[0]
    message["velocity"] = (45.0, 1.0, 2.0)
    return message


@given(st.tuples(angle, angle, angle), st.tuples(rate, rate, rate), st.floats(30.0, 60.0))
def test_backstepping_inverts_the_nominal_model(
    nominal: np.void, phi: Vec3, omega: Vec3, V: float
) -> None:
    law = Backstepping(K1=(3.0, 4.0, 5.0), K2=(6.0, 7.0, 8.0))
    pilot = Pilot(law, nominal)
    signals = pilot.step(phi, omega, V)
    air, e = pilot.motion.air, np.array(phi)
    J, J_inv = mat3(nominal["J"]), mat3(nominal["J_inv"])

    e_prime = law.lambda3 * e
    omega_d = np.array(R2(phi)) @ (-np.array([3.0, 4.0, 5.0]) * e_prime / law.lambda3)
    moment = np.array(air.N) + np.array(air.C) @ signals["demand"][:3]
    omega_dot = np.array(angular_acceleration(omega, tuple(moment), J, J_inv))
    desired = -np.array([6.0, 7.0, 8.0]) * (np.array(omega) - omega_d)
    desired -= law.lambda3 * np.array(R2_inv(phi)).T @ e_prime  # ω̇_d = 0 in the first step
    assert np.allclose(omega_dot, desired, atol=1e-9)

    force = np.add(air.F, (signals["demand"][3], 0.0, 0.0))
    gravity = np.array(pilot.motion.gravity)
    V_dot = np.array(pilot.motion.v) @ (force / nominal["m"] + gravity) / V
    assert V_dot == pytest.approx(-law.c_v * (V - 45.0), abs=1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_pid_turns_against_the_error(nominal: np.void, axis: int) -> None:
    error: Any = [0.0, 0.0, 0.0]
    error[axis] = 0.1
    demand = Pilot(Pid(), nominal).step(tuple(error))["demand"][:3]
    assert demand[axis] > 0.01  # a positive deflection makes a negative moment
    assert abs(demand[axis]) == max(abs(demand))


def test_pid_asks_of_each_axis_what_its_own_time_constant_says(nominal: np.void) -> None:
    """Without gains on the errors of the rates, deflections are shares of the rates asked for."""
    none = (0.0, 0.0, 0.0)
    law = Pid(time_constant_s=(0.5, 1.0, 2.0), rate_p=none, rate_i=none, rate_ff=(1.0, 1.0, 1.0))
    phi = (0.02, 0.03, 0.05)
    asked = np.array(R2(phi)) @ -np.divide(phi, (0.5, 1.0, 2.0))
    assert Pilot(law, nominal).step(phi)["demand"][:3] == pytest.approx(-asked)


def test_pid_gives_thrust_to_be_faster(nominal: np.void) -> None:
    slow, fast = (Pilot(Pid(), nominal).step((0.0, 0.0, 0.0), V=V)["demand"][3] for V in (44, 46))
    assert slow == pytest.approx(900.0 + 206.0)
    assert fast == pytest.approx(900.0 - 206.0)


@pytest.mark.parametrize("phi", [0.02, 0.5])
def test_pid_does_not_wind_up(nominal: np.void, phi: float) -> None:
    pilot = Pilot(Pid(integral_limit_deg=(5.0, 5.0, 5.0)), nominal)
    for _ in range(2000):
        pilot.step((phi, 0.0, 0.0), V=3.5)  # far too slow: both at their limits
    integral = pilot.state["pid"]["integral"][0]
    assert abs(integral) <= math.radians(5.0) * (1.0 + 1e-12)
    thrust = pilot.state["pid"]["thrust_integral"]
    assert thrust <= nominal["thrust_limit"] + 1.0


def test_pid_holds_the_trim_of_every_surface(scenario1: Scenario) -> None:
    tree = scenario1.model_dump() | {"faults": (), "controller": {"kind": "pid"}}
    flight = fly_in_process(Scenario.model_validate(tree))
    last = np.abs(np.degrees(flight.signals["error"][-1000:, :, 1:])).max(axis=(0, 1))
    assert np.degrees(np.abs(flight.signals["held"][-1, :, 2])).max() > 20.0
    assert max(last) < 0.1


@pytest.mark.parametrize(
    ("kind", "mode"),
    [(kind, mode) for kind in KINDS for mode in MODES if LAWS[kind].goes_with(mode)],
)
def test_every_law_flies_with_every_trigger(scenario1: Scenario, kind: str, mode: str) -> None:
    tree = scenario1.model_dump() | {"duration_s": 1.0, "faults": ()}
    short = {"self": {"longest_s": 0.006}, "scaled": {"within_s": 0.004}}  # for the paper's law
    trigger = {"mode": mode} | short.get(mode, {})
    tree |= {"controller": {"kind": kind}, "trigger": trigger}
    flight = fly_in_process(Scenario.model_validate(tree))
    assert flight.loss is None
    errors = np.abs(flight.signals["error"][500:])
    assert errors[..., 0].max() < 1.5  # m/s
    assert np.degrees(errors[..., 1:]).max() < 2.0
    sent = [(flight.signals["events"] >> c & 1).sum(axis=0) for c in range(4)]
    if mode == "periodic":
        assert np.all(np.array(sent) == 1000)
    else:
        assert np.all(np.array(sent) < 900)
    if mode == "joint":
        assert np.array_equal(sent[0], sent[1])


def test_a_law_brings_its_trigger_where_none_is_named(scenario1: Scenario) -> None:
    own = {"surviving": "scaled", "tube": "consequence"}
    given: list[dict[str, Any]] = [{}, {"trigger": {}}, {"trigger": {"b2_deg": 2.0}}]
    for kind in KINDS:
        tree = scenario1.model_dump() | {"controller": {"kind": kind}}
        del tree["trigger"]
        for keys in given:
            scenario = Scenario.model_validate(tree | keys)
            assert scenario.trigger.mode == own.get(kind, "per_channel")
            expected = 2.0 if "b2_deg" in keys.get("trigger", {}) else 1.0
            assert {value for _, value in scenario.trigger.b2_deg.windows()} == {expected}
            assert scenario.autopilot_config(2).trigger == scenario.trigger
            changed = with_changes(scenario, values={"controller": {"kind": "tube"}})
            assert changed.trigger.mode == "consequence", "of the law that came"
        named = tree | {"trigger": {"mode": "periodic"}}
        assert Scenario.model_validate(named).trigger.mode == "periodic"


def test_a_trigger_of_a_law_that_is_none_is_the_laws_mistake(
    scenario1: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LAWS["surviving"], "TRIGGER", "nope")
    tree = scenario1.model_dump() | {"controller": {"kind": "surviving"}}
    del tree["trigger"]
    why = "trigger: expected TRIGGER of the law 'surviving' to be a plug-in or .*, got 'nope'; mend"
    with pytest.raises(ConfigError, match=why):
        scenario_of("mine", tree)
    assert scenario_of("mine", tree | {"trigger": {"mode": "joint"}}).trigger.mode == "joint"


def test_laws_go_by_the_name_in_their_kind() -> None:
    assert KINDS[0] == "proposed"
    law: Any
    for kind, law in LAWS.items():
        assert law().kind == kind
        assert CONTROLLER[kind] == law.STATE


class Inner(Model):
    count: int = 3


class Numbers(Model):
    kind: Literal["numbers"] = "numbers"
    gain: float = 1.5
    choice: Literal["a", "b", "c"] = "b"
    axes: tuple[float, float, float] = (1.0, 2.0, 3.0)
    course: Schedule[float] = schedule(
        [{"until_s": 2.0, "value": 7.0}, {"value": 8.0}], doc="Course."
    )
    inner: Inner = Inner()


def test_a_record_holds_what_a_model_says() -> None:
    record = np.zeros(1, record_dtype(Numbers))[0]
    fill(record, Numbers())
    assert record.dtype.names == ("gain", "choice", "axes", "course", "inner")
    assert (record["gain"], record["choice"], record["inner"]["count"]) == (1.5, 1, 3)
    assert list(record["axes"]) == [1.0, 2.0, 3.0]
    assert record["course"][0].tolist() == [2.0, 7.0, 7.0, 7.0]
    assert record["course"][1, 1] == 8.0


def test_a_parameter_that_no_record_can_hold_is_refused() -> None:
    class Wrong(Model):
        names: list[str] = Field(default=[])

    with pytest.raises(TypeError, match="parameter of type list"):
        record_dtype(Wrong)


def test_the_limit_of_the_virtual_control_binds_only_beyond_it(scenario1: Scenario) -> None:
    """At 60 deg/s the paper's flight is the same bit for bit; at 5 deg/s it is not."""

    def flown(limit: float) -> np.ndarray:
        law = scenario1.controller.model_copy(update={"omega_d_limit_deg_s": limit})
        changes = {"controller": law, "duration_s": 6.0}
        return fly_in_process(scenario1.model_copy(update=changes)).signals

    free, wide, narrow = flown(0.0), flown(60.0), flown(5.0)
    assert free.tobytes() == wide.tobytes()
    assert np.abs(np.degrees(free["omega_d"])).max() > 6.0
    assert np.degrees(np.abs(narrow["omega_d"]).max(axis=(0, 1))) == pytest.approx([5.0] * 3)
