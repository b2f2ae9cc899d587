"""Sessions of operators: several stations at a time, bad links, processes that die."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from flying import (
    BIN,
    SCENARIO_1,
    TIMEOUT_S,
    assert_one_message,
    process_of,
    processes_of,
    scenario_tree,
    wait_until,
)
from station import (
    ACCEPTED,
    ALL,
    BAD_INPUT,
    NO_ANSWER,
    SOMEDAY,
    LossyRelay,
    Up,
    failed,
    flying_fleet,
    state_of,
    status_when,
    up,
)

pytestmark = pytest.mark.sitl


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    with flying_fleet(tmp_path_factory.mktemp("fleet")) as fleet:
        yield fleet


def numbers_of_vehicles(output: Path) -> list[int]:
    """Return how many vehicles each whole line of `status --watch --json` shows."""
    lines = output.read_text().split("\n")[:-1]
    return [len(json.loads(line)["vehicles"]) for line in lines]


def test_many_ground_stations_at_a_time(fleet: Up, tmp_path: Path) -> None:
    direct, output = f"udpin:127.0.0.1:{fleet.gcs_port}", tmp_path / "lines"
    holder = fleet.begin("status", "--watch", "--json", connect=direct, output=output)
    try:
        wait_until(lambda: 3 in numbers_of_vehicles(output), "the first station hears the fleet")
        done = fleet.gcs("status", connect=direct)
        assert str(fleet.gcs_port) in failed(done, BAD_INPUT)
        assert "hub" in done.stderr
        parallel = [fleet.begin("mode", "auto", "--uav", "1,3") for _ in range(2)]
        for one in parallel:
            stdout, stderr = one.communicate(timeout=TIMEOUT_S)
            assert (one.returncode, stderr) == (ACCEPTED, "")
            assert stdout == "UAV 1 in mode AUTO\nUAV 3 in mode AUTO\n"
        holder.send_signal(signal.SIGINT)
        _, stderr = holder.communicate(timeout=TIMEOUT_S)
        assert (holder.returncode, stderr) == (0, "")
        numbers = numbers_of_vehicles(output)
        assert numbers == sorted(numbers)  # once it was heard, no vehicle is gone
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

        def received() -> bool:
            ask = ("status", "--uav", "3", "--json")
            held = json.loads(fleet.gcs(*ask, connect=relay.connect).stdout)["vehicles"][0]
            return (
                len(held["profile"] or ()) == 8
                and "throttle" in {fault["actuator"] for fault in held["faults"] or ()}
                and relay.lost > 10
            )

        wait_until(received, "profile and fault over the lossy link")
    assert fleet.gcs("profile", "upload", SCENARIO_1, "--uav", "3").returncode == ACCEPTED
    assert fleet.gcs("fault", "clear", "--uav", "3", "--actuator", "throttle").returncode == 0


def far_above_ground() -> dict[str, Any]:
    """Scenario 1 so high that an aircraft without its autopilot does not hit the ground."""
    tree = scenario_tree()
    for uav in tree["uavs"]:
        uav["initial"]["altitude_m"] = 8000.0
    return tree


def test_an_operator_s_session(tmp_path: Path) -> None:
    """Waiting, a vehicle that falls silent, start, arm, a dead autopilot, Ctrl-C."""
    with up(tmp_path / "a session", "--restart", "never", tree=far_above_ground()) as fleet:
        states = [state_of(fleet, uav) for uav in (1, 2, 3)]
        assert [(s["armed"], s["time_s"], s["steps"]) for s in states] == [(False, 0.0, 0)] * 3
        assert [len(s["profile"]) for s in states] == [3, 3, 3]
        assert [len(s["faults"]) for s in states] == [0, 0, 1]
        watch_silence(fleet, tmp_path / "lines")
        assert fleet.gcs("start", *ALL).returncode == ACCEPTED
        assert state_of(fleet, 1)["time_s"] == 0.0
        assert fleet.gcs("arm", *ALL).returncode == ACCEPTED
        wait_until(lambda: state_of(fleet, 1)["time_s"] > 0.0, "simulated time runs")
        os.kill(process_of(fleet.folder, "uav2"), signal.SIGKILL)
        said = failed(fleet.gcs("status", "--uav", "2", "--timeout", "1.5"), NO_ANSWER)
        assert "UAV 2" in said
        status_when(fleet, lambda states: [s["uav"] for s in states] == [1, 3])
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


def watch_silence(fleet: Up, output: Path) -> None:
    """Stop the autopilot of UAV 2 until `status --watch` shows its link lost, and let it go on."""
    watch = fleet.begin("status", "--watch", "--json", output=output)
    autopilot = process_of(fleet.folder, "uav2")

    def see(lost: bool) -> None:
        def shown() -> bool:
            assert watch.poll() is None, watch.communicate()
            *lines, _ = output.read_text().split("\n")  # the last one may not be whole
            vehicles = json.loads(lines[-1])["vehicles"] if lines else []
            return {v["uav"]: v["link"]["lost"] for v in vehicles} == {1: False, 2: lost, 3: False}

        wait_until(shown, f"UAV 2 lost: {lost}")

    try:
        see(lost=False)
        os.kill(autopilot, signal.SIGSTOP)
        see(lost=True)
        os.kill(autopilot, signal.SIGCONT)
        see(lost=False)
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
