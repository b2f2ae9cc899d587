"""The section `plant` of a scenario: what flies the aircraft, and what goes with it."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.config.models import ConfigError
from sitl_plant.simulators.config import JsbSimPlant, OwnPlant, PluginPlant

C172P = {"kind": "jsbsim", "aircraft": "c172p"}


def written(folder: Path, **keys: Any) -> Path:
    path = folder / "scenario.yaml"
    base = {"extends": "paper/scenario1", "disturbance": None, "uncertainty": None}
    path.write_text(yaml.safe_dump(base | keys))
    return path


def problems_of(path: Path) -> str:
    with pytest.raises(ConfigError) as refused:
        load_scenario(path)
    return "\n".join(refused.value.lines)


def test_the_own_equations_fly_unless_it_says_otherwise(scenario1: Scenario) -> None:
    assert scenario1.plant == OwnPlant()
    assert {uav.plant for uav in scenario1.plant_config().uavs} == {OwnPlant()}


def test_each_aircraft_may_have_a_plant_of_its_own(tmp_path: Path, scenario1: Scenario) -> None:
    uavs = [uav.model_dump(exclude_none=True) for uav in scenario1.uavs]
    uavs[0]["plant"] = {"kind": "own"}
    uavs[2]["plant"] = {"kind": "plugin", "name": "glider", "options": {"ballast_kg": 2.0}}
    plants = [
        uav.plant
        for uav in load_scenario(written(tmp_path, plant=C172P, uavs=uavs)).plant_config().uavs
    ]
    glider = PluginPlant(kind="plugin", name="glider", options={"ballast_kg": 2.0})
    assert plants == [OwnPlant(), JsbSimPlant(kind="jsbsim", aircraft="c172p"), glider]


def test_a_folder_is_looked_for_beside_the_scenario_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    base = written(tmp_path, plant=C172P | {"aircraft": "./mine"})
    above = tmp_path / "sub" / "above.yaml"
    above.write_text(f"extends: {base}\nname: above\n")
    for path in (base, above):
        plant = load_scenario(path).plant
        assert isinstance(plant, JsbSimPlant)
        assert Path(plant.aircraft) == tmp_path / "mine"


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"plant": C172P | {"step_us": 300}}, "plant.step_us: expected a divisor"),
        ({"plant": C172P, "uncertainty": {"mass": 1.1}}, "uncertainty: changes the plant's own"),
        (
            {"plant": C172P, "disturbance": {"acceleration_m_s2": {"x": {"rate_rad_s": 1.0}}}},
            "disturbance: changes the plant's own",
        ),
        ({"plant": {"kind": "other"}}, "plant.kind: expected one of 'own', 'jsbsim', 'plugin'"),
        ({"plant": {"kind": "jsbsim"}}, "plant.aircraft: missing"),
        ({"plant": C172P | {"thrust": "jet"}}, "plant.thrust: expected 'force' or 'engine'"),
        ({"plant": {"kind": "own", "aircraft": "c172p"}}, "plant.aircraft: unknown key"),
    ],
)
def test_what_does_not_go_together_is_refused(
    tmp_path: Path, keys: dict[str, Any], text: str
) -> None:
    assert text in problems_of(written(tmp_path, **keys))
