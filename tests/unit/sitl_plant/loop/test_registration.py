"""Registration: who flies an aircraft, and what follows when an autopilot falls silent."""

import pytest

from mavlink_defs.dialect import FTC_SIM_FLAGS_RUNNING
from mavlink_defs.endpoint import UdpAddress
from mavlink_defs.runtime.sockaddr import address_of, sockaddr
from sitl_plant.loop.link import new_link
from sitl_plant.loop.registration import FROZEN_TAKEOVER_S, TAKEOVER_S, Claim, Registration

FIRST, SECOND = UdpAddress("127.0.0.1", 15001), UdpAddress("127.0.0.1", 15002)
OTHER_HOST = UdpAddress("127.0.0.2", FIRST.port)
TIMEOUT_S = 5.0
REFUSED, KNOWN, NEW = Claim.REFUSED, Claim.KNOWN, Claim.NEW


class Rig:
    """The registration of a plant of three aircraft at 1 kHz, after 2 s of simulated time."""

    def __init__(self, running: bool, wait_for_restart: bool = False) -> None:
        self.link = new_link([1, 2, 7], 1000, 10_000, None, 0)
        self.link.state["step"] = 2000
        if running:
            self.link.state["flags"] |= FTC_SIM_FLAGS_RUNNING
        self.log: list[str] = []
        self.registration = Registration(self.link, TIMEOUT_S, wait_for_restart, self.log.append)

    def claim(self, i: int, sender: UdpAddress, now: float) -> Claim:
        self.link.state["sender"][0][:] = sockaddr(sender)
        return self.registration.claim(i, now)

    @property
    def known(self) -> list[int]:
        return self.link.peers["known"].tolist()


@pytest.mark.parametrize(("running", "timeout_s"), [(True, TAKEOVER_S), (False, FROZEN_TAKEOVER_S)])
def test_another_autopilot_takes_over_only_after_silence(running: bool, timeout_s: float) -> None:
    rig = Rig(running)
    assert rig.claim(0, FIRST, 100.0) is NEW
    assert rig.claim(0, SECOND, 100.0 + timeout_s - 0.01) is REFUSED
    assert rig.claim(0, FIRST, 101.0) is KNOWN
    assert rig.claim(0, SECOND, 101.0 + timeout_s - 0.01) is REFUSED
    assert rig.claim(0, SECOND, 101.0 + timeout_s) is NEW
    assert rig.claim(0, FIRST, 101.0 + timeout_s) is REFUSED
    assert rig.known == [1, 0, 0]
    assert address_of(rig.link.peers["address"][0]) == SECOND


def test_a_refused_claim_changes_nothing() -> None:
    rig = Rig(running=True)
    rig.claim(2, FIRST, 100.0)
    rig.log.clear()
    before = (
        rig.link.peers["address"].copy(),
        rig.link.peers["known"].copy(),
        rig.link.peers["heard_s"].copy(),
    )
    assert rig.claim(2, OTHER_HOST, 100.5) is REFUSED
    after = rig.link.peers["address"], rig.link.peers["known"], rig.link.peers["heard_s"]
    assert all((a == b).all() for a, b in zip(before, after, strict=True))
    assert rig.log == []


def test_aircraft_are_claimed_independently() -> None:
    rig = Rig(running=False)
    assert [rig.claim(i, FIRST, 100.0) for i in (0, 2)] == [NEW, NEW]
    assert rig.known == [1, 0, 1]
    assert rig.log == []  # only a return in flight is reported


def test_before_the_start_a_silent_autopilot_loses_its_registration() -> None:
    rig = Rig(running=False)
    rig.claim(0, FIRST, 100.0)
    rig.claim(1, SECOND, 103.0)
    assert rig.registration.check_silence(100.0 + TIMEOUT_S) is None
    assert rig.known == [1, 1, 0]
    assert rig.registration.check_silence(100.1 + TIMEOUT_S) is None
    assert rig.known == [0, 1, 0]
    assert rig.claim(0, SECOND, 105.2) is NEW


def test_in_flight_a_silent_autopilot_ends_the_flight() -> None:
    rig = Rig(running=True)
    rig.claim(2, FIRST, 100.0)
    assert rig.registration.check_silence(100.0 + TIMEOUT_S) is None
    assert rig.registration.check_silence(100.1 + TIMEOUT_S) == (
        "the autopilot of UAV 7 has been silent for 5 s at 2.000 s of simulated time"
    )
    assert rig.known == [0, 0, 1]  # it is still to be sent the end of the simulation


def test_in_flight_a_silent_autopilot_is_waited_for_if_restarts_are_expected() -> None:
    rig = Rig(running=True, wait_for_restart=True)
    rig.claim(2, FIRST, 100.0)
    rig.log.clear()
    for _ in range(2):  # reported once
        assert rig.registration.check_silence(100.1 + TIMEOUT_S) is None
    assert rig.known == [0, 0, 0]
    assert rig.log == [
        "the autopilot of UAV 7 has been silent for 5 s at 2.000 s of simulated time; "
        "holding its last command and waiting for it to come back"
    ]
    assert rig.claim(2, SECOND, 105.2) is NEW
    assert rig.log[1:] == ["the autopilot of UAV 7 is back at 2.000 s"]


def test_an_aircraft_without_an_autopilot_is_not_silent() -> None:
    rig = Rig(running=True)
    assert rig.registration.check_silence(1e9) is None


@pytest.mark.parametrize("running", [True, False])
def test_what_the_plant_slept_through_is_not_silence_of_the_autopilots(running: bool) -> None:
    rig = Rig(running, wait_for_restart=True)
    rig.registration.note_turn(100.0)
    rig.claim(0, FIRST, 100.0)
    rig.registration.note_turn(100.0 + 3.0 * TIMEOUT_S)
    assert rig.registration.check_silence(100.0 + 3.0 * TIMEOUT_S) is None
    assert rig.known == [1, 0, 0]
    awake = 100.0 + 3.0 * TIMEOUT_S
    while awake < 100.0 + 4.1 * TIMEOUT_S:
        rig.registration.note_turn(awake)
        awake += 0.02
    rig.registration.check_silence(awake)
    assert rig.known == [0, 0, 0]
