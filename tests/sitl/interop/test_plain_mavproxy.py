"""MAVProxy without our dialect loses nothing, while a ground station gets private messages."""

import asyncio
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


def watch(port: int, folder: Path) -> tuple[int, int]:
    """Return the lost packets before and after enough have come."""
    with PlainMavProxy(port, folder) as mavproxy:
        mavproxy.wait_for(r"Received \d\d parameters")  # it has started
        return mavproxy.watch_link(ENOUGH_PACKETS)


def test_link_says_that_nothing_is_lost(tmp_path: Path) -> None:
    links = free_links(uavs=4)  # one port more, for the other ground station
    tree = scenario_tree(duration_s=300.0, faults=[], links=links)
    scenario = scenario_of(tmp_path / "scenario.yaml", tree)
    other = UdpAddress("127.0.0.1", links["formation_base_port"] + 4)
    ids = [uav.id for uav in scenario.uavs]

    async def work() -> tuple[int, int]:
        async with Client(Connection("in", other), private=True) as client:
            with FleetProcesses(scenario, 1.0, tmp_path / "processes", ground_stations=[other]):
                await client.wait_for(ids, TIMEOUT_S)
                return await asyncio.to_thread(watch, scenario.links.gcs_port, tmp_path)

    before, after = asyncio.run(work())
    assert after == before
