"""Telemetry logs, read by us and by pymavlink's own tool."""

import json
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogError, TlogWriter, read_tlog

START_US = 1_750_000_000_000_000


def frames() -> list[bytes]:
    mavlink = dialect.MAVLink(None, 1, 1)
    signing = dialect.MAVLink(None, 1, 1)
    signing.signing.secret_key = bytes(32)
    signing.signing.sign_outgoing = True
    heartbeat = dialect.MAVLink_heartbeat_message(1, 8, 0, 0, 4, 3)
    return [
        heartbeat.pack(mavlink),
        dialect.MAVLink_ftc_step_done_message(7).pack(mavlink),
        heartbeat.pack(mavlink, force_mavlink1=True),
        heartbeat.pack(signing),
    ]


def write(path: Path, records: list[bytes]) -> Path:
    with TlogWriter(path) as log:
        for i, frame in enumerate(records):
            log.write(frame, START_US + 4 * i)
    return path


def test_what_is_written_is_read(tmp_path: Path) -> None:
    records = list(read_tlog(write(tmp_path / "a.tlog", frames())))
    assert [t for t, _ in records] == [START_US + 4 * i for i in range(4)]
    assert [m.get_type() for _, m in records] == [
        "HEARTBEAT",
        "FTC_STEP_DONE",
        "HEARTBEAT",
        "HEARTBEAT",
    ]
    assert [bytes(m.get_msgbuf()) for _, m in records] == frames()


def test_mavlogdump_reads_it(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tlog", frames())
    tool = Path(sysconfig.get_path("scripts")) / "mavlogdump.py"
    done = subprocess.run(
        [sys.executable, tool, "--format=json", path],
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    kinds = [line["meta"]["type"] for line in lines]
    assert kinds == ["HEARTBEAT", f"UNKNOWN_{53101}", "HEARTBEAT", "HEARTBEAT"]
    assert lines[0]["meta"]["timestamp"] == pytest.approx(START_US * 1e-6, abs=1e-6)
    assert lines[0]["data"]["system_status"] == 4


@pytest.mark.parametrize("cut", [1, 8, 10, 20])
def test_a_last_record_that_was_cut_off_is_left_out(tmp_path: Path, cut: int) -> None:
    path = write(tmp_path / "a.tlog", frames()[:2])
    whole = path.read_bytes()
    path.write_bytes(whole + whole[:cut])
    assert len(list(read_tlog(path))) == 2


def test_damaged_and_unknown_frames_come_as_such(tmp_path: Path) -> None:
    heartbeat = bytearray(frames()[0])
    heartbeat[-1] ^= 1
    unknown = bytes([0xFD, 1, 0, 0, 0, 1, 1, 0xFF, 0xFF, 0xFF, 5, 0, 0])
    path = write(tmp_path / "a.tlog", [bytes(heartbeat), unknown, frames()[1]])
    kinds = [m.get_type() for _, m in read_tlog(path)]
    assert kinds == ["BAD_DATA", f"UNKNOWN_{0xFFFFFF}", "FTC_STEP_DONE"]


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    path.write_text("this is no log of any kind")
    with pytest.raises(TlogError, match=r"a\.tlog: no MAVLink frame at byte 8"):
        list(read_tlog(path))


def test_frames_reach_the_disk_before_the_end(tmp_path: Path, monkeypatch) -> None:
    clock = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    path = tmp_path / "a.tlog"
    with TlogWriter(path) as log:
        log.write(frames()[0], START_US)
        clock[0] = 1.5
        log.write(frames()[1], START_US)
        assert len(list(read_tlog(path))) == 2
