"""Signed fleets: they fly as unsigned ones do, and do not listen to strangers."""

import hashlib
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    TIMEOUT_S,
    arrays_of,
    fly_well,
    free_links,
    processes_of,
    run,
    scenario_tree,
    standing,
    wait_until,
    write_scenario,
)
from pymavlink import mavutil

from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs import dialect
from mavlink_defs.framing.signing import Signer, make_key

pytestmark = pytest.mark.sitl

KEY = bytes(range(1, 33))
ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED


class Stranger:
    """A pymavlink ground station on the GCS port that hears UAV 1."""

    def __init__(self, scenario: Scenario) -> None:
        mavutil.mavlink = dialect
        address = f"udpin:127.0.0.1:{scenario.links.gcs_port}"
        self.link: Any = mavutil.mavlink_connection(address, source_system=254, dialect="common")
        self.link.mav = dialect.MAVLink(self.link, srcSystem=254, srcComponent=1)
        self.link.mav.robust_parsing = True

    def sign(self, key: bytes | None) -> None:
        if key is None:
            self.link.disable_signing()
        else:
            self.link.setup_signing(key, allow_unsigned_callback=lambda *_: False)

    def hear(self, kind: str, timeout_s: float = TIMEOUT_S, **fields: Any) -> Any:
        """The next message of UAV 1 of this kind with these fields, or None."""
        end = time.monotonic() + timeout_s
        while (left := end - time.monotonic()) > 0.0:
            found = self.link.recv_match(type=kind, blocking=True, timeout=left)
            same = found is not None and found.get_srcSystem() == 1
            if same and all(getattr(found, k) == v for k, v in fields.items()):
                return found
        return None

    def said(self, part: str) -> bool:
        """Wait for a STATUSTEXT of UAV 1 that contains `part`; False if none comes."""
        while (text := self.hear("STATUSTEXT")) is not None:
            if part in text.text:
                return True
        return False

    def command(self, number: int, *params: float) -> None:
        values = [*params, *[0.0] * (7 - len(params))]
        self.link.mav.command_long_send(1, 1, number, 0, *values)

    def set_key(self, key: bytes) -> None:
        self.link.mav.setup_signing_send(1, 1, list(key), int((time.time() - 1420070400) * 1e5))


@pytest.fixture
def fleet(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[tuple[Scenario, Path]]:
    """One UAV in lockstep, which waits to be armed; with or without a key."""
    links = {}
    if request.param:
        make_key(tmp_path / "key", KEY)
        links["signing_key"] = "key"
    tree = scenario_tree(faults=[], links=links)
    tree["uavs"] = tree["uavs"][:1]
    tree["network"] = {"leader_access": {1: 1.0}}
    scenario = scenario_of(tmp_path / "scenario.yaml", tree)
    with standing(scenario, tmp_path / "run", endless=True) as scenario:
        yield scenario, tmp_path / "run"


@pytest.fixture
def station(fleet: tuple[Scenario, Path]) -> Iterator[Stranger]:
    stranger = Stranger(fleet[0])
    yield stranger
    stranger.link.close()


signed = pytest.mark.parametrize("fleet", [True], indirect=True)
unsigned = pytest.mark.parametrize("fleet", [False], indirect=True)


def test_signed_and_unsigned_flights_are_equal_bit_for_bit(tmp_path: Path) -> None:
    assert run("gcs", "key", tmp_path / "key").returncode == 0
    scenario = write_scenario(tmp_path, duration_s=2.0)
    npz = ("--quiet", "--record=npz")
    fly_well(scenario, *npz, "--out", tmp_path / "plain", "--in-process")
    options = ("--signing-key", tmp_path / "key", "--out", tmp_path / "signed")
    fly_well(scenario, *npz, "--free-ports", *options)
    for name in ("events.npz", "trajectory.npz"):
        plain, other = (arrays_of(tmp_path / folder / name) for folder in ("plain", "signed"))
        for key, array in plain.items():
            equal_nan = array.dtype.kind in "fc"
            assert np.array_equal(array, other[key], equal_nan=equal_nan), key
    tlog = (tmp_path / "signed" / "flight.tlog").read_bytes()
    assert tlog[8] == 0xFD
    assert tlog[10] == dialect.MAVLINK_IFLAG_SIGNED
    secret = (tmp_path / "key").read_bytes()
    files = [path.read_bytes() for path in (tmp_path / "signed").rglob("*") if path.is_file()]
    assert not any(secret in content or secret.hex().encode() in content for content in files)
    assert not any(b"frames dropped" in content for content in files)


@signed
def test_strangers_change_nothing_and_are_counted(
    fleet: tuple[Scenario, Path], station: Stranger
) -> None:
    folder, stranger = fleet[1], station
    assert stranger.hear("HEARTBEAT", system_status=dialect.MAV_STATE_STANDBY)
    for key in (None, KEY[::-1]):
        if key is not None:
            stranger.link.write = _through(Signer(key).sign, stranger.link.write)
        stranger.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        stranger.command(dialect.MAV_CMD_FTC_SET_FAULT, 2, 0.5, 0, 0, float("nan"), float("nan"))
        stranger.link.mav.mission_count_send(1, 1, 3)
        stranger.set_key(bytes(range(32)))
        assert stranger.hear("COMMAND_ACK", 0.5) is None
        assert not stranger.hear("HEARTBEAT").base_mode & ARMED
    _stop_autopilot(folder)
    assert "frames dropped: 4 unsigned, 4 wrong signature" in (folder / "uav1.log").read_text()


@signed
def test_pymavlink_with_the_key_is_heard_and_a_replay_is_not(station: Stranger) -> None:
    friend, sent = station, []
    friend.sign(KEY)
    assert friend.hear("HEARTBEAT", system_status=dialect.MAV_STATE_STANDBY).get_signed()
    write = friend.link.write

    def note(frame: bytes) -> None:
        sent.append(bytes(frame))
        write(frame)

    friend.link.write = note
    mode = dialect.MAV_CMD_DO_SET_MODE
    friend.command(mode, 1, 15)
    assert friend.hear("COMMAND_ACK", command=mode).result == dialect.MAV_RESULT_ACCEPTED
    friend.command(mode, 1, 12)
    assert friend.hear("COMMAND_ACK", command=mode).result == dialect.MAV_RESULT_ACCEPTED
    assert friend.hear("HEARTBEAT", custom_mode=12)
    write(sent[0])  # GUIDED again
    assert friend.hear("COMMAND_ACK", 0.5) is None
    assert friend.hear("HEARTBEAT").custom_mode == 12
    friend.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert friend.hear("COMMAND_ACK", command=400).result == dialect.MAV_RESULT_ACCEPTED
    assert friend.hear("HEARTBEAT").base_mode & ARMED
    assert friend.hear("ATTITUDE").get_signed()
    friend.set_key(bytes(range(2, 34)))
    assert friend.said("disarm first")


@unsigned
def test_a_ground_station_sets_a_key_changes_it_and_takes_it_away(station: Stranger) -> None:
    assert station.hear("HEARTBEAT", system_status=dialect.MAV_STATE_STANDBY)
    interval = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
    for key in (hashlib.sha256(b"phrase").digest(), KEY):  # as MAVProxy's `signing setup phrase`
        station.set_key(key)
        station.sign(key)
        assert station.hear("HEARTBEAT").get_signed()
        station.command(interval, 30, 0)
        assert station.hear("COMMAND_ACK", command=interval).get_signed()
    station.sign(None)
    station.command(interval, 30, -1)
    station.set_key(bytes(32))  # unsigned: nobody may take it away
    assert station.hear("COMMAND_ACK", 0.5) is None
    station.sign(KEY)
    station.set_key(bytes(32))
    station.sign(None)
    station.command(interval, 30, 50000)
    assert station.hear("COMMAND_ACK", command=interval) is not None


def test_a_key_that_others_can_read_is_refused(tmp_path: Path) -> None:
    make_key(tmp_path / "key", KEY)
    (tmp_path / "key").chmod(0o640)
    scenario = write_scenario(tmp_path, links=free_links() | {"signing_key": "key"})
    done = run("gcs", "fly", scenario, "--quiet")
    assert done.returncode == 2
    assert f"{tmp_path / 'key'}: others can use it, its mode is 0640" in done.stderr
    assert f"chmod 600 {tmp_path / 'key'}" in done.stderr


def _through(change: Callable[[bytes], bytes], write: Callable[[bytes], Any]) -> Any:
    return lambda frame: write(change(bytes(frame)))


def _stop_autopilot(folder: Path) -> None:
    for pid, command in processes_of(folder).items():
        if f"{folder / 'uav1'}.yaml" in command:
            os.kill(pid, signal.SIGTERM)
    log = folder / "uav1.log"
    wait_until(lambda: "frames dropped" in log.read_text(), "the log at the end")
