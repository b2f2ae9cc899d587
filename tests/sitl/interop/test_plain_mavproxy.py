"""MAVProxy without our dialect loses nothing, while a ground station gets private messages."""

import asyncio
import time
from pathlib import Path

import pytest
from flying import free_links, scenario_tree
from mavproxy import TIMEOUT_S, PlainMavProxy

from gcs.fleet.processes import FleetProcesses
from gcs.scenario.model import scenario_of
from gcs.station.client import Client
from mavlink_defs.endpoint import Connection, UdpAddress

pytestmark = pytest.mark.sitl

ENOUGH_PACKETS = 300


def watch(port: int, folder: Path) -> str:
    """The words of its `link` once enough packets have come."""
    with PlainMavProxy(port, folder) as mavproxy:
        end = time.monotonic() + TIMEOUT_S
        while True:
            link = mavproxy.say("link", r"link 1 OK \((\d+) packets.*% loss")
            if int(link[1]) >= ENOUGH_PACKETS:
                return link[0]
            assert time.monotonic() < end, mavproxy.text
            time.sleep(0.1)


def test_link_says_that_nothing_is_lost(tmp_path: Path) -> None:
    links = free_links(uavs=4)  # one port more, for the other ground station
    tree = scenario_tree(duration_s=300.0, faults=[], links=links)
    scenario = scenario_of(tmp_path / "scenario.yaml", tree)
    other = UdpAddress("127.0.0.1", links["formation_base_port"] + 4)
    ids = [uav.id for uav in scenario.uavs]

    async def work() -> str:
        async with Client(Connection("in", other), private=True) as client:
            with FleetProcesses(scenario, 1.0, tmp_path / "processes", ground_stations=[other]):
                await client.wait_for(ids, TIMEOUT_S)
                return await asyncio.to_thread(watch, scenario.links.gcs_port, tmp_path)

    assert asyncio.run(work()).endswith(" 0 lost, 0.0% loss")
