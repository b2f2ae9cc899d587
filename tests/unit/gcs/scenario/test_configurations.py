import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from plain_faults import actuator_fault
from scenario_edits import DELETE, edit

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.laws.surviving import Surviving
from ftc_autopilot.control.triggers.static import PerChannel
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.config.files import dump, load
from mavlink_defs.config.models import ConfigError, Model
from mavlink_defs.profile import Segment
from sitl_plant.config import PlantConfig


def test_scenario_1_is_the_papers(scenario1: Scenario) -> None:
    assert scenario1.controller == Proposed()
    assert scenario1.trigger == PerChannel()
    assert scenario1.trigger.a2_n.windows() == ((14.0, 0.5), (math.inf, 1.0))
    assert scenario1.segments()[1:] == (
        Segment(4.0, 45.0, 5.0, 5.0, 10.0, ramp=False),
        Segment(15.0, 50.0, 0.0, 0.0, 10.0, ramp=False),
    )
    assert scenario1.fault_commands() == [(3, actuator_fault(2, 0.9, 0.0, 0.0, 19.0, 22.0))]
    assert scenario1.disturbance.acceleration_m_s2.z.cos == 0.1
    assert scenario1.disturbance.angular_acceleration_rad_s2.x.rate_rad_s == math.pi


def test_configurations_of_the_processes_survive_their_files(
    scenario1: Scenario, tmp_path: Path
) -> None:
    configs: list[Model] = [scenario1, scenario1.plant_config(), scenario1.plant_config(speed=0.1)]
    configs += [scenario1.autopilot_config(uav.id) for uav in scenario1.uavs]
    for config in configs:
        dump(config, tmp_path / "config.yaml")
        assert load(tmp_path / "config.yaml", type(config)) == config


def test_a_written_scenario_configures_the_same_autopilots(tree: Any, tmp_path: Path) -> None:
    """What a scenario leaves open, as the servos of a diagnosis, stays open in its file."""
    changes = {"controller": {"kind": "surviving"}, "servos": {"surfaces": {"lag_s": 0.02}}}
    scenario = Scenario.model_validate(tree | changes)
    dump(scenario, tmp_path / "written.yaml")
    written = load_scenario(tmp_path / "written.yaml").autopilot_config(1)
    assert written == scenario.autopilot_config(1)
    assert isinstance(written.controller, Surviving)
    assert written.controller.diagnosis.servo_lag_s == 0.02


def test_autopilot_knows_its_neighbours_and_addresses(tree: Any, tmp_path: Path) -> None:
    path = tmp_path / "good.yaml"
    changes = {"links.plant_relay": "127.0.0.1:14570", "network.edges.1.weight": 2}
    path.write_text(yaml.safe_dump(edit(tree, changes)))
    leader, _, follower2 = (load_scenario(path).autopilot_config(i) for i in (1, 2, 3))
    assert [(n.id, n.weight, n.address) for n in leader.neighbours] == [
        (2, 1.0, "127.0.0.1:14602"),
        (3, 2.0, "127.0.0.1:14603"),
    ]
    assert [(n.id, n.weight) for n in follower2.neighbours] == [(1, 2.0)]
    assert follower2.name == "follower 2"
    assert follower2.formation_bind == "127.0.0.1:14603"
    assert (follower2.plant, follower2.gcs) == ("127.0.0.1:14570", ("127.0.0.1:14550",))


def test_autopilot_learns_nothing_of_faults_truth_and_disturbances(
    tree: Any, tmp_path: Path
) -> None:
    (tmp_path / "plain.yaml").write_text(yaml.safe_dump(tree))
    uncertain = {
        "mass": 1.1,
        "inertia": {"Jxx": 1.2},
        "coefficients": {"cL0": 0.9, "cm_alpha": 1.3},
    }
    changes = {"uncertainty": uncertain, "faults": DELETE, "disturbance": DELETE}
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(edit(tree, changes)))
    plain, other = (load_scenario(tmp_path / f"{name}.yaml") for name in ("plain", "other"))
    assert plain.autopilot_config(3) == other.autopilot_config(3)
    assert not {"faults", "uncertainty", "disturbance"} & AutopilotConfig.model_fields.keys()

    nominal, true = plain.aircraft, other.plant_config().uavs[2].aircraft
    assert true.mass_kg == 1.1 * nominal.mass_kg
    assert true.inertia_kg_m2.Jxx == 1.2 * nominal.inertia_kg_m2.Jxx
    assert true.inertia_kg_m2.Jzz == nominal.inertia_kg_m2.Jzz
    assert true.coefficients.cL0 == 0.9 * nominal.coefficients.cL0
    assert true.coefficients.cm_alpha == 1.3 * nominal.coefficients.cm_alpha
    assert plain.plant_config().uavs[0].aircraft == nominal


def test_plant_refuses_two_aircraft_with_one_id(scenario1: Scenario, tmp_path: Path) -> None:
    path = tmp_path / "plant.yaml"
    raw = scenario1.plant_config().model_dump()
    raw["uavs"][1]["id"] = 1
    path.write_text(yaml.safe_dump(raw))
    with pytest.raises(ConfigError) as caught:
        load(path, PlantConfig)
    (problem,) = caught.value.problems
    assert str(problem) == "uavs[1].id: expected each only once, got 1 again"
