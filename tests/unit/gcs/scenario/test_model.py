import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from plain_faults import actuator_fault
from scenario_edits import DELETE, edit

from gcs.scenario.model import load_scenario
from mavlink_defs.config.models import ConfigError

PAPER = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"
RUDDER = {"uav": 3, "actuator": "rudder", "start_s": 1}
THROTTLE = {"uav": 3, "actuator": "throttle", "start_s": 1}
DRYDEN = {f"sigma_{axis}_m_s": 1.0 for axis in "uvw"} | {f"length_{axis}_m": 99.0 for axis in "uvw"}
FROM_ANY = "cannot be reached from any UAV with leader access"


def problems_of(tree: Any, path: Path) -> list[str]:
    path.write_text(yaml.safe_dump(tree))
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    assert all(line.startswith(f"{path}:") for line in str(caught.value).splitlines())
    return list(map(str, caught.value.problems))


ONE_PROBLEM: list[tuple[dict[str, Any], str]] = [
    # structure
    ({"weather": 1}, "weather: unknown key"),
    # servos, sensors
    (
        {"servos": {"surfaces": {"lag_s": -0.02}}},
        "servos.surfaces.lag_s: expected [0, 10] s, got -0.02",
    ),
    (
        {"servos": {"rudder": {"rate_limit_deg_s": 0}}},
        "servos.rudder.rate_limit_deg_s: expected > 0 deg/s, got 0",
    ),
    (
        {"servos": {"throttle": {"rate_limit_deg_s": 1}}},
        "servos.throttle.rate_limit_deg_s: unknown key; did you mean 'rate_limit_n_s'?",
    ),
    (
        {"uavs.1.servos": {"surfaces": {"dead_time_s": 0.0125}}},
        "uavs[1].servos.surfaces.dead_time_s: expected a whole number of control periods of "
        "1000 us, got 0.0125 s",
    ),
    (
        {"sensors": {"gyro_deg_s": {"rate_hz": 300}}},
        "sensors.gyro_deg_s.rate_hz: expected a sample every 1, 2, 3, ... control periods of "
        "1000 us, such as 333.333 or 250 Hz, got 300.0",
    ),
    (
        {"sensors": {"attitude_deg": {"rate_hz": 2000}}},
        "sensors.attitude_deg.rate_hz: expected a sample every 1, 2, 3, ... control periods of "
        "1000 us, such as 1000 or 500 Hz, got 2000.0",
    ),
    (
        {"wind": {"turbulence": "strong"}},
        "wind.turbulence: expected 'none', 'light', 'moderate' or 'severe', got 'strong'",
    ),
    (
        {"wind": {"turbulence": {**DRYDEN, "length_u_m": 0}}},
        "wind.turbulence.length_u_m: expected >= 1 m, got 0",
    ),
    ({"wind": {"gust": {"start_s": 1}}}, "wind.gust.duration_s: missing; expected a number in s"),
    ({"seed": -1}, "seed: expected [0, 4294967295], got -1"),
    ({"fault": []}, "fault: unknown key; did you mean 'faults'?"),
    ({"aircraft.mass_g": 20640}, "aircraft.mass_g: unknown key; did you mean 'mass_kg'?"),
    (
        {"faults.0.rudder_bias_rad": 0.1},
        "faults[0].rudder_bias_rad: unknown key; did you mean 'bias_deg'?",
    ),
    ({"aircraft.mass_kg": DELETE}, "aircraft.mass_kg: missing; expected a number in kg"),
    ({"duration_s": DELETE}, "duration_s: missing; expected a number in s"),
    ({"network": DELETE}, "network: missing; expected a mapping"),
    ({"uavs": DELETE}, "uavs: missing; expected a list"),
    ({"uavs": []}, "uavs: expected at least 1 entry, got a list of 0"),
    ({"profile": []}, "profile: expected a segment, or a mission instead, got nothing"),
    (
        {"aircraft.wing_area_m2": "30 in"},
        "aircraft.wing_area_m2: expected a number in m^2, got '30 in'",
    ),
    ({"aircraft.mass_kg": -20.64}, "aircraft.mass_kg: expected > 0 kg, got -20.64"),
    (
        {"aircraft.mass_kg": math.nan},
        "aircraft.mass_kg: expected a finite number in kg, got nan",
    ),
    (
        {"uavs.1.initial.airspeed_m_s": True},
        "uavs[1].initial.airspeed_m_s: expected a number in m/s, got true",
    ),
    ({"step_us": 1000.5}, "step_us: expected a whole number in us, got 1000.5"),
    ({"uavs.0.id": 251}, "uavs[0].id: expected [1, 250], got 251"),
    ({"links.gcs_port": 65536}, "links.gcs_port: expected [1, 65535], got 65536"),
    (
        {"links.plant_relay": "127.0.0.1"},
        "links.plant_relay: expected host:port with an IPv4 host and port 1-65535, got '127.0.0.1'",
    ),
    (
        {"links.impairments": {"gcs": {"loss": 1.5}}},
        "links.impairments.gcs.loss: expected [0, 1], got 1.5",
    ),
    (
        {"links.impairments": {"plants": {}}},
        "links.impairments.plants: unknown key; did you mean 'plant'?",
    ),
    (
        {"links.impairments": {"plant": {"outages": [{"from_s": 2, "to_s": 1}]}}},
        "links.impairments.plant.outages[0].to_s: expected > from_s = 2.0 s, got 1.0",
    ),
    (
        {"links.plant_relay": "127.0.0.1:14570", "links.impairments": {}},
        "links.plant_relay: cannot be combined with 'impairments', "
        "which bring a relay of their own",
    ),
    (
        {"links.host": "my host"},
        "links.host: expected an IPv4 address or a host name, got 'my host'",
    ),
    (
        {"controller.kind": "lqr"},
        "controller.kind: expected one of 'proposed', 'backstepping', 'pid', 'surviving', 'tube', "
        "'FILE.py:CLASS', got 'lqr'",
    ),
    (
        {"trigger.a2_n.1.value": "1 N"},
        "trigger.a2_n[1].value: expected a number in N, got '1 N'",
    ),
    ({"trigger.a2_n": -1}, "trigger.a2_n: expected >= 0 N, got -1"),
    (
        {"trigger.a2_n.0.until_s": DELETE},
        "trigger.a2_n[0].until_s: missing; only the last window has no end",
    ),
    (
        {"controller.K1.1.until_s": 5},
        "controller.K1[1].until_s: expected > 5.0 s, the end of the window before, got 5.0",
    ),
    (
        {"controller.K1.2.until_s": 30},
        "controller.K1[2].until_s: expected none in the last window, got 30.0",
    ),
    (
        {"trigger.b2_deg": [{"until_s": i + 1, "value": 1} for i in range(8)] + [{"value": 1}]},
        "trigger.b2_deg: expected at most 8 windows, got 9",
    ),
    ({"controller.K2": [50, 50, "x"]}, "controller.K2[2]: expected a number in 1/s, got 'x'"),
    (
        {"aircraft.inertia_kg_m2.Jxz": -4},
        "aircraft.inertia_kg_m2.Jxz: not positive definite: "
        "expected |Jxz| < sqrt(Jxx Jzz) = 3.3968 kg m^2, got -4.0",
    ),
    (
        {"aircraft.airspeed_max_m_s": 20},
        "aircraft.airspeed_max_m_s: expected > airspeed_min_m_s = 20.0 m/s, got 20.0",
    ),
    (
        {"uncertainty.coefficients": {"cL_alfa": 1.1}},
        "uncertainty.coefficients.cL_alfa: unknown key; did you mean 'cL_alpha'?",
    ),
    (
        {"uncertainty.inertia": {"Jxx": "10 %"}},
        "uncertainty.inertia.Jxx: expected a number, got '10 %'",
    ),
    # faults
    (
        {"faults.0": {**RUDDER, "bias_n": 1}},
        "faults[0].bias_n: does not fit the rudder; did you mean 'bias_deg'?",
    ),
    (
        {"faults.0": {**THROTTLE, "stuck_deg": 1}},
        "faults[0].stuck_deg: does not fit the throttle; did you mean 'stuck_n'?",
    ),
    (
        {"faults.0": {**RUDDER, "bias_deg": 1, "stuck_deg": 1}},
        "faults[0].bias_deg: cannot be combined with 'stuck_deg'",
    ),
    (
        {"faults.0": {**RUDDER, "stuck_deg": 1, "effectiveness": 0.5}},
        "faults[0].effectiveness: expected 0 or none with 'stuck_deg', got 0.5",
    ),
    (
        {"faults.0": {**RUDDER, "hardover_deg": 1, "effectiveness": 0.5}},
        "faults[0].effectiveness: expected 0 or none with 'hardover_deg', got 0.5",
    ),
    (
        {"faults.0": {**RUDDER, "intermittent_deg": 1}},
        "faults[0].frequency_hz: expected > 0 Hz with 'intermittent_deg', got 0.0",
    ),
    (
        {"faults.0": {**RUDDER, "bias_deg": 1, "effectiveness": 0}},
        "faults[0].bias_deg: nothing is left to be biased; did you mean 'stuck_deg'?",
    ),
    (
        {"faults.0": RUDDER},
        "faults[0]: expected 'effectiveness', 'bias_deg', 'stuck_deg', 'drift_deg_s',"
        " 'hardover_deg' or 'intermittent_deg', got none of them",
    ),
    ({"faults.0.end_s": 19}, "faults[0].end_s: expected > start_s = 19.0 s, got 19.0"),
    ({"faults.0.effectiveness": 1.1}, "faults[0].effectiveness: expected [0, 1], got 1.1"),
    (
        {"faults.0.actuator": "flap"},
        "faults[0].actuator: expected 'aileron', 'elevator', 'rudder' or 'throttle', got 'flap'",
    ),
    ({"faults.0.uav": 7}, "faults[0].uav: expected one of the UAVs 1, 2, 3, got 7"),
    (
        {"faults.0.bias_deg": -35.5},
        "faults[0].bias_deg: expected [-35, 35] deg, the aircraft's limits, got -35.5",
    ),
    (
        {"faults.0": {**THROTTLE, "stuck_n": -1}},
        "faults[0].stuck_n: expected [0, 2000] N, the aircraft's limits, got -1.0",
    ),
    (
        {"faults.1": {**RUDDER, "bias_deg": 1, "start_s": 21.5}},
        "faults[1]: overlaps faults[0]: the rudder of UAV 3 has a fault in (19, 22] s already, "
        "got (21.5, ...) s",
    ),
    # cross-checks
    ({"uavs.2.name": "leader"}, "uavs[2].name: expected each only once, got 'leader' again"),
    (
        {"uavs.1.initial.airspeed_m_s": 19},
        "uavs[1].initial.airspeed_m_s: expected [20, 80] m/s, the aircraft's limits, got 19.0",
    ),
    (
        {"profile.2.airspeed_m_s": 81},
        "profile[2].airspeed_m_s: expected [20, 80] m/s, the aircraft's limits, got 81.0",
    ),
    ({"profile.0.start_s": 1}, "profile[0].start_s: expected 0 s in the first segment, got 1.0"),
    (
        {"profile.2.start_s": 4},
        "profile[2].start_s: overlaps profile[1]: expected > 4.0 s, got 4.0",
    ),
    (
        {"profile.2.shape": "ramp"},
        "profile[2].shape: expected 'step' in the first and the last segment, got 'ramp'",
    ),
    (
        {"network.edges.1": DELETE},
        f"network: UAV 3 {FROM_ANY}, so L + H is not positive definite (Lemma 1)",
    ),
    (
        {"network.edges": []},
        f"network: UAVs 2 and 3 {FROM_ANY}, so L + H is not positive definite (Lemma 1)",
    ),
    (
        {"network.edges.1.between": [3, 7]},
        "network.edges[1].between[1]: expected one of the UAVs 1, 2, 3, got 7",
    ),
    ({"network.edges.0.weight": 0}, "network.edges[0].weight: expected > 0, got 0"),
    (
        {"network.leader_access.9": 1.0},
        "network.leader_access.9: expected one of the UAVs 1, 2, 3, got 9",
    ),
    (
        {"uncertainty.inertia": {"Jxz": 6}},
        "uncertainty: makes a true aircraft that cannot be: inertia_kg_m2.Jxz: "
        "not positive definite: expected |Jxz| < sqrt(Jxx Jzz) = 3.3968 kg m^2, got 3.54",
    ),
    # ports
    (
        {"links.plant_port": 14550},
        "links.plant_port: expected another port than gcs_port, got 14550",
    ),
    (
        {"links.formation_base_port": 14558},
        "links.formation_base_port: clashes with plant_port: UAV 2 would bind 14558 + 2 too",
    ),
    (
        {"links.formation_base_port": 65534},
        "links.formation_base_port: expected at most 65535 with the UAV's id added, got 65534 + 2",
    ),
    (
        {"links.plant_relay": "127.0.0.1:14603"},
        "links.plant_relay: clashes with the formation link of UAV 3, got '127.0.0.1:14603'",
    ),
]


@pytest.mark.parametrize(("changes", "problem"), ONE_PROBLEM)
def test_bad_input_is_refused(
    tree: Any, tmp_path: Path, changes: dict[str, Any], problem: str
) -> None:
    problems = problems_of(edit(tree, changes), tmp_path / "bad.yaml")
    assert problems[0] == problem
    assert problems[1:] == [line for line in problems[1:] if "formation_base_port" in line]


def test_duplicate_id(tree: Any, tmp_path: Path) -> None:
    problems = problems_of(edit(tree, {"uavs.1.id": 1}), tmp_path / "bad.yaml")
    assert problems[0] == "uavs[1].id: expected each only once, got 1 again"


def test_duplicate_key_names_both_lines(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    text = PAPER.read_text().replace("  wing_span_m:", "  mass_kg: 20\n  wing_span_m:")
    lines = [i for i, line in enumerate(text.splitlines(), 1) if "mass_kg" in line]
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    assert str(caught.value) == (
        f"{path}:{lines[1]}:3: duplicate key 'mass_kg', given before in line {lines[0]}"
    )


def test_structure_problems_of_all_sections_come_at_once(tree: Any, tmp_path: Path) -> None:
    changes = {
        "aircraft.mass_kg": -1,
        "uavs.0.initial.altitude_ft": 300,
        "uavs.2.initial.airspeed_m_s": "fast",
        "network.edges.0.weight": DELETE,
        "profile.1.yaw_deg": 200,
        "faults.0.bias_n": 3,
        "controller.sigma_v1": math.inf,
    }
    assert problems_of(edit(tree, changes), tmp_path / "bad.yaml") == [
        "aircraft.mass_kg: expected > 0 kg, got -1",
        "controller.sigma_v1: expected a finite number in 1/s, got inf",
        "uavs[0].initial.altitude_ft: unknown key; did you mean 'altitude_m'?",
        "uavs[2].initial.airspeed_m_s: expected a number in m/s, got 'fast'",
        "network.edges[0].weight: missing; expected a number",
        "profile[1].yaw_deg: expected [-180, 180] deg, got 200",
        "faults[0].bias_n: does not fit the rudder; did you mean 'bias_deg'?",
    ]


def test_cross_checks_of_all_sections_come_at_once(tree: Any, tmp_path: Path) -> None:
    changes = {
        "uavs.0.initial.airspeed_m_s": 10,
        "network.leader_access": {2: 1.0},
        "network.edges.0": DELETE,
        "profile.1.start_s": 20,
        "faults.0.uav": 4,
        "links.gcs_port": 14601,
    }
    assert problems_of(edit(tree, changes), tmp_path / "bad.yaml") == [
        "uavs[0].initial.airspeed_m_s: expected [20, 80] m/s, the aircraft's limits, got 10.0",
        f"network: UAVs 1 and 3 {FROM_ANY}, so L + H is not positive definite (Lemma 1)",
        "profile[2].start_s: overlaps profile[1]: expected > 20.0 s, got 15.0",
        "faults[0].uav: expected one of the UAVs 1, 2, 3, got 4",
        "links.formation_base_port: clashes with gcs_port: UAV 1 would bind 14600 + 1 too",
    ]


def test_faults_that_follow_each_other_or_differ_in_actuator_do_not_overlap(
    tree: Any, tmp_path: Path
) -> None:
    path = tmp_path / "good.yaml"
    changes = {
        "faults.1": {**RUDDER, "stuck_deg": 3, "frequency_hz": 2, "start_s": 22},
        "faults.2": {**THROTTLE, "bias_n": -50, "effectiveness": 0.5},
        "faults.3": {**RUDDER, "uav": 1, "effectiveness": 0, "start_s": 20},
    }
    path.write_text(yaml.safe_dump(edit(tree, changes)))
    commands = load_scenario(path).fault_commands()
    assert repr(commands[1:]) == repr(  # NaN is not equal to itself
        [
            (3, actuator_fault(2, 0.0, 3.0, 2.0, 22.0, math.nan)),
            (3, actuator_fault(3, 0.5, -50.0, 0.0, 1.0, math.nan)),
            (1, actuator_fault(2, 0.0, 0.0, 0.0, 20.0, math.nan)),
        ]
    )
