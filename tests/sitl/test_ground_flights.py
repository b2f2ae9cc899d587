"""Aircraft on the ground over UDP: the same bits and the same judgement as in one process."""

from pathlib import Path

import numpy as np
import pytest
from flying import arrays_of, fly_well, summary_of, write_scenario

pytestmark = pytest.mark.sitl

SCENARIO = {
    "extends": "paper/scenario2_pid",
    "name": "roll",
    "duration_s": 4.0,
    "step_us": 4000,
    "aircraft": "paper",
    "uncertainty": None,
    "disturbance": None,
    "faults": None,
    "runway": {"north_m": -10.0, "heading_deg": 0.0, "length_m": 500.0, "width_m": 30.0},
    "profile": [{"start_s": 0.0, "airspeed_m_s": 25.0}],
    "uavs": [
        {"id": 1, "name": "rolls", "initial": {"north_m": 0.0, "east_m": 0.0, "on_ground": True}},
        {
            "id": 2,
            "name": "lands",
            "initial": {
                "north_m": -40.0,
                "east_m": 8.0,
                "altitude_m": 0.45,
                "airspeed_m_s": 28.0,
            },
        },
        {"id": 3, "name": "beside", "initial": {"north_m": 0.0, "east_m": 20.0, "on_ground": True}},
    ],
}


def test_the_ground_is_the_same_over_udp_and_in_process(tmp_path: Path) -> None:
    file = write_scenario(tmp_path, SCENARIO)
    folders = [tmp_path / name for name in ("udp", "inside")]
    fly_well(file, "--out", str(folders[0]), "--record", "npz", "--free-ports")
    fly_well(file, "--out", str(folders[1]), "--record", "npz", "--in-process")
    over_udp, inside = (arrays_of(folder / "trajectory.npz")["state"] for folder in folders)
    assert np.array_equal(over_udp, inside)
    found = [[uav["ground"] for uav in summary_of(folder)["uavs"]] for folder in folders]
    assert found[0] == found[1]
    rolled, landed, beside = found[0]
    assert rolled["outcome"] == "on the ground"
    assert landed["touchdowns"] >= 1
    assert landed["worst"]["sink_m_s"] > 0.2
    assert beside["outcome"] == "off the runway"
