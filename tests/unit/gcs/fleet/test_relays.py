"""Which relays a scenario asks for, and how autopilots are configured to use them."""

import pytest

from gcs.fleet.relays import relay_of, through
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import free_ports


def with_impairments(scenario: Scenario, *links: str) -> Scenario:
    tree = scenario.model_dump()
    gcs, plant = free_ports(2)
    tree["links"] |= {"gcs_port": gcs, "plant_port": plant}
    tree["links"]["impairments"] = {link: {"loss": 0.1} for link in links}
    return Scenario.model_validate(tree)


@pytest.mark.parametrize(
    ("links", "routes"),
    [((), 1), (("plant",), 1), (("gcs",), 2), (("formation",), 4), (("gcs", "formation"), 5)],
)
def test_the_plant_link_is_relayed_with_any_other(scenario1, links, routes: int) -> None:
    scenario = with_impairments(scenario1, *links)
    with relay_of(scenario) as relay:
        via = relay.via
    assert len(via) == len(set(via.values())) == routes
    assert scenario.links.address(scenario.links.plant_port) in via


def test_without_impairments_nothing_is_relayed(scenario1: Scenario) -> None:
    with relay_of(scenario1) as relay:
        assert relay.via == {}
    config = scenario1.autopilot_config(2)
    assert through(config, {}) == config


def test_autopilots_send_to_relays_but_receive_where_they_did(scenario1: Scenario) -> None:
    scenario = with_impairments(scenario1, "gcs", "formation")
    config = scenario.autopilot_config(1)
    with relay_of(scenario) as relay:
        sending = through(config, relay.via)
        via = relay.via
    assert sending.plant == via[config.plant]
    assert sending.gcs == tuple(via[address] for address in config.gcs)
    before = [n.address for n in config.neighbours]
    assert [n.address for n in sending.neighbours] == [via[address] for address in before]
    assert sending.formation_bind == config.formation_bind
