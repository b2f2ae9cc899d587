"""The plant's shell: who is heard, and what a network that fails does to it."""

import socket
from collections.abc import Iterator

import pytest

from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.endpoint import UdpAddress, address_of, bind_udp, sockaddr
from mavlink_defs.framing.hot_signing import new_link_signer
from mavlink_defs.framing.signing import PLANT_LINK
from sitl_plant.process import Plant

ANY_PORT = UdpAddress("127.0.0.1", 0)


class Rig:
    """A plant, and two autopilots that claim the same aircraft."""

    def __init__(self, scenario: Scenario) -> None:
        self.sock, self.first, self.second = (bind_udp(ANY_PORT, "test") for _ in range(3))
        self.plant = Plant(
            scenario.plant_config(), self.sock, False, new_link_signer(b"", PLANT_LINK)
        )
        self.link = self.plant._link

    def register(self, sock: socket.socket, now: float) -> bool:
        """Whether a frame for UAV 1 that comes from a socket is taken."""
        self.link.sender[:] = sockaddr(UdpAddress(*sock.getsockname()))
        return self.plant._register(0, now)


@pytest.fixture
def rig(scenario1: Scenario) -> Iterator[Rig]:
    rig = Rig(scenario1)
    yield rig
    for sock in (rig.sock, rig.first, rig.second):
        sock.close()


@pytest.mark.parametrize(("flags", "patience_s"), [(dialect.FTC_SIM_FLAGS_RUNNING, 1.0), (0, 2.5)])
def test_another_autopilot_takes_over_only_after_silence(
    rig: Rig, flags: int, patience_s: float
) -> None:
    rig.link.state["flags"] = flags
    assert rig.register(rig.first, 100.0)
    assert not rig.register(rig.second, 100.0 + patience_s - 0.01)
    assert rig.register(rig.first, 101.0)
    assert not rig.register(rig.second, 101.0 + patience_s - 0.01)
    assert rig.register(rig.second, 101.0 + patience_s)
    assert not rig.register(rig.first, 101.0 + patience_s)
    assert rig.link.known.tolist() == [1, 0, 0]
    assert address_of(rig.link.addresses[0]) == UdpAddress(*rig.second.getsockname())


def test_a_datagram_that_cannot_be_sent_is_lost_and_nothing_more(rig: Rig) -> None:
    rig.register(rig.first, 100.0)
    rig.link.addresses[0] = sockaddr(
        UdpAddress("255.255.255.255", 9)
    )  # broadcasting is not allowed
    rig.plant._report_drops()


def test_every_plant_process_is_another_run(scenario1: Scenario) -> None:
    runs = set()
    for _ in range(3):
        with bind_udp(ANY_PORT, "test") as sock:
            plant = Plant(scenario1.plant_config(), sock, False, new_link_signer(b"", PLANT_LINK))
            runs |= {*plant._fleet.messages["run"].tolist()}
    assert len(runs) == 3
