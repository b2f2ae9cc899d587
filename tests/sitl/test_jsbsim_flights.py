"""Whole flights in which simulators fly the aircraft: over UDP, in process, and lost."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    arrays_of,
    assert_one_message,
    fly,
    fly_well,
    run,
    summary_of,
    write_scenario,
)
from jsbsim_aircraft import needs_jsbsim, write_aircraft
from simulator_plugin import write_plugin

from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import load_scenario

pytestmark = pytest.mark.sitl

FAULT = {"uav": 3, "actuator": "rudder", "effectiveness": 0.5, "start_s": 0.5, "end_s": 1.5}
REAL: dict[str, Any] = {
    "servos": {"surfaces": {"lag_s": 0.02, "rate_limit_deg_s": 400.0, "dead_time_s": 0.002}},
    "sensors": {"gyro_deg_s": {"noise_rms": 0.05}, "attitude_deg": {"latency_s": 0.002}},
    "wind": {"steady": {"north_m_s": 2.0, "east_m_s": -1.5}, "turbulence": "light"},
}


def aerosondes(folder: Path, plant: dict[str, Any], **keys: Any) -> Path:
    """Scenario of three Aerosondes that a simulator flies."""
    base = {"extends": "airframes/aerosonde", "disturbance": None, "uncertainty": None}
    given = {"plant": plant, "duration_s": 2.0, "faults": [FAULT], **keys}
    return write_scenario(folder, base | given)


def jsbsim(folder: Path, **keys: Any) -> dict[str, Any]:
    """The section of a plant that flies an Aerosonde in JSBSim."""
    write_aircraft(folder, load_aircraft("aerosonde"))
    return {"kind": "jsbsim", "aircraft": "./written", **keys}


@needs_jsbsim
@pytest.mark.parametrize("flown_by", ["jsbsim in small steps", "both"])
def test_lockstep_and_in_process_are_equal_bit_for_bit(tmp_path: Path, flown_by: str) -> None:
    plant = jsbsim(tmp_path, **({"step_us": 250} if "small" in flown_by else {}))
    uavs = [uav.model_dump(exclude_none=True) for uav in load_scenario("airframes/aerosonde").uavs]
    if flown_by == "both":
        uavs[1]["plant"] = {"kind": "own"}
    scenario = aerosondes(tmp_path, plant, uavs=uavs, **REAL)
    udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    fly_well(scenario, "--quiet", "--free-ports", "--record=npz", "--out", udp)
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    for name in ("events.npz", "trajectory.npz"):
        one, other = (arrays_of(path / name) for path in (udp, in_process))
        assert one.keys() == other.keys()
        for key, array in one.items():
            numeric = array.dtype.kind in "fc"
            assert np.array_equal(array, other[key], equal_nan=numeric), key
    flown = arrays_of(udp / "trajectory.npz")
    assert flown["state"].shape == (2000, 3, 12)
    assert (flown["applied"] != flown["held"])[600:1400, 2, 2].all()
    assert np.ptp(flown["wind"], axis=0).min() > 0.05
    assert summary_of(udp)["completed"]


@needs_jsbsim
def test_a_fault_acts_on_what_the_simulator_is_given(tmp_path: Path) -> None:
    """A stuck aileron rolls the aircraft, whatever is commanded."""
    stuck = {"uav": 1, "actuator": "aileron", "stuck_deg": -3.0, "start_s": 0.2}
    plant = jsbsim(tmp_path)
    rolled = []
    for faults in ([], [stuck]):
        scenario = aerosondes(tmp_path, plant, duration_s=0.4, faults=faults)
        out = tmp_path / f"{len(faults)}"
        fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", out)
        flown = arrays_of(out / "trajectory.npz")
        rolled.append(np.degrees(flown["state"][-1, :, 6]))
    assert np.degrees(flown["applied"][-1, 0, 0]) == pytest.approx(-3.0)
    assert rolled[1][0] > rolled[0][0] + 1.5
    assert rolled[1][1:] == pytest.approx(rolled[0][1:], abs=1.0)


@needs_jsbsim
@pytest.mark.parametrize("way", [("--free-ports",), ("--in-process",)], ids=["udp", "in process"])
def test_an_aircraft_that_hits_the_ground_is_lost(tmp_path: Path, way: tuple[str, ...]) -> None:
    initial = {"altitude_m": 1.0, "airspeed_m_s": 24.0, "pitch_deg": -20.0}
    uav = {"id": 1, "name": "low", "initial": {"north_m": 0.0, "east_m": 0.0, **initial}}
    network = {"leader_access": {1: 1.0}, "edges": []}
    scenario = aerosondes(tmp_path, jsbsim(tmp_path), uavs=[uav], network=network, faults=[])
    done = fly(scenario, *way, "--quiet", "--out", tmp_path / "out")
    assert done.returncode == 1
    assert_one_message(done.stderr)
    assert "UAV 1 was lost" in done.stderr
    assert "it hit the ground" in done.stderr


@needs_jsbsim
def test_real_time_is_flown_to_its_end(tmp_path: Path) -> None:
    scenario = aerosondes(tmp_path, jsbsim(tmp_path), duration_s=1.0)
    fly_well(scenario, "--quiet", "--free-ports", "--speed", "2", "--out", tmp_path / "out")
    assert summary_of(tmp_path / "out")["completed"]


@needs_jsbsim
@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ({"aircraft": "Camel"}, "JSBSim cannot fly Camel"),
        ({"aircraft": "c172p"}, "the aileron's stops"),
        ({"aircraft": "./nothing"}, "expected a folder NAME"),
        ({"aircraft": ""}, "plant.aircraft"),
        ({"aircraft": "c172p", "step_us": 300}, "expected a divisor of the control period"),
    ],
)
@pytest.mark.parametrize("way", [("--free-ports",), ("--in-process",)], ids=["udp", "in process"])
def test_what_cannot_be_flown_is_refused_before_the_flight(
    tmp_path: Path, keys: dict[str, Any], reason: str, way: tuple[str, ...]
) -> None:
    scenario = aerosondes(tmp_path, {"kind": "jsbsim", **keys})
    done = fly(scenario, *way, "--quiet", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert reason in done.stderr
    assert not (tmp_path / "out").exists()


@needs_jsbsim
def test_the_plant_by_itself_says_so_too(tmp_path: Path) -> None:
    scenario = aerosondes(tmp_path, {"kind": "jsbsim", "aircraft": "c172p"})
    out = tmp_path / "config"
    done = run("gcs", "config", scenario, "--out", out)
    assert done.returncode == 0, done.stderr
    (config,) = out.glob("*plant*.yaml")
    done = run("sitl-plant", config)
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert "the aileron's stops" in done.stderr


@pytest.mark.parametrize("way", [("--free-ports",), ("--in-process",)], ids=["udp", "in process"])
@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"fails_s": 0.2995}, "UAV 1 was lost at 0.300 s: its simulator has had enough"),
        (
            {"breaks_s": 0.2995},
            "UAV 1 was lost at 0.300 s: its simulator failed: ZeroDivisionError",
        ),
        ({"nan_s": 0.2995}, "UAV 1 was lost at 0.300 s: its state is not finite"),
    ],
)
def test_a_simulator_of_another_package_flies_and_fails(
    tmp_path: Path, way: tuple[str, ...], options: dict[str, float], reason: str
) -> None:
    path = write_plugin(tmp_path / "package")
    for name, given, status in (("well", {}, 0), ("badly", options, 1)):
        plant = {"kind": "plugin", "name": "glider", "options": given}
        scenario = aerosondes(tmp_path, plant, duration_s=0.5, faults=[])
        out = tmp_path / name
        done = fly(scenario, *way, "--quiet", "--record=npz", "--out", out, PYTHONPATH=path)
        assert done.returncode == status, done.stderr
    assert_one_message(done.stderr)
    assert reason in done.stderr
    flown = arrays_of(tmp_path / "well" / "trajectory.npz")
    assert flown["state"][-1, 0, 0] == pytest.approx(
        24.0 * 0.499, rel=0.01
    )  # it glides straight on
