"""Fleets of several aircraft types: each UAV may have its own."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ftc_autopilot.control.diagnosis import LOST
from ftc_autopilot.guidance.path import locate
from gcs.fleet.in_process import begin, fly_in_process
from gcs.results.summary import summarise
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.config.models import ConfigError
from mavlink_defs.constants import RUDDER
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.command import InvalidParam, fault_from_params
from sitl_plant.airframe.aircraft import aircraft_record

MIXED = """
extends: airframes/aerosonde
name: Mixed
controller: {{kind: surviving}}
uncertainty: {{mass: 1.1}}
uavs:
  - id: 1
    name: leader
    initial: {{north_m: 0.0, east_m: 0.0, altitude_m: 300.0, airspeed_m_s: 22.0, pitch_deg: 4.0}}
  - id: 2
    name: wing
    aircraft: skywalker_x8
    initial: {{north_m: -20.0, east_m: -9.0, altitude_m: 300.0, airspeed_m_s: 22.0, pitch_deg: 2.0}}
  - id: 3
    name: heavy
    aircraft: {third}
    initial: {{north_m: -20.0, east_m: 20.0, altitude_m: 300.0, airspeed_m_s: 21.0, pitch_deg: 4.0}}
profile:
  - {{start_s: 0.0, airspeed_m_s: 21.5, roll_deg: 0.0, pitch_deg: 3.0, yaw_deg: 0.0}}
  - {{start_s: 2.0, airspeed_m_s: 22.0, roll_deg: 0.0, pitch_deg: 4.0, yaw_deg: 6.0}}
faults:
  - {{uav: 2, actuator: aileron, effectiveness: 0.8, start_s: 3.0}}
  - {{uav: 3, actuator: rudder, stuck_deg: -18.0, start_s: 6.0}}
duration_s: 7.0
"""
HEAVY = """
extends: aerosonde
mass_kg: 12.0
surface_limits_deg: {aileron: [-20, 15], rudder: [-20, 25]}
"""


def mixed(folder: Path, third: str = "heavy.yaml", **replaced: str) -> Scenario:
    (folder / "heavy.yaml").write_text(HEAVY)
    text = MIXED.format(third=third)
    for old, new in replaced.items():
        assert old in text
        text = text.replace(old, new)
    (folder / "mixed.yaml").write_text(text)
    return load_scenario(folder / "mixed.yaml")


def test_each_uav_has_the_aircraft_that_it_names(tmp_path: Path) -> None:
    scenario = mixed(tmp_path)
    heavy = load_aircraft(str(tmp_path / "heavy.yaml"))
    expected = [load_aircraft("aerosonde"), load_aircraft("skywalker_x8"), heavy]
    assert [scenario.aircraft_of(i) for i in (1, 2, 3)] == expected
    assert [scenario.autopilot_config(i).aircraft for i in (1, 2, 3)] == expected
    flown = [uav.aircraft for uav in scenario.plant_config().uavs]
    assert [one.mass_kg for one in flown] == [1.1 * one.mass_kg for one in expected]
    assert [one.stops_deg for one in flown] == [one.stops_deg for one in expected]
    flight = begin(scenario)
    for i, one in enumerate(expected):
        assert flight.controllers.uavs[i]["aircraft"] == aircraft_record(one)
    assert [scenario.planner(i).airspeeds.max_m_s for i in (1, 2)] == [30.0, 24.0]


def test_an_aircraft_may_be_a_section_of_its_own(tmp_path: Path) -> None:
    whole = load_aircraft("skywalker_x8").model_dump() | {"mass_kg": 4.0}
    tree = mixed(tmp_path).model_dump()
    tree["uavs"][1]["aircraft"] = whole
    assert scenario_of("x", tree).aircraft_of(2).mass_kg == 4.0


def test_what_is_stored_of_a_mixed_fleet_can_be_read_again(tmp_path: Path) -> None:
    scenario = mixed(tmp_path)
    assert scenario_of("x", scenario.model_dump()) == scenario


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "trigger"), [("surviving", "per_channel"), ("tube", "consequence")]
)
def test_three_types_fly_in_one_formation(tmp_path: Path, law: str, trigger: str) -> None:
    scenario = mixed(tmp_path)
    tree = scenario.model_dump()
    tree |= {"controller": {"kind": law}, "trigger": {"mode": trigger}}
    flight = fly_in_process(scenario_of("x", tree))
    assert flight.loss is None
    errors = np.degrees(np.abs(flight.error("reference")[1000:6000, :, 1:]))
    assert np.all(errors[..., :2].max(axis=(0, 1)) < (4.5, 2.5))
    applied = np.degrees(flight.applied)
    for i, uav in enumerate((1, 2, 3)):
        for c, (low, high) in enumerate(scenario.aircraft_of(uav).stops_deg):
            assert low - 1e-9 <= applied[:, i, c].min()
            assert applied[:, i, c].max() <= high + 1e-9
    assert np.all(applied[6100:, 2, RUDDER] == pytest.approx(-18.0))
    events = flight.signals["events"] >> RUDDER & 1
    assert events.any(axis=0).tolist() == [True, False, True]


def test_faults_are_checked_against_the_own_aircraft(tmp_path: Path) -> None:
    scenario = mixed(tmp_path)
    limits = [scenario.aircraft_of(i).fault_limits for i in (1, 2, 3)]
    stuck = (0, 0.0, 18.0, 0.0, np.nan, np.nan, 0.0)
    assert fault_from_params(ACTUATOR_FAULTS, stuck, limits[0]).value == 18.0
    with pytest.raises(InvalidParam, match="must be -20 to 15 deg"):
        fault_from_params(ACTUATOR_FAULTS, stuck, limits[2])


@pytest.mark.parametrize(
    ("replaced", "said"),
    [
        ({"kind: surviving": "kind: backstepping"}, "uavs[1].aircraft: controller.kind: expected"),
        ({"stuck_deg: -18.0": "stuck_deg: -21.0"}, "faults[1].stuck_deg: expected [-20, 25] deg"),
        ({"actuator: aileron": "actuator: rudder"}, "faults[0].actuator: the aircraft has no rud"),
        ({"airspeed_m_s: 22.0, roll": "airspeed_m_s: 25.0, roll"}, "expected [18, 24] m/s"),
        ({"22.0, pitch_deg: 2.0": "25.0, pitch_deg: 2.0"}, "expected [14, 24] m/s"),
        ({"aircraft: heavy.yaml": "aircraft: heavi.yaml"}, "uavs[2].aircraft: "),
        ({"aircraft: skywalker_x8": "aircraft: skywalker_x9"}, "did you mean 'skywalker_x8'"),
        ({"aircraft: heavy.yaml": "aircraft: {mass_kg: 3}"}, "uavs[2].aircraft.wing_area_m2: miss"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, replaced: Any, said: str) -> None:
    with pytest.raises(ConfigError) as refused:
        mixed(tmp_path, **replaced)
    assert said in str(refused.value)


def test_an_error_in_the_file_of_one_uav_is_told_by_its_line(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("extends: aerosonde\nmass_kg: -3\n")
    with pytest.raises(ConfigError, match=r"bad\.yaml:2: uavs\[2\]\.aircraft\.mass_kg: expected"):
        mixed(tmp_path, "bad.yaml")


@pytest.mark.slow
@pytest.mark.parametrize(("law", "mode"), [("surviving", "per_channel"), ("tube", "consequence")])
def test_three_types_fly_a_mission_in_wind_within_one_and_a_half_spans(
    tmp_path: Path, law: str, mode: str
) -> None:
    """Half of the hexagon, in V formation, in a wind of 5 m/s; 20 s to settle."""
    scenario = mixed(tmp_path)
    tree = scenario_tree("missions/hexagon") | {
        "aircraft": scenario.aircraft.model_dump(),
        "controller": {"kind": law},
        "trigger": {"mode": mode},
        "guidance": {"cruise_m_s": 21.0, "airspeed_min_m_s": 18.5, "airspeed_max_m_s": 23.5},
        "wind": {"steady": {"north_m_s": 3.0, "east_m_s": -4.0}},
        "duration_s": 100.0,
    }
    for uav, own in zip(tree["uavs"], (1, 2, 3), strict=True):
        uav["aircraft"] = scenario.aircraft_of(own).model_dump()
        uav["initial"] |= {"airspeed_m_s": 21.0, "pitch_deg": 3.0}
    flown = scenario_of("mission", tree)
    flight = fly_in_process(flown)
    assert flight.loss is None
    assert not (flight.signals["phase"] == LOST).any()
    path = flown.planner().path(flown.mission_items())
    places = flight.states[::100, :, :3]
    for i, right_m in enumerate((0.0, 20.0, -20.0)):
        near, away = 0.0, []
        for north, east, _ in places[:, i]:
            near, right = locate(path, north, east, near)
            away.append(right - right_m)
        span = flown.aircraft_of(i + 1).wing_span_m
        assert np.abs(away[200:]).max() < 1.5 * span
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
    assert apart[:, ~np.eye(3, dtype=bool)].min() > 15.0


@pytest.mark.slow
@pytest.mark.skipif(find_spec("jsbsim") is None, reason="jsbsim is missing: pip install jsbsim")
@pytest.mark.parametrize("addition", [[], ["tube"]])
def test_the_bundled_mission_of_three_types_is_flown_within_a_span(addition: list[str]) -> None:
    """One of them by JSBSim; docs/explanation/airframes.md has the figures of the whole flight."""
    tree = scenario_tree("airframes/mixed_mission")
    for name in addition:
        tree = merged(tree, scenario_tree(name))
    scenario = scenario_of("mixed", tree | {"duration_s": 100.0})
    summary = summarise(fly_in_process(scenario), scenario)
    assert summary.completed
    for uav in summary.uavs:
        assert uav.path is not None
        errors = uav.path.straight_cross_track_m, uav.path.turn_cross_track_m
        assert (
            max(error for error in errors if error is not None)
            < scenario.aircraft_of(uav.id).wing_span_m
        )
        assert not uav.diagnosis
    assert summary.separation is not None
    assert summary.separation.least_m > 15.0


def test_savings_count_the_channels_that_there_are(tmp_path: Path) -> None:
    scenario = mixed(tmp_path).model_copy(update={"duration_s": 0.5})
    summary = summarise(fly_in_process(scenario), scenario)
    for uav, channels in zip(summary.uavs, (4, 3, 4), strict=True):
        assert uav.saving == 1.0 - uav.events / (500 * channels)
    assert summary.saving == 1.0 - sum(uav.events for uav in summary.uavs) / (500 * 11)
