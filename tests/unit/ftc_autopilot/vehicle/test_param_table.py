"""Parameters of a vehicle: what there is, and that compiled code flies what is set."""

import math
import re

import numpy as np
import pytest

from ftc_autopilot.common.schedule import scheduled
from ftc_autopilot.control.controllers import NOT_STARTED
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.vehicle.param_table import parameters_of
from gcs.scenario.model import Scenario
from gcs.station.param_metadata import known_quantity
from mavlink_defs import dialect
from mavlink_defs.services.param import MAX_NAME
from mavlink_defs.services.param_server import (
    INT32,
    REAL32,
    Parameter,
    ParamValueError,
)


class Bench:
    def __init__(self, scenario: Scenario) -> None:
        config = scenario.autopilot_config(2)
        autopilots = new_autopilots([config])
        self.controllers, self.hot = autopilots.controllers, HotState(autopilots)
        found = parameters_of(config, self.hot, self.controllers)
        self.parameters = {parameter.name: parameter for parameter in found}

    def __getitem__(self, name: str) -> Parameter:
        return self.parameters[name]

    def set(self, name: str, value: float) -> None:
        put = self[name].set
        assert put is not None
        put(value)


@pytest.fixture
def bench(scenario1: Scenario) -> Bench:
    return Bench(scenario1)


@pytest.mark.parametrize("kind", LAWS)
def test_names_fit_and_values_are_the_configurations(scenario1: Scenario, kind: str) -> None:
    tree = scenario1.model_dump() | {"controller": {"kind": kind}}
    if LAWS[kind].SELECTS_CHANNELS:
        tree["trigger"] = {"mode": "consequence"}
    bench = Bench(Scenario.model_validate(tree))
    for name, parameter in bench.parameters.items():
        assert re.fullmatch(rf"[A-Z][A-Z0-9_]{{0,{MAX_NAME - 1}}}", name)
        value = parameter.get()
        if parameter.set is not None:
            parameter.set(value)  # the value in force is a good one
        assert parameter.get() == value
        if parameter.type == INT32:
            assert value == int(value)
    assert bench["CTRL_LAW"].get() == list(LAWS).index(kind)


def test_the_papers_parameters_are_there(bench: Bench) -> None:
    expected = {
        "LAMBDA1": 0.46,
        "K1_ROLL": 50.0,
        "K2_YAW": 51.0,
        "TRIG_B2_DEG": 1.0,
        "TRIG_A2_N": 0.5,
        "REF_BANDWIDTH": 2.5,
        "RBF_NEURONS": 15,
    }
    assert {name: bench[name].get() for name in expected} == expected
    types = {bench[name].type for name in ("TRIG_MODE", "RBF_NEURONS", "SYSID_THISMAV")}
    assert types == {INT32}
    assert bench["K1_ROLL"].type == REAL32


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("K1_ROLL", 0.0, "is 0, must be in (0, 500] 1/s"),
        ("K1_ROLL", 1e30, "is 1e+30, must be in (0, 500] 1/s"),
        ("LAMBDA3", 50.5, "is 50.5, must be in (0, 50]"),
        ("TRIG_A1", 1.0, "is 1, must be in [0, 1)"),
        ("TRIG_MODE", 8, "is 8, must be in [0, 7]"),
        ("TRIG_MODE", 6, "is 6, which does not go with the law proposed"),
        ("RBF_NEURONS", 65, "is 65, must be in [1, 64]"),
    ],
)
def test_a_value_out_of_range_is_refused(bench: Bench, name: str, value: float, text: str) -> None:
    before = bench.controllers.uavs["parameters"].copy()
    with pytest.raises(ParamValueError) as refusal:
        bench.set(name, value)
    assert refusal.value.text == text
    assert bench.controllers.uavs["parameters"] == before


@pytest.mark.parametrize("kind", LAWS)
def test_every_parameter_has_bounds_that_stations_show(scenario1: Scenario, kind: str) -> None:
    tree = scenario1.model_dump() | {"controller": {"kind": kind}}
    if LAWS[kind].SELECTS_CHANNELS:
        tree["trigger"] = {"mode": "consequence"}
    bench = Bench(Scenario.model_validate(tree))
    for name, parameter in bench.parameters.items():
        if parameter.set is None or name in {"TRIG_MODE", "PHI_V0"}:
            continue
        known, before = known_quantity(name), parameter.get()
        assert known is not None
        for beyond in (1e30, -1e30):
            with pytest.raises(ParamValueError, match=re.escape(known.range())):
                parameter.set(beyond)
        assert parameter.get() == before


def test_the_value_of_a_scenario_is_within_the_bounds(scenario1: Scenario) -> None:
    tree = scenario1.model_dump()
    tree["trigger"] |= {"b2_deg": 25.0}
    bench = Bench(Scenario.model_validate(tree))
    bench.set("TRIG_B2_DEG", 25.0)
    with pytest.raises(ParamValueError, match=re.escape("must be in [0, 25] deg")):
        bench.set("TRIG_B2_DEG", 25.5)


def test_what_is_set_is_flown(bench: Bench) -> None:
    record = bench.controllers.uavs[0]["parameters"]
    bench.set("LAMBDA3", 4.0)
    bench.set("TRIG_MODE", 1)
    assert (record["common"]["lambda3"], record["mode"]) == (4.0, 1)


@pytest.mark.parametrize("value", [0.0, 0.1, 0.7, 1.1, 9.3, float(np.float32(0.3)), 10.0])
def test_an_angle_is_set_in_degrees_and_flown_in_radians(bench: Bench, value: float) -> None:
    table = bench.controllers.uavs[0]["parameters"]["trigger"]["b2_rad"]
    bench.set("TRIG_B2_DEG", value)
    assert scheduled(table, 99.0)[0] == value * math.radians(1.0)
    assert np.float32(bench["TRIG_B2_DEG"].get()) == np.float32(value)
    assert bench["TRIG_B2_DEG"].get() == pytest.approx(value, rel=1e-14)


def test_a_schedule_is_read_as_it_is_now_and_set_for_good(bench: Bench) -> None:
    table = bench.controllers.uavs[0]["parameters"]["trigger"]["a2_n"]
    bench.controllers.uavs[0]["guidance"]["start_step"] = 1000
    bench.hot.step = 16_000
    assert bench["TRIG_A2_N"].get() == 1.0  # from 14 s on
    bench.controllers.uavs[0]["guidance"]["start_step"] = NOT_STARTED
    assert bench["TRIG_A2_N"].get() == 0.5
    bench.set("TRIG_A2_N", 2.0)
    assert [scheduled(table, t)[0] for t in (0.0, 14.0, 99.0)] == [2.0] * 3


def test_one_axis_is_set_and_the_others_keep_their_schedule(bench: Bench) -> None:
    table = bench.controllers.uavs[0]["parameters"]["proposed"]["K1"]
    bench.set("K1_PITCH", 30.0)
    assert scheduled(table, 0.0) == (50.0, 30.0, 51.0)
    assert scheduled(table, 99.0) == (40.0, 30.0, 40.0)


def test_initial_values_can_be_set_until_the_law_has_read_them(bench: Bench) -> None:
    bench.set("BETA_V0", 2.0)
    assert bench.controllers.uavs[0]["parameters"]["proposed"]["beta_v0"] == 2.0
    bench.controllers.uavs[0]["controller"]["steps"] = 1
    with pytest.raises(ParamValueError) as refusal:
        bench.set("BETA_V0", 3.0)
    assert refusal.value.error == dialect.MAV_PARAM_ERROR_READ_ONLY


def test_what_identifies_a_vehicle_cannot_be_set(bench: Bench) -> None:
    for name in ("SYSID_THISMAV", "MAV_TYPE", "MAV_AUTOPILOT", "CTRL_LAW", "STEP_US"):
        assert bench[name].set is None
    assert bench["SYSID_THISMAV"].get() == 2
