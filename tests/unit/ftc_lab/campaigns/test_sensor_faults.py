"""Sensor faults that a campaign draws."""

from pathlib import Path
from typing import Any

import pytest
from campaign_flights import write_campaign
from pydantic import ValidationError

from ftc_lab.campaigns.faults import DrawnSensorFault
from ftc_lab.campaigns.plan import Plan, load_plan, rows_of
from gcs.scenario.bundled import SCENARIOS
from mavlink_defs.config.files import problems_of
from mavlink_defs.faults.fault import Fault

ONE = {"kind": "choice", "values": [5.0]}
DRAWN = {"uavs": [3], "sensors": ["gyro"], "instances": [1, 2], "kinds": {}, "start_s": ONE}


def planned(tmp_path: Path, fault: dict[str, Any], draws: int = 40) -> Plan:
    variants = {"v": {"navigation": "estimated", "faults": []}}
    changes = {"factors": {}, "faults": {"f": DRAWN | fault}, "variants": variants}
    return load_plan(write_campaign(tmp_path, draws=draws, **changes))


def faults_of(plan: Plan) -> list[Fault]:
    found = []
    for row in rows_of(plan.draws):
        ((uav, fault),) = plan.flights.scenario(row).fault_commands()
        assert uav == 3
        found.append(fault)
    return found


def test_every_part_is_drawn(tmp_path: Path) -> None:
    kinds = {"off": None, "bias": {"kind": "uniform", "low": -3.0, "high": 3.0}, "noise": None}
    lasts = {"kind": "choice", "values": [2.0]}
    found = faults_of(planned(tmp_path, {"kinds": kinds, "lasts_s": lasts}))
    assert {fault.kind.name for fault in found} == {"off", "bias", "noise"}
    assert {fault.instance for fault in found} == {1, 2}
    assert {(fault.start_s, fault.end_s) for fault in found} == {(5.0, 7.0)}
    biases = [fault.value for fault in found if fault.kind.name == "bias"]
    assert len(set(biases)) == len(biases) > 5
    assert -3.0 <= min(biases) < 0.0 < max(biases) <= 3.0
    assert {fault.value for fault in found if fault.kind.name == "noise"} == {10.0}


def test_sensors_of_unlike_units_share_kinds_without_one(tmp_path: Path) -> None:
    kinds = {"stuck": None, "slow": {"kind": "choice", "values": [5, 20]}, "intermittent": None}
    drawn = {"sensors": ["gps", "airspeed", "barometer"], "instances": [0], "kinds": kinds}
    found = faults_of(planned(tmp_path, drawn))
    assert {fault.target.name for fault in found} == {"gps", "airspeed", "barometer"}
    assert {fault.value for fault in found if fault.kind.name == "slow"} == {5.0, 20.0}


def test_the_bundled_campaign_is_a_plan() -> None:
    plan = load_plan(SCENARIOS / "campaigns" / "sensor_faults.yaml", draws=60)
    assert len({fault.target.name for fault in faults_of(plan)}) == 6


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        (
            {"sensors": ["gyro", "gps"], "instances": [0], "kinds": {"bias": ONE}},
            "kinds.bias: expected sensors of one unit with a value, got deg/s, m",
        ),
        ({"kinds": {"off": ONE}}, "kinds.off: expected null, as it has no value"),
        (
            {"kinds": {"delayed": ONE}},
            "kinds.delayed: draws 5.0, expected within [0, 1] s",
        ),
        (
            {"sensors": ["gps"], "instances": [0], "kinds": {"scale": ONE}},
            "sensors[0]: gps has no scale",
        ),
        (
            {"sensors": ["gps"], "kinds": {"off": None}},
            "instances: expected 0 or 1, as there is one sensor of gps",
        ),
        (
            {"kinds": {"off": None}, "instances": [1, 1]},
            "instances[1]: expected each only once, got 1 again",
        ),
    ],
)
def test_what_cannot_be_drawn_is_refused(keys: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError) as caught:
        DrawnSensorFault.model_validate(DRAWN | keys)
    assert [str(one) for one in problems_of(DrawnSensorFault, caught.value)] == [problem]
