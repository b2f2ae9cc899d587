"""`--free-ports`: out of the way of everybody else, and tried again if somebody was faster."""

import re
from pathlib import Path

import pytest
from flying import fly_well, free_links, scenario_tree, wait_until, write_scenario

from gcs.console.errors import PortInUse
from gcs.fleet.ports import on_free_ports
from gcs.fleet.processes import FleetProcesses
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.endpoint import UdpAddress, bind_udp

pytestmark = pytest.mark.sitl

FIRST_PORT_OF_THE_SYSTEM = 32_768


def test_all_ports_are_apart_and_below_those_that_the_system_gives(scenario1: Scenario) -> None:
    def ports(scenario: Scenario, hub: UdpAddress) -> list[int]:
        links = scenario.links
        formation = [links.formation_base_port + uav.id for uav in scenario.uavs]
        return [hub.port, links.gcs_port, links.plant_port, *formation]

    for _ in range(20):
        found = on_free_ports(scenario1, ports)
        assert len(set(found)) == 6
        assert max(found) < FIRST_PORT_OF_THE_SYSTEM


def test_other_ports_are_tried_if_somebody_was_faster(scenario1: Scenario) -> None:
    seen: list[int] = []

    def work(scenario: Scenario, _: UdpAddress) -> str:
        seen.append(scenario.links.gcs_port)
        if len(seen) < 3:
            raise PortInUse("taken")
        return "done"

    assert on_free_ports(scenario1, work) == "done"
    assert len(set(seen)) == 3
    with pytest.raises(PortInUse):
        on_free_ports(scenario1, lambda *_: (_ for _ in ()).throw(PortInUse("taken")))


@pytest.mark.parametrize("key", ["plant_port", "formation_base_port"])
def test_a_process_that_finds_its_port_taken_says_so(tmp_path: Path, key: str) -> None:
    links = free_links()
    scenario = scenario_of(tmp_path / "scenario.yaml", scenario_tree(links=links))
    taken = links[key] + (2 if key == "formation_base_port" else 0)
    with (
        bind_udp(UdpAddress("127.0.0.1", taken), "somebody"),
        FleetProcesses(scenario, None, tmp_path / "run") as fleet,
    ):
        name = "uav2" if key == "formation_base_port" else "plant"
        log = tmp_path / "run" / f"{name}.log"
        wait_until(lambda: "in use" in log.read_text(), "it ends")

        def ended() -> bool:
            fleet.check()
            return False

        with pytest.raises(PortInUse, match=str(taken)):
            wait_until(ended, "it has ended")


def test_the_warning_names_the_host_whose_ports_are_used(tmp_path: Path) -> None:
    links = {"host": "0.0.0.0"}
    scenario = write_scenario(tmp_path, duration_s=0.05, links=links)
    done = fly_well(scenario, "--free-ports", "--quiet", "--out", tmp_path / "run")
    assert re.findall(r"warning: (\S+) can", done.stderr) == ["0.0.0.0"]
    done = fly_well(scenario, "--in-process", "--quiet", "--out", tmp_path / "no-wire")
    assert done.stderr == ""
