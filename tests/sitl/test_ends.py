"""Flights that hit the ground or whose law fails end alike over UDP and in one process."""

import json
from pathlib import Path
from typing import Any

import pytest
from flying import assert_one_message, fly, scenario_tree, summary_of, write_scenario

from mavlink_defs.capture.tlog import read_tlog
from mavlink_defs.dialect import MAVLink_statustext_message
from mavlink_defs.services.statustext import TextAssembler

pytestmark = pytest.mark.sitl


def texts_of(path: Path, system: int) -> list[str]:
    """Return what a UAV said in a flight."""
    assembler = TextAssembler()
    texts = []
    for t, message in read_tlog(path):
        if isinstance(message, MAVLink_statustext_message) and message.get_srcSystem() == system:
            texts += [text.text for text in assembler.receive(message, t * 1e-6)]
    return texts


def flown_both_ways(tmp_path: Path, tree: dict[str, Any]) -> list[dict[str, Any]]:
    """Fly with exit status 1 and one message over UDP and in process; return the summaries."""
    scenario = write_scenario(tmp_path, tree)
    summaries = []
    for how in ("--free-ports", "--in-process"):
        folder = tmp_path / how.strip("-")
        done = fly(scenario, how, "--json", "--out", folder)
        assert done.returncode == 1, done.stderr
        assert_one_message(done.stderr)
        summary = summary_of(folder)
        assert summary == json.loads(done.stdout)
        summaries.append(summary)
    for summary in summaries:
        for key in ("mode", "wall_s", "real_time_factor"):
            del summary[key]
    assert summaries[0] == summaries[1]
    return summaries


def test_an_aircraft_that_hits_the_ground_is_lost_and_says_so(tmp_path: Path) -> None:
    tree = scenario_tree(duration_s=1.0, faults=[])
    tree["uavs"][1]["initial"] |= {"altitude_m": 2.0, "pitch_deg": -30.0}
    summary, _ = flown_both_ways(tmp_path, tree)
    assert "UAV 2 was lost" in summary["loss"]
    assert "it hit the ground" in summary["loss"]
    lowest = [uav["lowest_altitude_m"] for uav in summary["uavs"]]
    assert lowest[1] < 0.0 < min(lowest[0], lowest[2])
    said = texts_of(tmp_path / "free-ports" / "flight.tlog", 2)
    assert any(text.startswith("hit the ground at 0.") for text in said), said
    assert not any(
        "ground" in text for text in texts_of(tmp_path / "free-ports" / "flight.tlog", 1)
    )


def test_a_law_that_fails_is_reported_and_the_flight_is_no_success(tmp_path: Path) -> None:
    tree = scenario_tree(duration_s=0.3, faults=[])
    tree["controller"] = {"kind": "pid", "speed_p_n_s_m": 1e308}
    tree["uavs"][2]["initial"]["airspeed_m_s"] = 45.0
    summary, _ = flown_both_ways(tmp_path, tree)
    assert "the law of UAV 3 gave no finite command of throttle at 0 s" in summary["loss"]
    assert summary["uavs"][2]["control_failure"]["time_s"] == 0.0
    said = texts_of(tmp_path / "free-ports" / "flight.tlog", 3)
    assert sum("no finite command of throttle" in text for text in said) == 1, said
