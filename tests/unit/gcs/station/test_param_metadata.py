"""Defaults of parameters: what a vehicle has whose scenario says nothing, and what differs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.triggers import MODES
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.vehicle.param_table import parameters_of
from gcs.scenario.model import Scenario
from gcs.station.param_file import READ_ONLY
from gcs.station.param_metadata import defaults_of, differs
from mavlink_defs import dialect
from mavlink_defs.float32 import decimal_of_float32, float32s
from mavlink_defs.services.param import Param

_OF_THE_AIRCRAFT = {
    "DIAG_SERVO_LAG_S",
    "DIAG_THR_LAG_S",
    "DI_SE_RA_LI_DE_S",
    "DI_THR_DEA_TIM_S",
    "PREDICTED_LAG_S",
}
"""What a law takes from the aircraft's servos if its own key is left out."""

_PAIRS = [(law, mode) for law in LAWS for mode in MODES if LAWS[law].goes_with(mode)]


def held_by(scenario: Scenario, **keys: Any) -> tuple[Param, ...]:
    """Return the parameters of a vehicle with these keys, as they come over the wire."""
    given = {"formation": {"slots": {2: {}}}, "guidance": {"kind": "path"}} | keys
    tree = scenario.autopilot_config(2).model_dump() | given
    config = AutopilotConfig.model_validate(tree)
    autopilots = new_autopilots([config])
    found = parameters_of(config, HotState(autopilots), autopilots.controllers)
    return tuple(Param(p.name, decimal_of_float32(p.get()), p.type) for p in found)


@pytest.mark.parametrize(("law", "mode"), _PAIRS)
def test_of_a_scenario_that_says_nothing_only_what_it_has_to_say_differs(
    scenario1: Scenario, law: str, mode: str
) -> None:
    params = held_by(scenario1, controller={"kind": law}, trigger={"mode": mode})
    defaults = defaults_of(params)
    said = {"TRIG_MODE"} if mode != LAWS[law].TRIGGER else set()
    assert {p.name for p in params if differs(p, defaults)} == said
    assert {p.name for p in params} - defaults.keys() - READ_ONLY <= _OF_THE_AIRCRAFT


@pytest.mark.parametrize("law", LAWS)
def test_whatever_is_changed_differs(scenario1: Scenario, law: str) -> None:
    mode = "consequence" if LAWS[law].SELECTS_CHANNELS else "per_channel"
    params = held_by(scenario1, controller={"kind": law}, trigger={"mode": mode})
    defaults = defaults_of(params)
    assert len(defaults) > 40
    for param in params:
        last = float32s([param.value])[0]
        following = float(np.nextafter(np.float32(last), np.float32(np.inf)))
        assert differs(replace(param, value=following), defaults) == (param.name in defaults)


def test_every_value_of_a_default_schedule_is_its_default(scenario1: Scenario) -> None:
    params = held_by(scenario1, controller={"kind": "proposed"})
    k1 = next(param for param in params if param.name == "K1_ROLL")
    defaults = defaults_of(params)
    assert defaults["K1_ROLL"] == tuple(value[0] for _, value in Proposed().K1.windows())
    assert len(defaults["K1_ROLL"]) > 1
    assert not [v for v in defaults["K1_ROLL"] if differs(replace(k1, value=v), defaults)]


def test_of_a_foreign_vehicle_nothing_is_known(scenario1: Scenario) -> None:
    params = held_by(scenario1, controller={"kind": "pid"})
    for law in (None, -1.0, 0.5, float(len(LAWS)), 1e9):
        foreign = [p for p in params if p.name != "CTRL_LAW"]
        if law is not None:
            foreign.append(Param("CTRL_LAW", law, dialect.MAV_PARAM_TYPE_INT32))
        assert defaults_of(foreign) == {}
        assert not any(differs(param, {}) for param in foreign)
