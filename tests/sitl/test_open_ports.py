"""Whom the processes of a fleet hear: this machine, and of it their ground stations."""

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from socket import AF_INET, SOCK_DGRAM, inet_ntoa, socket

import pytest
from flying import process_of, processes_of, scenario_tree, wait_until
from station import Up, up

from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.framing.signing import timestamp

pytestmark = pytest.mark.sitl

LOITER, GUIDED = 12, 15


def bound(pid: int) -> set[tuple[str, int]]:
    """Addresses that the UDP sockets of a process are bound to (Linux)."""
    links = []
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed meanwhile
            links.append(os.readlink(entry))
    inodes = {link[8:-1] for link in links if link.startswith("socket:[")}
    rows = [row.split() for row in Path("/proc/net/udp").read_text().splitlines()[1:]]
    texts = [row[1].split(":") for row in rows if row[9] in inodes]
    return {(inet_ntoa(bytes.fromhex(ip)[::-1]), int(port, 16)) for ip, port in texts}


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    """One UAV that waits to be armed."""
    tree = scenario_tree(faults=[])
    tree["uavs"] = tree["uavs"][:1]
    tree["network"] = {"leader_access": {1: 1.0}}
    with up(tmp_path_factory.mktemp("fleet"), tree=tree) as fleet:
        yield fleet


def test_all_sockets_are_bound_to_this_machine(fleet: Up) -> None:
    def addresses() -> list[set[tuple[str, int]]]:
        return sorted(map(bound, processes_of(fleet.folder)), key=len)

    wait_until(lambda: [*map(len, addresses())] == [1, 1, 3], "every process has its sockets")
    assert {ip for those in addresses() for ip, _ in those} == {"127.0.0.1"}


def test_only_the_ground_stations_of_the_configuration_are_heard(fleet: Up) -> None:
    own = FramePacker(255, 190)
    seven = (GUIDED, 0, 0, 0, 0, 0)
    frames = [
        own.pack(dialect.MAVLink_command_long_message(1, 1, 176, 0, 1, *seven)),
        own.pack(dialect.MAVLink_setup_signing_message(1, 1, [1] * 32, timestamp(time.time()))),
    ]

    def dropped() -> int:
        (state,) = fleet.gcs_json("status")["vehicles"]
        assert state["mode"] == "LOITER"
        return int((state["link"]["drops"] or {}).get("gcs", {}).get("wrong sender", 0))

    with socket(AF_INET, SOCK_DGRAM) as stranger:
        for address in bound(process_of(fleet.folder, "uav1")):
            for frame in frames:
                stranger.sendto(frame, address)
    wait_until(lambda: dropped() == len(frames), "both are counted")
    assert fleet.gcs("mode", "guided").returncode == 0  # the hub is heard, without a signature
