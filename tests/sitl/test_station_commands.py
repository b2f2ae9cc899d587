"""The commands that drive a running fleet, from outside: output and exit status."""

import json
import os
import signal
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from flying import BIN, SCENARIO_1, TIMEOUT_S, run, wait_until
from station import (
    ACCEPTED,
    BAD_INPUT,
    NO_ANSWER,
    REFUSED,
    SOMEDAY,
    Up,
    failed,
    flying_fleet,
    state_of,
    status_when,
)

from gcs.scenario.profile_file import load_profile
from mavlink_defs.capture.tlog import read_tlog

pytestmark = pytest.mark.sitl


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    with flying_fleet(tmp_path_factory.mktemp("fleet")) as fleet:
        yield fleet


def outcomes(answer: list[dict[str, Any]]) -> dict[int, str]:
    return {entry["uav"]: entry["outcome"] for entry in answer}


def test_status_asks_the_vehicles_for_everything(fleet: Up) -> None:
    def all_tell(states: list[dict[str, Any]]) -> bool:
        return len(states) == 3 and all(
            state["link"]["rate_hz"] > 5.0
            and not state["link"]["lost"]
            and None not in (state["time_s"], state["steps"], state["held"], state["profile"])
            and state["steps"] > 0
            and 500 * state["time_s"] - 500 < state["steps"] < 1000 * state["time_s"] + 500
            for state in states
        )

    status = status_when(fleet, all_tell)
    assert status["connection"] == fleet.hub
    assert [state["uav"] for state in status["vehicles"]] == [1, 2, 3]
    for state in status["vehicles"]:
        assert (state["armed"], state["ready"]) == (True, True)
        assert 30.0 < state["actual"]["airspeed_m_s"] < 60.0
        assert state["channels"]["aileron"]["events"] > 0
        assert 0.5 < state["saving"] < 1.0
        assert state["held"]["throttle"] > 0.0
    assert 0.5 < status["saving"] < 1.0
    assert len(status["vehicles"][0]["profile"]) == 3


def test_status_for_people(fleet: Up) -> None:
    done = fleet.gcs("status", "--uav", "1,2")
    assert (done.returncode, done.stderr) == (0, "")
    heading, *rows = done.stdout.splitlines()
    assert heading.split()[:2] == ["UAV", "link"]
    assert [row.split()[:3] for row in rows] == [["1", "up", "armed"], ["2", "up", "armed"]]
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_faults_are_set_listed_and_cleared(fleet: Up) -> None:
    done = fleet.gcs(
        "fault",
        "set",
        "rudder",
        "--uav",
        "2",
        "--effectiveness",
        "0.5",
        "--bias-deg",
        "1.5",
        *SOMEDAY,
        "--for-s",
        "2",
    )
    assert done.returncode == ACCEPTED, done.stderr
    assert done.stdout == "UAV 2: rudder at 50 % + 1.5 deg in (10000, 10002] s\n"
    fleet.gcs_json("fault", "set", "aileron", "--uav", "2", "--stuck-deg", "2", *SOMEDAY)
    (listed,) = fleet.gcs_json("fault", "list", "--uav", "2")
    expected = {
        "actuator": "rudder",
        "effectiveness": 0.5,
        "bias_deg": 1.5,
        "frequency_hz": 0.0,
        "start_s": 10_000.0,
        "end_s": 10_002.0,
        "active": False,
    }
    assert expected in listed["faults"]
    assert "aileron" in {fault["actuator"] for fault in listed["faults"]}
    assert fleet.gcs("fault", "clear", "--uav", "2", "--actuator", "rudder").returncode == 0
    (listed,) = fleet.gcs_json("fault", "list", "--uav", "2")
    assert [fault["actuator"] for fault in listed["faults"]] == ["aileron"]
    assert fleet.gcs("fault", "clear", "--uav", "2").returncode == ACCEPTED
    assert fleet.gcs("fault", "list", "--uav", "2").stdout == "UAV 2: no faults\n"


def test_a_fault_for_some_time_acts_now(fleet: Up) -> None:
    uav = ("--uav", "1")
    (before,) = fleet.gcs_json("fault", "list", *uav)
    fleet.gcs_json("fault", "set", "elevator", *uav, "--effectiveness", "0.99", "--for-s", "60")
    (after,) = fleet.gcs_json("fault", "list", *uav)
    (fault,) = (fault for fault in after["faults"] if fault["actuator"] == "elevator")
    assert fault["active"] is True
    times_s = [before["time_s"], fault["end_s"] - 60.0, fault["start_s"], after["time_s"]]
    assert times_s == pytest.approx(sorted(times_s), abs=0.01)
    assert fleet.gcs("fault", "clear", *uav, "--actuator", "elevator").returncode == 0


def test_a_sensor_of_an_aircraft_that_flies_by_its_true_state_cannot_fail(fleet: Up) -> None:
    sensor = ("fault", "sensor", "set", "airspeed", "--uav", "1", "--failure", "off")
    said = failed(fleet.gcs(*sensor), REFUSED)
    assert "has no airspeed that could fail" in said
    assert "navigation: estimated" in said
    (listed,) = fleet.gcs_json("fault", "list", "--uav", "1")
    assert not [fault for fault in listed["faults"] if "sensor" in fault]


def test_refusals_have_the_vehicle_s_reason(fleet: Up) -> None:
    done = fleet.gcs("fault", "set", "rudder", "--uav", "1,3", "--bias-deg", "80", *SOMEDAY)
    said = failed(done, REFUSED).splitlines()
    assert done.stdout == ""
    for uav, line in zip((1, 3), said, strict=True):
        assert f"UAV {uav}" in line
        assert "Value is 80 deg, must be -35 to 35 deg" in line
    answer = fleet.gcs_json("disarm", "--uav", "1", status=REFUSED)
    assert outcomes(answer) == {1: "refused"}
    assert "refused in flight" in answer[0]["reason"]


def test_arm_start_and_mode(fleet: Up) -> None:
    all_accept = {1: "accepted", 2: "accepted", 3: "accepted"}
    wait_until(lambda: outcomes(fleet.gcs_json("arm")) == all_accept, "all are found and armed")
    done = fleet.gcs("mode", "loiter", "--uav", "1")
    assert (done.returncode, done.stdout) == (ACCEPTED, "UAV 1 in mode LOITER\n")
    assert state_of(fleet, 1)["mode"] == "LOITER"
    done = fleet.gcs("start", "--uav", "1")
    assert (done.returncode, done.stdout) == (ACCEPTED, "UAV 1 started its mission\n")
    assert state_of(fleet, 1)["mode"] == "AUTO"
    assert "hover" in failed(fleet.gcs("mode", "hover"), BAD_INPUT)


def test_a_command_given_again_is_executed_again(fleet: Up) -> None:
    for mode in ("guided", "auto", "guided"):
        assert fleet.gcs("mode", mode, "--uav", "3").returncode == ACCEPTED
    assert state_of(fleet, 3)["mode"] == "GUIDED"
    assert fleet.gcs("mode", "auto", "--uav", "3").returncode == ACCEPTED


def test_profiles(fleet: Up, tmp_path: Path) -> None:
    mine, fast, held = (tmp_path / name for name in ("mine.yaml", "fast.yaml", "held.yaml"))
    mine.write_text("profile: [{start_s: 0, airspeed_m_s: 44.5, yaw_deg: -0.1}]\n")
    fast.write_text("profile: [{start_s: 0, airspeed_m_s: 200}]\n")
    assert run("gcs", "profile", "check", mine).returncode == ACCEPTED
    done = fleet.gcs("profile", "upload", mine, "--uav", "2")
    assert done.returncode == ACCEPTED, done.stderr
    assert done.stdout == f"UAV 2 holds 1 segment of {mine}\n"
    done = fleet.gcs("profile", "upload", fast, "--uav", "2")
    assert "airspeed 200, must be 20 to 80 m/s" in failed(done, REFUSED)
    assert fleet.gcs("profile", "check", mine, "--held", "--uav", "2").returncode == ACCEPTED
    done = fleet.gcs("profile", "check", SCENARIO_1, "--held", "--uav", "2")
    assert "UAV 2 holds another profile" in failed(done, REFUSED)
    assert fleet.gcs("profile", "download", "--uav", "2", "--out", held).returncode == ACCEPTED
    assert load_profile(held) == load_profile(mine)
    (answer,) = fleet.gcs_json("profile", "upload", SCENARIO_1, "--uav", "2")
    assert answer == {"uav": 2, "outcome": "accepted", "segments": 3}


def test_parameters(fleet: Up) -> None:
    listed = fleet.gcs("param", "list", "--uav", "1")
    assert listed.returncode == ACCEPTED, listed.stderr
    line = "UAV 1: TRIG_B2_DEG = 1 deg, range [0, 10] deg; Absolute threshold of a surface"
    assert line in listed.stdout
    (answer,) = fleet.gcs_json("param", "set", "TRIG_B2_DEG", "0.75", "--uav", "2")
    assert (answer["name"], answer["value"]) == ("TRIG_B2_DEG", 0.75)
    (answer,) = fleet.gcs_json("param", "get", "TRIG_B2_DEG", "--uav", "2")
    assert answer["value"] == 0.75
    assert "TRIG_B2_DEG" in failed(fleet.gcs("param", "set", "TRIG_B2_DEG", "-1"), REFUSED)
    assert "NO_SUCH_THING" in failed(fleet.gcs("param", "get", "NO_SUCH_THING"), REFUSED)
    assert fleet.gcs("param", "set", "TRIG_B2_DEG", "1").returncode == ACCEPTED


def test_parameters_in_files(fleet: Up, tmp_path: Path) -> None:
    file = str(tmp_path / "uav1.parm")
    assert "choose one" in failed(fleet.gcs("param", "save", file), BAD_INPUT)
    assert fleet.gcs("param", "save", file, "--uav", "1").returncode == ACCEPTED
    assert "already exists" in failed(fleet.gcs("param", "save", file, "--uav", "1"), BAD_INPUT)
    lines = Path(file).read_text().splitlines(keepends=True)
    scheduled = ("TRIG_A2_N", "K1_", "K2_")  # these change in flight
    Path(file).write_text("".join(line for line in lines if not line.startswith(scheduled)))
    assert fleet.gcs_json("param", "diff", file, "--uav", "1") == []
    assert fleet.gcs("param", "set", "TRIG_B2_DEG", "0.75", "--uav", "1,2").returncode == ACCEPTED
    done = fleet.gcs("param", "diff", file, "--uav", "1")
    assert done.stdout.splitlines() == ["UAV 1: TRIG_B2_DEG = 0.75, file 1"]
    answers = fleet.gcs_json("param", "load", file, "--uav", "1,2", "--yes")
    assert [answer["set"] for answer in answers] == [{"TRIG_B2_DEG": 1.0}] * 2
    (tmp_path / "bad.parm").write_text("TRIG_B2_DEG -1\nNO_SUCH_THING 1\nTRIG_B2_RATIO 0.11\n")
    done = fleet.gcs("param", "load", str(tmp_path / "bad.parm"), "--uav", "1", "--yes")
    message = failed(done, REFUSED)
    assert "TRIG_B2_DEG" in message
    assert "NO_SUCH_THING" in message
    assert fleet.gcs("param", "load", file, "--uav", "1", "--yes").returncode == ACCEPTED
    assert fleet.gcs_json("param", "diff", file, "--uav", "1") == []


def test_parameters_are_compared_with_their_defaults(fleet: Up) -> None:
    def differing() -> list[dict[str, Any]]:
        entries: list[dict[str, Any]] = fleet.gcs_json("param", "diff", "--uav", "1,2")
        return entries

    before = differing()
    assert {entry["uav"] for entry in before} <= {1, 2}
    assert all(entry["held"] not in entry["defaults"] for entry in before)
    assert fleet.gcs("param", "set", "TRIG_B2_DEG", "0.75", "--uav", "1").returncode == ACCEPTED
    entry = {"uav": 1, "name": "TRIG_B2_DEG", "held": 0.75, "defaults": [1.0]}
    assert [each for each in differing() if each not in before] == [entry]
    done = fleet.gcs("param", "diff", "--uav", "1")
    assert (done.returncode, done.stderr) == (ACCEPTED, "")
    assert "UAV 1: TRIG_B2_DEG = 0.75, default 1" in done.stdout.splitlines()
    assert fleet.gcs("param", "set", "TRIG_B2_DEG", "1", "--uav", "1").returncode == ACCEPTED
    assert differing() == before


def received(log: Path) -> Counter[tuple[int, str]]:
    """Count the frames of vehicles in a telemetry log, by system and type."""
    return Counter(
        (message.get_srcSystem(), message.get_type())
        for _, message in read_tlog(log)
        if message.get_srcSystem() != 255
    )


def test_record_for_some_time(fleet: Up, tmp_path: Path) -> None:
    log = tmp_path / "a.tlog"
    counts = fleet.gcs_json("record", log, "--for-s", "1")["messages"]
    by_system: Counter[str] = Counter()
    for (system, _), count in received(log).items():
        by_system[str(system)] += count
    assert by_system == counts
    assert counts.keys() <= {"1", "2", "3"}
    assert str(log) in failed(fleet.gcs("record", log), BAD_INPUT)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_record_until_it_is_stopped(fleet: Up, tmp_path: Path, number: signal.Signals) -> None:
    log = tmp_path / "b.tlog"
    expected = {
        (uav, name) for uav in (1, 2, 3) for name in ("ATTITUDE", "FTC_EVENTS", "HEARTBEAT")
    }
    record = fleet.begin("record", log, "--json")
    try:

        def enough() -> bool:
            assert record.poll() is None, record.communicate()
            counts = received(log) if log.exists() else Counter()
            return all(counts[key] > 3 for key in expected)

        wait_until(enough, "frames of all UAVs in the log")
        record.send_signal(number)
        stdout, stderr = record.communicate(timeout=TIMEOUT_S)
    finally:
        record.kill()
        record.communicate()
    assert (record.returncode, stderr) == (ACCEPTED, "")
    assert sum(json.loads(stdout)["messages"].values()) == received(log).total()


def test_who_is_not_there(fleet: Up, tmp_path: Path) -> None:
    done = fleet.gcs("arm", "--uav", "1,9", "--timeout", "5")  # several HEARTBEATs of UAV 1
    assert "UAV 9 not heard within 5 s" in failed(done, NO_ANSWER)
    assert done.stdout == ""
    said = failed(fleet.gcs("status", connect="udpout:127.0.0.1:1"), NO_ANSWER)
    assert "nobody listens at 127.0.0.1:1" in said
    missing = tmp_path / "none.tlog"
    connect = "udpout:127.0.0.1:1"
    failed(fleet.gcs("record", missing, "--timeout", "0.3", connect=connect), NO_ANSWER)
    assert not missing.exists()


def test_shell_completion_offers_actuators() -> None:
    done = subprocess.run(
        [BIN / "gcs"],
        capture_output=True,
        text=True,
        check=False,
        timeout=TIMEOUT_S,
        stdin=subprocess.DEVNULL,
        env=os.environ
        | {"_GCS_COMPLETE": "complete_bash", "COMP_WORDS": "gcs fault set ", "COMP_CWORD": "3"},
    )
    assert {"aileron", "rudder"} <= set(done.stdout.split()), done.stderr
