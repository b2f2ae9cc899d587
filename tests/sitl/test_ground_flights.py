"""Flights from and to the ground over UDP: the same bits as in process."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import arrays_of, fly_well, summary_of, write_scenario

pytestmark = pytest.mark.sitl

ON_FINAL = {"north_m": -1500.0, "east_m": 0.0, "altitude_m": 30.0, "airspeed_m_s": 40.0}
CASES: dict[str, tuple[dict[str, Any], str]] = {
    "takes off": ({"duration_s": 12.0}, "in the air"),
    "lands": (
        {
            "duration_s": 60.0,
            "uavs": [{"id": 1, "name": "one", "initial": ON_FINAL}],
            "mission": {
                "items": [
                    {"waypoint": {"north_m": -1200.0, "east_m": 0.0, "height_m": 30.0}},
                    {"land": {"north_m": 0.0, "east_m": 0.0}},
                ]
            },
        },
        "landed",
    ),
    "glides": ({"extends": "runway/engine_lost", "duration_s": 110.0}, "landed"),
}


@pytest.mark.parametrize("name", CASES)
def test_the_ground_is_the_same_over_udp_and_in_process(name: str, tmp_path: Path) -> None:
    changes, outcome = CASES[name]
    scenario = {"extends": "runway/circuit", "step_us": 4000, **changes}
    file = write_scenario(tmp_path, scenario)
    folders = [tmp_path / way for way in ("udp", "inside")]
    fly_well(file, "--out", str(folders[0]), "--record", "npz", "--free-ports")
    fly_well(file, "--out", str(folders[1]), "--record", "npz", "--in-process")
    over_udp, inside = (arrays_of(folder / "trajectory.npz")["state"] for folder in folders)
    assert np.array_equal(over_udp, inside)
    found = [[uav["ground"] for uav in summary_of(folder)["uavs"]] for folder in folders]
    assert found[0] == found[1]
    assert found[0][0]["outcome"] == outcome
