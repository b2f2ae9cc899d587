"""The kit on whole flights: relays of a scenario, `gcs wire`, `gcs wireshark` with tshark."""

import csv
import io
import json
import socket
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    BIN,
    CHANNELS,
    TIMEOUT_S,
    assert_one_message,
    environment,
    fly,
    fly_well,
    free_links,
    run,
    scenario_tree,
    summary_of,
    wait_until,
    write_scenario,
)
from needs import needs

from mavlink_defs import dialect
from mavlink_defs.capture.tlog import read_tlog

pytestmark = pytest.mark.sitl

LOSSY = {"plant": {"loss": 0.1, "seed": 3}}


def short_tree(duration_s: float) -> dict[str, Any]:
    profile = [
        {"start_s": 0.0, "airspeed_m_s": 40.0},
        {"start_s": duration_s / 4, "airspeed_m_s": 45.0, "roll_deg": 5.0, "pitch_deg": 5.0},
    ]
    return scenario_tree(duration_s=duration_s, profile=profile, faults=[])


def short_flight(
    folder: Path,
    duration_s: float,
    impairments: dict[str, Any],
    navigation: str = "true_state",
    **links: Any,
) -> Path:
    folder.mkdir(exist_ok=True)
    links = {**free_links(), "impairments": impairments, **links}
    return write_scenario(folder, short_tree(duration_s), links=links, navigation=navigation)


def flown(
    folder: Path,
    duration_s: float,
    impairments: dict[str, Any],
    navigation: str = "true_state",
    **links: Any,
) -> Path:
    """The run folder of a flight through relays."""
    scenario = short_flight(folder, duration_s, impairments, navigation, **links)
    fly_well(scenario, "--quiet", "--record=npz", "--out", folder / "run")
    return folder / "run"


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight whose links are all relayed and counted, but not impaired."""
    links: dict[str, Any] = {"plant": {}, "gcs": {}, "formation": {}}
    return flown(tmp_path_factory.mktemp("clean"), 1.0, links)


def wire_of(folder: Path) -> dict[str, Any]:
    report: dict[str, Any] = json.loads((folder / "wire.json").read_text())
    return report


def gcs_wire(*arguments: str | Path) -> str:
    done = run("gcs", "wire", *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def assert_counts_agree(wire: dict[str, Any], summary: dict[str, Any]) -> None:
    uavs = [uav for uav in wire["uavs"] if uav["link"] == "plant"]
    assert [uav["system"] for uav in uavs] == [uav["id"] for uav in summary["uavs"]]
    for counted, claimed in zip(uavs, summary["uavs"], strict=True):
        assert counted["periods"] == summary["steps"]
        for name in CHANNELS:
            for key in ("events", "min_interval_s"):
                assert counted["channels"][name][key] == claimed["channels"][name][key]
        assert counted["saving"] == pytest.approx(claimed["saving"], abs=1e-12)
        assert counted["messages"] - counted["repeats"] == claimed["actuator_messages"]
    assert wire["saving"] == pytest.approx(summary["saving"], abs=1e-12)


def test_the_tap_counts_what_the_summary_says(clean: Path) -> None:
    wire, summary = wire_of(clean), summary_of(clean)
    assert_counts_agree(wire, summary)
    assert [uav["repeats"] for uav in wire["uavs"]] == [0, 0, 0]
    to_neighbours = [m for m in wire["messages"] if m["message"] == "FTC_NEIGHBOUR"]
    assert {m["link"] for m in to_neighbours} == {"formation"}
    assert sum(m["frames"] for m in to_neighbours) >= 4 * summary["steps"]
    assert not any(link["dropped"] for link in wire["links"])


@pytest.mark.parametrize("navigation", ["true_state", "estimated"])
def test_a_lossy_lockstep_flight_ends_and_is_the_same_every_time(
    tmp_path: Path, navigation: str
) -> None:
    with ThreadPoolExecutor() as pool:  # they mostly wait for what was lost
        runs = list(pool.map(lambda name: flown(tmp_path / name, 0.15, LOSSY, navigation), "ab"))
    wires = [wire_of(folder) for folder in runs]
    for folder, wire in zip(runs, wires, strict=True):
        summary = summary_of(folder)
        assert summary["completed"]
        assert_counts_agree(wire, summary)  # a repeat is no event
        for fate in wire["fates"]:
            assert fate["delivered"] == fate["taken"] - fate["lost"]
            assert fate["lost"] == pytest.approx(0.1 * fate["taken"], rel=0.35)  # of 150: 1.4 σ
        repeats = [c["repeats"] for uav in summary["uavs"] for c in uav["channels"].values()]
        assert sum(repeats) > 0
        assert sum(uav["repeats"] for uav in wire["uavs"]) > 0
    with np.load(runs[0] / "events.npz") as a, np.load(runs[1] / "events.npz") as b:
        assert all(np.array_equal(a[key], b[key]) for key in a.files)


def test_a_bad_gcs_link_delays_nothing_in_the_air(tmp_path: Path) -> None:
    bad = {
        "loss": 0.1,
        "delay_ms": 20.0,
        "jitter_ms": 10.0,
        "duplicate": 0.1,
        "bit_errors": 1e-4,
        "reorder": 0.05,
        "outages": [{"from_s": 0.5, "to_s": 0.8}],
    }
    folder = flown(tmp_path, 1.0, {"gcs": bad}, telemetry_clock="simulated")
    wire = wire_of(folder)
    assert_counts_agree(wire, summary_of(folder))
    fates = {(f["link"], f["direction"]): f for f in wire["fates"] if f["link"] == "gcs"}
    to = fates["gcs", "to"]
    assert all(to[key] > 0 for key in ("lost", "duplicated", "damaged", "outage", "reordered"))
    times_s = [
        m.time_boot_ms / 1e3
        for _, m in read_tlog(folder / "flight.tlog")
        if isinstance(m, dialect.MAVLink_ftc_tracking_message) and m.time_boot_ms > 0
    ]
    assert times_s
    assert not [t for t in times_s if 0.5 < t < 0.8]


def test_impairments_need_a_wire(tmp_path: Path) -> None:
    done = fly(short_flight(tmp_path, 0.1, LOSSY), "--in-process", "--out", tmp_path / "run")
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert "links.impairments" in done.stderr


def test_gcs_wire_reads_the_telemetry_log_of_a_flight(clean: Path, tmp_path: Path) -> None:
    report = json.loads(gcs_wire(clean / "flight.tlog", "--json", "--csv", tmp_path / "a.csv"))
    frames: Counter[tuple[int, str]] = Counter()
    for _, message in read_tlog(clean / "flight.tlog"):
        frames[message.get_srcSystem(), message.get_type()] += 1
    counted = {(m["system"], m["message"]): m["frames"] for m in report["messages"]}
    assert counted == frames
    assert {m["direction"] for m in report["messages"] if m["system"] == 255} == {"from"}
    assert report["saving"] == pytest.approx(summary_of(clean)["saving"], abs=1e-12)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "a.csv").read_text())))
    messages = [row for row in rows if row["kind"] == "message"]
    assert sum(int(row["count"]) for row in messages) == frames.total()
    assert len([row for row in rows if row["kind"] == "channel"]) == 12


def test_gcs_wire_shows_the_relays_report_of_a_flight(clean: Path) -> None:
    shown = gcs_wire(clean / "wire.json")
    for text in ("Actuator transmissions", "HIL_ACTUATOR_CONTROLS", "FTC_NEIGHBOUR", "to plant"):
        assert text in shown
    assert f"saved {100 * summary_of(clean)['saving']:.2f} %" in shown


# captures, and Wireshark with our dissector


HIL_SENSOR, HIL_GPS, SIM_STATE, SIM_STEP = 107, 113, 53100, 53111


class Capture:
    """A capture of tshark on the loopback interface; skips the test where it is not permitted."""

    def __init__(self, path: Path, port: int) -> None:
        self.path = path
        self._popen = subprocess.Popen(
            ["tshark", "-i", "lo", "-f", f"udp port {port}", "-w", path, "-q", "-B", "64"],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._port = port
        self._wait_for(b"first")  # the file appears before the capture begins
        if self._popen.returncode is not None:
            pytest.skip(f"tshark may not capture here: {self._popen.communicate()[1].strip()}")

    def stop(self) -> None:
        """End the capture when all that was sent before is in the file."""
        self._wait_for(b"last")
        self._popen.terminate()
        self._popen.communicate(timeout=TIMEOUT_S)

    def _wait_for(self, probe: bytes) -> None:
        """Send a datagram of our own until it is in the file, or the capture has ended."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:

            def captured() -> bool:
                sock.sendto(probe, ("127.0.0.1", self._port))
                return self._popen.poll() is not None or (
                    self.path.exists() and probe in self.path.read_bytes()
                )

            wait_until(captured, f"tshark captures {probe!r}")


@needs("tshark")
@pytest.mark.parametrize("navigation", ["true_state", "estimated"])
def test_tshark_gcs_wire_and_the_summary_count_the_same(tmp_path: Path, navigation: str) -> None:
    links = free_links()
    port = links["plant_port"]
    scenario = write_scenario(tmp_path, short_tree(0.4), links=links, navigation=navigation)
    lua = tmp_path / "ftc.lua"
    assert run("gcs", "wireshark", "--out", lua, "--port", str(port)).returncode == 0
    capture = Capture(tmp_path / "plant.pcapng", port)
    try:
        fly_well(scenario, "--quiet", "--out", tmp_path / "run")
    finally:
        capture.stop()
    report = json.loads(gcs_wire(capture.path, "--link", f"plant={port}", "--json"))
    assert_counts_agree(report, summary_of(tmp_path / "run"))
    dissected = subprocess.run(
        [
            "tshark",
            "-r",
            capture.path,
            "-X",
            f"lua_script:{lua}",
            "-Y",
            "mavlink_proto.sysid",
            "-T",
            "fields",
            "-e",
            "mavlink_proto.sysid",
            "-e",
            "mavlink_proto.msgid",
        ],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=True,
    )
    seen = Counter(tuple(map(int, line.split("\t"))) for line in dissected.stdout.splitlines())
    counted: Counter[tuple[int, int]] = Counter()
    for row in report["messages"]:
        counted[row["system"], row["message_id"]] += row["frames"]
    assert seen == counted
    sensors = {HIL_SENSOR, HIL_GPS, SIM_STEP} if navigation == "estimated" else {SIM_STATE}
    assert {number for _, number in seen} & {HIL_SENSOR, HIL_GPS, SIM_STEP, SIM_STATE} == sensors


def test_gcs_wire_relays_impairs_and_counts_until_it_is_stopped(tmp_path: Path) -> None:
    links = free_links()
    front = free_links()["plant_port"]
    relay = f"127.0.0.1:{front}=127.0.0.1:{links['plant_port']}"
    links["plant_relay"] = f"127.0.0.1:{front}"
    popen = subprocess.Popen(
        [
            BIN / "gcs",
            "wire",
            "--relay",
            relay,
            "--impair",
            "loss=0.02,delay_ms=1,seed=3",
            "--link",
            f"plant={links['plant_port']}",
            "--json",
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    try:
        fly_well(
            write_scenario(tmp_path, short_tree(0.2), links=links),
            "--quiet",
            "--out",
            tmp_path / "run",
        )
    finally:
        popen.terminate()
        out, text = popen.communicate(timeout=TIMEOUT_S)
    assert popen.returncode == 0, text
    assert f"plant: relaying 127.0.0.1:{front} to" in text
    report = json.loads(out)
    assert_counts_agree(report, summary_of(tmp_path / "run"))
    assert sum(fate["lost"] for fate in report["fates"]) > 0
