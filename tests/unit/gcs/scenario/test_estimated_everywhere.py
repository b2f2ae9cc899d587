"""Everything that is bundled flies by sensors by itself, with any addition and control period."""

from pathlib import Path
from typing import Any

import pytest

from benchmarks.sensor_flights import errors_of, watched
from gcs.fleet.remarks import remarks_of
from gcs.scenario.bundled import bundled_names
from gcs.scenario.changes import with_changes
from gcs.scenario.model import load_scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import OF_TRUE_STATE, merged
from mavlink_defs.config.models import ConfigError
from sitl_plant.sensing.config import Sensors

ON_THE_GROUND = "runway/"  # where flights by sensors do not begin
SCENARIOS = [n for n in bundled_names() if not n.startswith(("campaigns/", ON_THE_GROUND))]
ADDITIONS = [
    ["estimated"],
    ["estimated", "cheap_imu"],
    ["estimated", "realistic"],
    ["realistic", "estimated"],
    ["estimated", "turbulent"],
    ["turbulent", "estimated"],
]
STEPS_US = 1000, 2000, 2500, 4000, 5000, 8000, 10_000
GYRO = "sensors: {gyro_deg_s: {noise_rms: 0.5}}\n"
REFUSED = "sensors.gyro_deg_s: is of the true state, and the flight is by an estimated one"


@pytest.mark.parametrize("additions", ADDITIONS, ids="+".join)
def test_all_that_is_bundled_can_be_flown_by_sensors(additions: list[str]) -> None:
    for name in SCENARIOS:
        scenario = with_changes(name, additions)
        assert scenario.navigation == "estimated"
        assert scenario.sensors.exact
        servos = with_changes(name, [one for one in additions if one != "estimated"]).servos
        assert scenario.servos == servos


def test_the_sections_that_are_left_out_are_all_of_the_true_state() -> None:
    assert tuple(Sensors().of_true_state) == OF_TRUE_STATE


def test_a_setting_a_variant_and_a_file_that_extends_leave_them_out_as_well(tmp_path: Path) -> None:
    designed, values = "airframes/aerosonde_designed", {"navigation": "estimated"}
    (tmp_path / "mine.yaml").write_text(f"extends: {designed}\nnavigation: estimated\n")
    variant = merged(scenario_tree(designed), values)
    assert scenario_of(designed, variant).sensors.exact
    assert load_scenario(tmp_path / "mine.yaml").sensors.exact
    assert with_changes(designed, (), values).sensors.exact
    assert with_changes(load_scenario(designed), (), values).sensors.exact
    assert not load_scenario(designed).sensors.exact


@pytest.mark.parametrize(
    "text",
    [
        f"extends: paper/scenario1\nnavigation: estimated\n{GYRO}",
        f"extends: [paper/scenario1, estimated]\n{GYRO}",
        f"extends: [paper/scenario1, realistic, estimated]\n{GYRO}",
    ],
)
def test_a_file_that_has_both_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(ConfigError, match=rf"mine\.yaml:\d: {REFUSED}"):
        load_scenario(tmp_path / "mine.yaml")


def test_errors_of_the_true_state_that_are_set_for_this_flight_are_refused() -> None:
    values = {"sensors.gyro_deg_s.noise_rms": 0.5}
    with pytest.raises(ConfigError, match=REFUSED):
        with_changes("paper/scenario1", ["estimated"], values)
    with pytest.raises(ConfigError, match=REFUSED):
        with_changes("paper/scenario1", (), {"navigation": "estimated", **values})


@pytest.mark.parametrize("step_us", [*STEPS_US, 1234, 3000, 7000])
def test_any_control_period_is_accepted(step_us: int) -> None:
    scenario = with_changes("missions/hexagon", ["estimated"], {"step_us": step_us})
    assert scenario_of("itself", scenario.model_dump()) == scenario


def test_a_default_rate_that_becomes_a_different_one_is_remarked() -> None:
    scenario = with_changes("paper/scenario1", ["estimated"], {"step_us": 4000})
    assert remarks_of(scenario) == [
        f"sensors.navigation.{sensor}.rate_hz: 125 Hz in place of 100, the nearest that control "
        "periods of 4000 us allow"
        for sensor in ("magnetometer", "pitot")
    ]
    assert not remarks_of(with_changes("paper/scenario1", ["estimated"], {"step_us": 5000}))


# flights


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "additions"),
    [
        ("airframes/aerosonde_designed", ["realistic"]),
        ("airframes/skywalker_x8_designed_tube", []),
        ("airframes/minisgs", ["turbulent"]),
        ("airframes/c172p_tube", ["turbulent"]),
        ("airframes/mixed", []),
    ],
)
def test_aircraft_are_flown_by_sensors(name: str, additions: list[str]) -> None:
    fly_well(name, additions, duration_s=5.0)


@pytest.mark.slow
@pytest.mark.parametrize("step_us", STEPS_US)
def test_any_control_period_is_flown_by_sensors(step_us: int) -> None:
    fly_well("paper/scenario1", [], duration_s=5.0, step_us=step_us)


def fly_well(name: str, additions: list[str], **values: Any) -> None:
    scenario = with_changes(name, [*additions, "estimated"], values)
    steps, exclusions, *_ = watched(scenario)
    assert steps.length == scenario.steps
    assert not exclusions
    tilt_deg, _, airspeed_m_s, place_m = errors_of(steps, scenario.step_us, settled_s=2.0)
    assert tilt_deg < 2.0
    assert airspeed_m_s < 2.0
    assert place_m < 8.0
