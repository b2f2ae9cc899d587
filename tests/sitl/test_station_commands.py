"""The commands that drive a running fleet, from outside: output and exit status."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    BIN,
    SCENARIO_1,
    TIMEOUT_S,
    arrays_of,
    assert_one_message,
    flying,
    process_of,
    processes_of,
    run,
    scenario_tree,
    wait_until,
    write_scenario,
)
from station import LossyRelay, Up, up

from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import event_table
from gcs.scenario.model import Scenario
from gcs.scenario.profile_file import load_profile
from mavlink_defs.capture.tlog import read_tlog

pytestmark = pytest.mark.sitl

ACCEPTED, BAD_INPUT, REFUSED, NO_ANSWER = 0, 2, 3, 4
SOMEDAY = ("--start-s", "10000")  # a fault that is set but never acts
GONE_S = 15.0
FLOWN_S = 12.0  # of scenario 1 in a test; it is made for 24 s


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    """Scenario 1, flying in real time; in the end its `gcs up` is killed, and nothing is left."""
    with up(tmp_path_factory.mktemp("fleet"), "--start") as fleet:
        yield fleet
        assert len(processes_of(fleet.folder)) == 5
        assert fleet.stop(signal.SIGKILL)[0] == -signal.SIGKILL
        wait_until(lambda: not processes_of(fleet.folder), "no process is left", GONE_S)


def words(done: Any, status: int) -> str:
    """What a command that failed in this way said."""
    assert done.returncode == status, (done.stdout, done.stderr)
    assert_one_message(done.stderr)
    return str(done.stderr)


def outcomes(answer: list[dict[str, Any]]) -> dict[int, str]:
    return {entry["uav"]: entry["outcome"] for entry in answer}


def state_of(fleet: Up, uav: int) -> dict[str, Any]:
    (state,) = fleet.gcs_json("status", "--uav", str(uav))["vehicles"]
    return dict(state)


def test_status_asks_the_vehicles_for_everything(fleet: Up) -> None:
    status = fleet.gcs_json("status")
    assert status["connection"] == fleet.hub
    assert [state["uav"] for state in status["vehicles"]] == [1, 2, 3]
    for state in status["vehicles"]:
        assert (state["link"]["lost"], state["armed"], state["ready"]) == (False, True, True)
        assert state["link"]["rate_hz"] > 5.0
        assert state["time_s"] > 0.0
        assert 30.0 < state["actual"]["airspeed_m_s"] < 60.0
        assert state["steps"] == pytest.approx(1000 * state["time_s"], abs=500)
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
    fleet.gcs_json(
        "fault", "set", "elevator", "--uav", "1", "--effectiveness", "0.99", "--for-s", "60"
    )
    (listed,) = fleet.gcs_json("fault", "list", "--uav", "1")
    (fault,) = (fault for fault in listed["faults"] if fault["actuator"] == "elevator")
    assert fault["active"] is True
    assert fault["end_s"] - fault["start_s"] == pytest.approx(60.0, abs=1.0)
    assert fleet.gcs("fault", "clear", "--uav", "1", "--actuator", "elevator").returncode == 0


def test_refusals_have_the_vehicle_s_reason(fleet: Up) -> None:
    done = fleet.gcs("fault", "set", "rudder", "--uav", "1,3", "--bias-deg", "80", *SOMEDAY)
    said = words(done, REFUSED).splitlines()
    assert done.stdout == ""
    for uav, line in zip((1, 3), said, strict=True):
        assert f"UAV {uav}" in line
        assert "Value is 80 deg, must be -35 to 35 deg" in line
    answer = fleet.gcs_json("disarm", "--uav", "1", status=REFUSED)
    assert outcomes(answer) == {1: "refused"}
    assert "refused in flight" in answer[0]["reason"]


def test_arm_start_and_mode(fleet: Up) -> None:
    assert outcomes(fleet.gcs_json("arm")) == {1: "accepted", 2: "accepted", 3: "accepted"}
    done = fleet.gcs("mode", "loiter", "--uav", "1")
    assert (done.returncode, done.stdout) == (ACCEPTED, "UAV 1 in mode LOITER\n")
    assert state_of(fleet, 1)["mode"] == "LOITER"
    done = fleet.gcs("start", "--uav", "1")
    assert (done.returncode, done.stdout) == (ACCEPTED, "UAV 1 started its mission\n")
    assert state_of(fleet, 1)["mode"] == "AUTO"
    assert "hover" in words(fleet.gcs("mode", "hover"), BAD_INPUT)


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
    assert "airspeed 200, must be 20 to 80 m/s" in words(done, REFUSED)
    assert fleet.gcs("profile", "check", mine, "--held", "--uav", "2").returncode == ACCEPTED
    done = fleet.gcs("profile", "check", SCENARIO_1, "--held", "--uav", "2")
    assert "UAV 2 holds another profile" in words(done, REFUSED)
    assert fleet.gcs("profile", "download", "--uav", "2", "--out", held).returncode == ACCEPTED
    assert load_profile(held) == load_profile(mine)
    (answer,) = fleet.gcs_json("profile", "upload", SCENARIO_1, "--uav", "2")
    assert answer == {"uav": 2, "outcome": "accepted", "segments": 3}


def test_parameters(fleet: Up) -> None:
    listed = fleet.gcs("param", "list", "--uav", "1")
    assert listed.returncode == ACCEPTED, listed.stderr
    assert "UAV 1: TRIG_B2_DEG = 1 deg (>= 0 deg); Absolute threshold of a surface" in listed.stdout
    (answer,) = fleet.gcs_json("param", "set", "TRIG_B2_DEG", "0.75", "--uav", "2")
    assert (answer["name"], answer["value"]) == ("TRIG_B2_DEG", 0.75)
    (answer,) = fleet.gcs_json("param", "get", "TRIG_B2_DEG", "--uav", "2")
    assert answer["value"] == 0.75
    assert "TRIG_B2_DEG" in words(fleet.gcs("param", "set", "TRIG_B2_DEG", "-1"), REFUSED)
    assert "NO_SUCH_THING" in words(fleet.gcs("param", "get", "NO_SUCH_THING"), REFUSED)
    assert fleet.gcs("param", "set", "TRIG_B2_DEG", "1").returncode == ACCEPTED


def test_record(fleet: Up, tmp_path: Path) -> None:
    log = tmp_path / "a.tlog"
    counts = fleet.gcs_json("record", log, "--for-s", "1")["messages"]
    assert set(counts) == {"1", "2", "3"}
    assert all(count > 10 for count in counts.values())
    received = [m for _, m in read_tlog(log) if m.get_srcSystem() != 255]
    assert len(received) == sum(counts.values())
    assert {"ATTITUDE", "FTC_EVENTS"} <= {message.get_type() for message in received}
    assert str(log) in words(fleet.gcs("record", log), BAD_INPUT)
    going_on = fleet.begin("record", tmp_path / "b.tlog")
    wait_until((tmp_path / "b.tlog").exists, "recording begins")
    going_on.send_signal(signal.SIGTERM)
    _, stderr = going_on.communicate(timeout=TIMEOUT_S)
    assert going_on.returncode in {ACCEPTED, NO_ANSWER}, stderr


def test_who_is_not_there(fleet: Up, tmp_path: Path) -> None:
    done = fleet.gcs("arm", "--uav", "1,9", "--timeout", "1")
    assert "UAV 9 not heard within 1 s" in words(done, NO_ANSWER)
    assert done.stdout == ""
    said = words(fleet.gcs("status", connect="udpout:127.0.0.1:1"), NO_ANSWER)
    assert "nobody listens at 127.0.0.1:1" in said
    missing = tmp_path / "none.tlog"
    connect = "udpout:127.0.0.1:1"
    words(fleet.gcs("record", missing, "--timeout", "0.3", connect=connect), NO_ANSWER)
    assert not missing.exists()


def test_many_ground_stations_at_a_time(fleet: Up, tmp_path: Path) -> None:
    direct, output = f"udpin:127.0.0.1:{fleet.gcs_port}", tmp_path / "lines"
    holder = fleet.begin("status", "--watch", "--json", connect=direct, output=output)
    try:
        wait_until(lambda: "\n" in output.read_text(), "the first station hears the fleet")
        done = fleet.gcs("status", connect=direct)
        assert str(fleet.gcs_port) in words(done, BAD_INPUT)
        assert "hub" in done.stderr
        parallel = [fleet.begin("mode", "auto", "--uav", "1,3") for _ in range(2)]
        for one in parallel:
            stdout, stderr = one.communicate(timeout=TIMEOUT_S)
            assert (one.returncode, stderr) == (ACCEPTED, "")
            assert stdout == "UAV 1 in mode AUTO\nUAV 3 in mode AUTO\n"
        holder.send_signal(signal.SIGINT)
        _, stderr = holder.communicate(timeout=TIMEOUT_S)
        assert (holder.returncode, stderr) == (0, "")
        for line in output.read_text().splitlines():
            assert len(json.loads(line)["vehicles"]) == 3
    finally:
        holder.kill()
        holder.communicate()


def test_commands_over_a_lossy_link(fleet: Up, tmp_path: Path) -> None:
    profile = tmp_path / "long.yaml"
    segments = [f"  - {{start_s: {10 * i}, airspeed_m_s: {40 + i}}}" for i in range(8)]
    profile.write_text("\n".join(["profile:", *segments]))
    with LossyRelay(fleet.hub, loss=0.15) as relay:
        for arguments in (
            ("fault", "set", "throttle", "--uav", "3", "--bias-n", "1", *SOMEDAY),
            ("profile", "upload", profile, "--uav", "3"),
        ):
            done = fleet.gcs(*arguments, connect=relay.connect)
            assert done.returncode == ACCEPTED, done.stderr
        state = json.loads(fleet.gcs("status", "--json", connect=relay.connect).stdout)
        assert relay.lost > 10
    held = state["vehicles"][2]
    assert len(held["profile"]) == 8
    assert "throttle" in {fault["actuator"] for fault in held["faults"]}
    assert fleet.gcs("profile", "upload", SCENARIO_1, "--uav", "3").returncode == ACCEPTED
    assert fleet.gcs("fault", "clear", "--uav", "3", "--actuator", "throttle").returncode == 0


def test_an_operator_s_session(tmp_path: Path) -> None:
    """Waiting, a vehicle that falls silent, start, arm, a dead autopilot, Ctrl-C."""
    with up(tmp_path / "a session") as fleet:
        states = fleet.gcs_json("status")["vehicles"]
        assert [(s["armed"], s["time_s"], s["steps"]) for s in states] == [(False, 0.0, 0)] * 3
        assert [len(s["profile"]) for s in states] == [3, 3, 3]
        assert [len(s["faults"]) for s in states] == [0, 0, 1]
        watch_silence(fleet)
        assert fleet.gcs("start").returncode == ACCEPTED
        assert state_of(fleet, 1)["time_s"] == 0.0
        assert fleet.gcs("arm").returncode == ACCEPTED
        wait_until(lambda: state_of(fleet, 1)["time_s"] > 0.0, "simulated time runs")
        os.kill(process_of(fleet.folder, "uav2"), signal.SIGKILL)
        said = words(fleet.gcs("status", "--uav", "2", "--timeout", "1.5"), NO_ANSWER)
        assert "UAV 2" in said
        assert [s["uav"] for s in fleet.gcs_json("status")["vehicles"]] == [1, 3]
        restart_and_arm(fleet)
        status, stderr = fleet.stop()
        assert status == 0
        ended, back = stderr.splitlines()
        assert ended.startswith("uav2: ended by signal 9")
        config = fleet.folder / "processes" / "uav2.yaml"
        assert (
            f"`ftc-autopilot '{config}'` starts it again, disarmed and without a profile" in ended
        )
        assert back.startswith("uav2 is back, disarmed and without a profile: `gcs profile upload ")
        assert not processes_of(fleet.folder)


def restart_and_arm(fleet: Up) -> None:
    config = fleet.folder / "processes" / "uav2.yaml"
    autopilot = subprocess.Popen([BIN / "ftc-autopilot", config])
    try:
        wait_until(lambda: bool(state_of(fleet, 2)["ready"]), "the autopilot is back")
        assert fleet.gcs("arm", "--uav", "2").returncode == ACCEPTED
        assert state_of(fleet, 2)["steps"] < state_of(fleet, 1)["steps"]
    finally:
        autopilot.terminate()
        autopilot.wait(TIMEOUT_S)


def watch_silence(fleet: Up) -> None:
    watch = fleet.begin("status", "--watch", "--json")
    autopilot = process_of(fleet.folder, "uav2")
    try:
        assert watch.stdout is not None
        lost = []
        for line in watch.stdout:
            states = json.loads(line)["vehicles"]
            now = {state["uav"] for state in states if state["link"]["lost"]}
            lost.append(now)
            if not now and len(lost) == 1:
                os.kill(autopilot, signal.SIGSTOP)
            elif now:
                assert now == {2}
                os.kill(autopilot, signal.SIGCONT)
            elif {2} in lost:
                break
        assert len(lost) < 8
    finally:
        os.kill(autopilot, signal.SIGCONT)
        watch.kill()
        watch.communicate()


def test_a_lost_flight_ends_the_fleet(tmp_path: Path) -> None:
    tree = scenario_tree()
    tree["aircraft"]["thrust_limit_n"] = 1e5  # beyond 300 m/s, where the model ends
    tree["faults"] = [{"uav": 2, "actuator": "throttle", "stuck_n": 1e5, "start_s": 2.0}]
    with up(tmp_path, "--lockstep", "--start", tree=tree) as fleet:
        _, stderr = fleet.popen.communicate(timeout=TIMEOUT_S)
        assert fleet.popen.returncode == 1
        assert_one_message(stderr)
        assert "UAV 2 was lost" in stderr
        assert not processes_of(fleet.folder)


@pytest.fixture(scope="module")
def reference(scenario1: Scenario) -> dict[str, np.ndarray]:
    """Events of scenario 1, flown in one process."""
    return event_table(fly_in_process(scenario1))


def test_stopped_and_killed_ground_stations_change_nothing(
    tmp_path: Path, reference: dict[str, np.ndarray]
) -> None:
    """Lockstep events are those of the flight in one process, whatever becomes of stations."""
    with up(tmp_path, "--lockstep") as fleet:
        log = tmp_path / "events.tlog"
        direct = f"udpin:127.0.0.1:{fleet.gcs_port}"
        stations = [
            fleet.begin("status", "--watch", "--json", connect=direct),
            fleet.begin("status", "--watch", "--json"),
            fleet.begin("status", "--watch", "--json"),
            fleet.begin("record", log),
        ]
        frozen, doomed, watch, recorder = stations
        try:
            for station in (frozen, doomed, watch):
                assert station.stdout is not None
                assert station.stdout.readline()
            wait_until(lambda: log.exists() and log.stat().st_size > 0, "recording begins")
            assert fleet.gcs("start").returncode == ACCEPTED
            assert fleet.gcs("arm").returncode == ACCEPTED
            frozen.send_signal(signal.SIGSTOP)
            doomed.kill()
            assert watch.stdout is not None
            for line in watch.stdout:
                if all(state["time_s"] > FLOWN_S for state in json.loads(line)["vehicles"]):
                    break
            recorder.send_signal(signal.SIGINT)
            assert recorder.wait(TIMEOUT_S) == 0
            assert fleet.stop(signal.SIGTERM) == (0, "")
            assert not processes_of(fleet.folder)
        finally:
            for station in stations:
                station.kill()
                station.communicate()
    compare_events(log, reference)


def compare_events(log: Path, reference: dict[str, np.ndarray]) -> None:
    compared = {1: 0, 2: 0, 3: 0}
    message: Any
    for _, message in read_tlog(log):
        if message.get_type() == "FTC_EVENTS" and 0 < message.steps <= 1000 * FLOWN_S:
            uav = message.get_srcSystem()
            so_far = (reference["uav"] == uav) & (reference["step"] < message.steps)
            expected = [int((reference["channel"][so_far] == c).sum()) for c in range(4)]
            assert message.events == expected, (uav, message.steps)
            compared[uav] += 1
    assert min(compared.values()) > 30


def test_a_stopped_flight_goes_on_the_same(
    tmp_path: Path, reference: dict[str, np.ndarray]
) -> None:
    """`gcs fly` itself is stopped in mid-flight."""
    folder = tmp_path / "run"
    with flying(folder, write_scenario(tmp_path, duration_s=FLOWN_S), "--quiet") as popen:
        os.kill(popen.pid, signal.SIGSTOP)
        log = folder / "processes" / "uav1.npz"
        wait_until(log.exists, "the fleet has flown to its end")
        os.kill(popen.pid, signal.SIGCONT)
        _, stderr = popen.communicate(timeout=TIMEOUT_S)
        assert popen.returncode == 0, stderr
    flown = arrays_of(folder / "events.npz")
    assert flown.keys() == reference.keys()
    early = reference["step"] < 1000 * FLOWN_S
    for name, values in reference.items():
        assert np.array_equal(flown[name], values[early]), name


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
