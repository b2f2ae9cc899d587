"""The plant's real-time clock, step by step."""

import socket
import time
from collections.abc import Iterator

import numpy as np
import pytest

from gcs.scenario.model import Scenario
from mavlink_defs.dialect import FTC_SIM_FLAGS_LOCKSTEP, FTC_SIM_FLAGS_RUNNING
from mavlink_defs.endpoint import UdpAddress, bind_udp, set_receive_timeout
from mavlink_defs.framing import codec
from mavlink_defs.framing.hot_link import ReturnReason
from mavlink_defs.runtime.sockaddr import sockaddr
from sitl_plant.loop.fleet import PlantState, new_plant_state
from sitl_plant.loop.link import PlantLink, due_time_s, new_link, run

STEPS = 5


@pytest.fixture
def fleet(scenario1: Scenario) -> PlantState:
    return new_plant_state(scenario1.plant_config())


@pytest.fixture
def sock() -> Iterator[socket.socket]:
    with bind_udp(UdpAddress("127.0.0.1", 0), "test") as sock:
        yield sock


def running(speed: float, origin_s: float) -> PlantLink:
    link = new_link([1, 2, 3], 1000, STEPS, speed, record_rows=0)
    link.state["flags"] = FTC_SIM_FLAGS_RUNNING
    link.state["origin_s"] = origin_s
    return link


def test_a_plant_that_fell_behind_shifts_its_schedule_once(
    fleet: PlantState, sock: socket.socket
) -> None:
    origin_s = time.monotonic() - 1e4
    link = running(speed=1.0, origin_s=origin_s)
    assert run(sock.fileno(), link, fleet, time.monotonic() + 1e3) == ReturnReason.OVER
    clock = link.state[0]
    assert clock["step"] == STEPS
    assert clock["lag_s"] >= 1e4 - STEPS / 1e3
    assert clock["lag_s"] == pytest.approx(clock["origin_s"] - origin_s, abs=1e-6)
    assert clock["lag_s"] < 2e4  # not once for every step


def test_the_next_state_tells_who_sent_no_neighbour_message(
    fleet: PlantState, sock: socket.socket
) -> None:
    link = new_link([1, 2, 30], 1000, STEPS, None, record_rows=0)
    link.state["flags"] = FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
    link.peers["known"][:] = 1
    set_receive_timeout(sock, 0.05)
    autopilots = [bind_udp(UdpAddress("127.0.0.1", 0), "test") for _ in range(3)]
    heard = []
    for i, autopilot in enumerate(autopilots):
        link.peers["address"][i] = sockaddr(UdpAddress(*autopilot.getsockname()))
    for step, silent in enumerate([(0, 1, 1), (0, 0, 0), (1, 0, 0)]):
        for i in (0, 1, 2, 2):  # one answers twice, as to a state that was sent again
            done = np.zeros(1, codec.STEP_DONE)
            done["step"], done["silent"] = step, silent[i]
            datagram = codec.new_buffer()
            number = codec.MessageId.STEP_DONE
            length = codec.pack(datagram, done, number, int(link.peers[i]["system"]), 1, step)
            autopilots[i].sendto(datagram[:length].tobytes(), sock.getsockname())
        while link.state[0]["step"] == step:
            run(sock.fileno(), link, fleet, time.monotonic())
        bits = int.from_bytes(fleet.uavs[0]["message"]["silent"].tobytes(), "little")
        heard.append([system for system in range(256) if bits >> system & 1])
    for autopilot in autopilots:
        autopilot.close()
    assert heard == [[2, 30], [], [1]]


@pytest.mark.parametrize("speed", [1.0, 10.0])
def test_a_plant_on_time_keeps_its_schedule(speed: float) -> None:
    origin_s = time.monotonic() + 1e4
    link = running(speed, origin_s)
    link.state["origin_step"], link.state["step"] = 2, 3
    assert due_time_s(link) == pytest.approx(origin_s + 2e-3 / speed, abs=1e-9)
    assert (link.state["lag_s"][0], link.state["origin_s"][0]) == (0.0, origin_s)
