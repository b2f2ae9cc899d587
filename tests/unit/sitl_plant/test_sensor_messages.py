"""What the plant sends in a flight by sensors, read by pymavlink's own dialect."""

import socket
import time
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common

from gcs.scenario.model import Scenario
from mavlink_defs.dialect import FTC_SIM_FLAGS_GPS, FTC_SIM_FLAGS_LOCKSTEP, FTC_SIM_FLAGS_RUNNING
from mavlink_defs.endpoint import UdpAddress, bind_udp
from mavlink_defs.framing.frames import parse
from mavlink_defs.runtime.sockaddr import sockaddr
from sitl_plant.loop.fleet import fly, new_plant_state
from sitl_plant.loop.link import new_link, send_states

STEPS = 501
GYRO, BAROMETER = 0b11_1000, 0b1_1010_0000_0000


def sent_in_flight(scenario: Scenario) -> list[list[bytes]]:
    """Datagrams that the leader's autopilot gets, by step, every one sent twice in the end."""
    fleet = new_plant_state(scenario.plant_config())
    link = new_link([1, 2, 3], 1000, STEPS, None, record_rows=0)
    link.state["flags"] = FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
    link.peers["known"][0] = 1
    found = []
    with (
        bind_udp(UdpAddress("127.0.0.1", 0), "test") as sock,
        bind_udp(UdpAddress("127.0.0.1", 0), "test") as peer,
    ):
        peer.setblocking(False)
        link.peers["address"][0] = sockaddr(UdpAddress(*peer.getsockname()))
        for step in range(STEPS):
            link.state["step"] = step
            send_states(sock.fileno(), link, fleet, False)
            found.append(waiting(peer))
            fly(fleet, step, 1000)
        send_states(sock.fileno(), link, fleet, True)
        found.append(waiting(peer))
    return found


def waiting(peer: socket.socket) -> list[bytes]:
    datagrams: list[bytes] = []
    end_s = time.monotonic() + 10.0
    while time.monotonic() < end_s:
        try:
            datagrams.append(peer.recv(400))
        except BlockingIOError:
            if datagrams:
                break
    return datagrams


@pytest.fixture(scope="module")
def flown(scenario1: Scenario) -> list[list[bytes]]:
    return sent_in_flight(scenario1.model_copy(update={"navigation": "estimated"}))


def by_pymavlink(datagram: bytes) -> Any:
    reader = common.MAVLink(None)
    reader.robust_parsing = False
    (message,) = reader.parse_buffer(datagram)
    return message


def test_each_step_has_a_message_of_each_imu_and_the_step_last(flown: list[list[bytes]]) -> None:
    for step, datagrams in enumerate(flown[:STEPS]):
        messages: list[Any] = [parse(datagram) for datagram in datagrams]
        kinds = [message.get_type() for message in messages]
        has_gps = "HIL_GPS" in kinds
        between = ["HIL_GPS"] if has_gps else []
        assert kinds == ["HIL_SENSOR", "HIL_SENSOR", *between, "FTC_SIM_STEP"]
        first, second, *_, last = messages
        assert (first.id, second.id) == (0, 1)
        assert {first.time_usec, second.time_usec, last.time_usec} == {1000 * step}
        assert last.step == step
        assert bool(last.flags & FTC_SIM_FLAGS_GPS) == has_gps


def test_pymavlink_reads_plausible_sensors(flown: list[list[bytes]]) -> None:
    readings = [by_pymavlink(datagrams[0]) for datagrams in flown[:STEPS]]
    assert np.mean([one.zacc for one in readings]) == pytest.approx(-8.0, abs=4.0)
    airspeeds = [np.sqrt(2.0 * 100.0 * one.diff_pressure / 1.2) for one in readings]
    assert airspeeds[0] == pytest.approx(40.0, abs=2.0)
    assert all(one.fields_updated & GYRO == GYRO for one in readings)
    with_pressure = [one.fields_updated & BAROMETER == BAROMETER for one in readings]
    assert 0 < sum(with_pressure) < STEPS
    samples = [by_pymavlink(datagrams[2]) for datagrams in flown[:STEPS] if len(datagrams) == 4]
    assert len(samples) >= 3
    assert all(one.get_type() == "HIL_GPS" and one.fix_type == 3 for one in samples)
    intervals = np.diff([one.time_usec for one in samples])
    assert (intervals == 100_000).all()
    assert samples[0].vel == pytest.approx(4000, rel=0.1)


def test_an_unanswered_step_is_sent_again_as_a_whole(flown: list[list[bytes]]) -> None:
    first, again = flown[-2:]
    without_sequence = [[frame[:4] + frame[5:-2] for frame in frames] for frames in (first, again)]
    assert without_sequence[0] == without_sequence[1]
    assert len(first) >= 3


def test_by_true_states_there_is_one_message(scenario1: Scenario) -> None:
    (datagram,) = sent_in_flight(scenario1)[0]
    message = parse(datagram)
    assert message is not None
    assert message.get_type() == "FTC_SIM_STATE"
