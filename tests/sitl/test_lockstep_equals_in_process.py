"""A lockstep flight over UDP and the same flight in one process are the same bit for bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from flying import arrays_of, fly_well, scenario_tree, star_tree, summary_of, write_scenario

pytestmark = pytest.mark.sitl

HEXAGON = Path(__file__).parents[2] / "scenarios" / "missions" / "hexagon.yaml"

FAULTS = [
    {"uav": 3, "actuator": "rudder", "effectiveness": 0.9, "start_s": 1.0, "end_s": 3.0},
    {
        "uav": 3,
        "actuator": "elevator",
        "stuck_deg": 1.0,
        "frequency_hz": 2.0,
        "start_s": 4.5,
        "end_s": 4.7,
    },
    {"uav": 2, "actuator": "aileron", "effectiveness": 0.9, "bias_deg": 1.5, "start_s": 2.0},
    {
        "uav": 1,
        "actuator": "throttle",
        "effectiveness": 0.8,
        "bias_n": 20.0,
        "start_s": 3.5,
        "end_s": 5.0,
    },
    {"uav": 2, "actuator": "elevator", "drift_deg_s": 0.7, "start_s": 1.0, "end_s": 3.0},
    {"uav": 1, "actuator": "rudder", "hardover_deg": 25.0, "start_s": 2.0, "end_s": 2.2},
    {
        "uav": 2,
        "actuator": "rudder",
        "effectiveness": 0.7,
        "intermittent_deg": 1.0,
        "frequency_hz": 3.3,
        "start_s": 1.0,
        "end_s": 4.0,
    },
]


def assert_equal_bit_for_bit(udp: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    assert udp.keys() == other.keys()
    for key, array in udp.items():
        assert (array.dtype, array.shape) == (other[key].dtype, other[key].shape), key
        numeric = array.dtype.kind in "fc"
        assert np.array_equal(array, other[key], equal_nan=numeric), key


def assert_worth_comparing(folder: Path, least_events: int) -> None:
    """Every channel of every UAV had events, and every fault acted."""
    events, flight = (arrays_of(folder / name) for name in ("events.npz", "trajectory.npz"))
    assert len(events["step"]) > least_events
    assert len({*zip(events["uav"].tolist(), events["channel"].tolist(), strict=True)}) == 12
    assert len(flight["time_s"]) == 6000
    differs = flight["applied"] != flight["held"]
    assert not differs[:1000].any()
    for fault in FAULTS:
        uav = [1, 2, 3].index(int(str(fault["uav"])))
        channel = ("aileron", "elevator", "rudder", "throttle").index(str(fault["actuator"]))
        begin = round(float(str(fault["start_s"])) * 1000)
        assert differs[begin + 2 : begin + 100, uav, channel].all(), fault


SERVO = {"lag_s": 0.02, "dead_time_s": 0.002, "backlash_deg": 0.05, "resolution_deg": 0.02}
SENSOR = {"noise_rms": 0.02, "bias": 0.1, "bias_drift": 0.01, "rate_hz": 500, "latency_s": 0.001}
REALISTIC: dict[str, Any] = {
    "controller": {"kind": "pid"},
    "servos": {
        "surfaces": {**SERVO, "rate_limit_deg_s": 400.0},
        "throttle": {"lag_s": 0.05, "rate_limit_n_s": 4000.0},
    },
    "sensors": dict.fromkeys(
        ("gyro_deg_s", "accelerometer_m_s2", "attitude_deg", "airspeed_m_s"), SENSOR
    ),
    "wind": {
        "steady": {"north_m_s": 3.0, "east_m_s": -4.0},
        "shear": {"east_1_s": 0.05, "altitude_m": 100.0},
        "gust": {"start_s": 0.5, "duration_s": 1.0, "down_m_s": -2.0},
        "turbulence": "moderate",
    },
    "seed": 7,
}


def test_flights_with_everything_realistic_are_equal_bit_for_bit(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=2.0, faults=FAULTS[:1], **REALISTIC)
    udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    fly_well(scenario, "--quiet", "--free-ports", "--record=npz", "--out", udp)
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    flown = arrays_of(udp / "trajectory.npz")
    assert_equal_bit_for_bit(flown, arrays_of(in_process / "trajectory.npz"))
    assert np.all(np.ptp(flown["wind"], axis=0) > 0.1)
    true = flown["state"][..., 6:9]
    assert np.abs(flown["attitude"] - true).max() > np.radians(0.05)


def test_flights_by_sensors_are_equal_bit_for_bit(tmp_path: Path) -> None:
    wind = {"steady": {"north_m_s": 3.0, "east_m_s": -4.0}, "turbulence": "light"}
    tree = scenario_tree(duration_s=3.0, faults=FAULTS[:1], navigation="estimated", wind=wind)
    scenario = write_scenario(tmp_path, tree)
    udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    fly_well(scenario, "--quiet", "--free-ports", "--record=npz", "--out", udp)
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    for name in ("events.npz", "trajectory.npz"):
        assert_equal_bit_for_bit(*(arrays_of(folder / name) for folder in (udp, in_process)))
    flown = arrays_of(udp / "trajectory.npz")
    apart = np.abs(flown["estimates"][..., :12] - flown["state"])
    assert np.isfinite(apart).all()
    assert apart[1000:].max(axis=(0, 1)).min() > 0.0  # no estimate is the truth
    summaries = [summary_of(folder) for folder in (udp, in_process)]
    assert summaries[0]["uavs"] == summaries[1]["uavs"]


@pytest.mark.parametrize(
    ("kind", "least_events"), [("proposed", 1000), ("surviving", 400), ("tube", 100)]
)
def test_flights_are_equal_bit_for_bit(tmp_path: Path, kind: str, least_events: int) -> None:
    keys: dict[str, Any] = {} if kind == "proposed" else {"controller": {"kind": kind}}
    if kind == "tube":
        keys["trigger"] = {"mode": "consequence"}
    scenario = write_scenario(tmp_path, duration_s=6.0, faults=FAULTS, **keys)
    folders = udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    fly_well(scenario, "--quiet", "--free-ports", "--record=npz", "--out", udp)
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    for name in ("events.npz", "trajectory.npz"):
        assert_equal_bit_for_bit(*(arrays_of(folder / name) for folder in folders))
    assert_worth_comparing(udp, least_events)
    summaries = [summary_of(folder) for folder in folders]
    assert [summary.pop("mode") for summary in summaries] == ["lockstep", "in_process"]
    for summary in summaries:
        assert summary.pop("wall_s") > 0.0
        assert summary.pop("real_time_factor") > 0.0
    assert summaries[0] == summaries[1]


@pytest.mark.parametrize("formation", [{}, {"trigger": {}}], ids=["every step", "triggered"])
def test_flights_of_a_formation_on_a_path_are_equal_bit_for_bit(
    tmp_path: Path, formation: dict[str, Any]
) -> None:
    """A straight of two seconds, then a circle, in wind."""
    circle = {"north_m": 80.0, "east_m": 450.0, "height_m": 100.0, "radius_m": 450.0}
    tree = {
        "extends": str(HEXAGON),
        "duration_s": 6.0,
        "wind": {"steady": {"north_m_s": 3.0, "east_m_s": -4.0}},
        "mission": {"items": [{"loiter": circle}]},
        "links": {"formation": formation},
    }
    scenario = write_scenario(tmp_path, tree)
    udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    fly_well(scenario, "--quiet", "--free-ports", "--record=npz", "--out", udp)
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    flown = arrays_of(udp / "trajectory.npz")
    assert_equal_bit_for_bit(flown, arrays_of(in_process / "trajectory.npz"))
    assert flown["path_position"][-1].min() > 150.0
    assert np.degrees(flown["command"][-1, :, 1]).min() > 10.0  # they turn


MIXED = Path(__file__).parents[2] / "scenarios" / "airframes" / "mixed.yaml"


@pytest.mark.parametrize("law", ["surviving", "tube"])
def test_flights_of_three_types_are_equal_bit_for_bit(tmp_path: Path, law: str) -> None:
    """One of them has no rudder, which has no event; another one has stops of its own."""
    mode = "consequence" if law == "tube" else "per_channel"
    limits = "surface_limits_deg: {aileron: [-20, 15], rudder: [-12, 25]}"
    (tmp_path / "heavy.yaml").write_text(f"extends: aerosonde\nmass_kg: 12.0\n{limits}\n")
    uavs = yaml.safe_load(MIXED.read_text())["uavs"]
    uavs[2]["aircraft"] = "heavy.yaml"
    scenario = write_scenario(
        tmp_path,
        {"extends": str(MIXED)},
        duration_s=7.0,
        uavs=uavs,
        controller={"kind": law},
        trigger={"mode": mode},
        faults=[{"uav": 2, "actuator": "aileron", "stuck_deg": 1.0, "start_s": 5.0, "end_s": 5.2}],
    )
    folders = udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    flown = fly_well(scenario, "--free-ports", "--record=npz", "--out", udp)
    assert "UAV 2: heading is held by bank (no rudder)" in flown.stdout + flown.stderr
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    for name in ("events.npz", "trajectory.npz"):
        assert_equal_bit_for_bit(*(arrays_of(folder / name) for folder in folders))
    events = arrays_of(udp / "events.npz")
    found = {*zip(events["uav"].tolist(), events["channel"].tolist(), strict=True)}
    assert len(found) == 11
    assert np.ptp(arrays_of(udp / "trajectory.npz")["held"][:, 1, 2]) == 0.0
    rudder = summary_of(udp)["uavs"][1]["channels"]["rudder"]
    assert rudder["events"] == 0


def test_flights_of_ten_are_equal_bit_for_bit(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, star_tree(10, duration_s=0.3))
    udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    fly_well(scenario, "--quiet", "--free-ports", "--record=npz", "--out", udp)
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    flown = arrays_of(udp / "trajectory.npz")
    assert flown["state"].shape == (300, 10, 12)
    assert_equal_bit_for_bit(flown, arrays_of(in_process / "trajectory.npz"))


def test_a_line_astern_on_a_chain_is_equal_bit_for_bit_and_keeps_its_distance(
    tmp_path: Path,
) -> None:
    """Places are relayed: the first loses thrust, and the third and fourth do not hear it."""
    initial = {"east_m": 0.0, "altitude_m": 100.0, "airspeed_m_s": 40.0}
    scenario = write_scenario(
        tmp_path,
        {"extends": str(HEXAGON)},
        duration_s=12.0,
        uavs=[
            {"id": k + 1, "name": f"UAV {k + 1}", "initial": {"north_m": -25.0 * k, **initial}}
            for k in range(4)
        ],
        network={
            "leader_access": {1: 1.0},
            "edges": [{"between": [k, k + 1], "weight": 1.0} for k in (1, 2, 3)],
        },
        formation={"slots": {k + 1: {"ahead_m": -25.0 * k} for k in range(4)}},
        faults=[{"uav": 1, "actuator": "throttle", "stuck_n": 500.0, "start_s": 2.0}],
    )
    udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    fly_well(scenario, "--quiet", "--free-ports", "--record=npz", "--out", udp)
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    flown = arrays_of(udp / "trajectory.npz")
    assert_equal_bit_for_bit(flown, arrays_of(in_process / "trajectory.npz"))
    assert summary_of(udp)["separation"]["least_m"] >= 14.0
