"""The plant process around its compiled loop: sockets, wall clock, start and end of a flight."""

import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.config.files import dump
from mavlink_defs.endpoint import UdpAddress, bind_udp
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.runtime.sockaddr import sockaddr
from sitl_plant.config import PlantConfig
from sitl_plant.loop import process
from sitl_plant.loop.process import Plant, main

ANY_PORT = UdpAddress("127.0.0.1", 0)
TIMEOUT_S = 600.0  # only a defect takes so long
ENDED = dialect.FTC_SIM_FLAGS_ENDED


@pytest.fixture
def config(scenario1: Scenario) -> PlantConfig:
    return scenario1.plant_config().model_copy(update={"silence_timeout_s": 0.05})


class Rig:
    """A plant, and sockets that claim its aircraft; nothing answers its states."""

    def __init__(self, config: PlantConfig, stack: ExitStack) -> None:
        self.sock = stack.enter_context(bind_udp(ANY_PORT, "test"))
        self.plant = Plant(config, self.sock, None, None)
        self.peers = {
            uav.id: stack.enter_context(bind_udp(ANY_PORT, "test")) for uav in config.uavs
        }

    def fly_until(self, condition: Callable[[], bool]) -> None:
        """Let the plant fly until a condition holds, in vain for seconds at most."""
        held = False

        def watch() -> None:
            nonlocal held
            end_s = time.monotonic() + TIMEOUT_S
            while not held and time.monotonic() < end_s:
                time.sleep(0.002)
                held = condition()
            self.plant.stopping = True

        watcher = threading.Thread(target=watch)
        watcher.start()
        assert self.plant.fly() is None
        watcher.join()
        assert held

    def heartbeat(
        self, sender: socket.socket, system: int, armed: bool, component: int = 1
    ) -> None:
        base_mode = dialect.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        message = dialect.MAVLink_heartbeat_message(1, 3, base_mode, 12, 4, 3)
        frame = FramePacker(system, component).pack(message)
        sender.sendto(frame, self.sock.getsockname())

    def received(self, system: int) -> list[Any]:
        return received_by(self.peers[system])


def received_by(peer: socket.socket) -> list[Any]:
    """All messages of the plant that wait in a socket."""
    messages: list[Any] = []
    peer.setblocking(False)
    while True:
        try:
            message = parse(peer.recv(400))
        except BlockingIOError:
            return messages
        assert message is not None
        assert message.get_srcComponent() == 25
        messages.append(message)


def has_state(messages: list[Any]) -> bool:
    return any(message.get_type() == "FTC_SIM_STATE" for message in messages)


@pytest.fixture(autouse=True)
def short_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "_END_TIMEOUT_S", 0.05)


@pytest.fixture
def rig(config: PlantConfig) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(config, stack)


def test_a_flight_starts_when_all_are_armed_and_ends_when_one_is_silent(
    rig: Rig, capfd: pytest.CaptureFixture[str]
) -> None:
    for armed in (False, True):
        for system, peer in rig.peers.items():
            rig.heartbeat(peer, system, armed)
    why = rig.plant.fly()
    assert why is not None
    assert why.startswith("the autopilot of UAV 1 has been silent for 0.05 s at 0.000 s")
    assert "all armed, simulated time starts" in capfd.readouterr().err
    assert rig.plant.time_s == 0.0
    assert rig.plant.refused() == {}
    for system in rig.peers:
        states = [m for m in rig.received(system) if m.get_type() == "FTC_SIM_STATE"]
        assert states[-1].flags & ENDED
        assert not states[-1].flags & dialect.FTC_SIM_FLAGS_LOST


def test_states_are_sent_although_heartbeats_come_without_a_pause(rig: Rig) -> None:
    """A hundred autopilots send them, ten times a second each, until they hear a state."""

    def heard() -> bool:
        rig.heartbeat(rig.peers[1], 1, False)
        return has_state(rig.received(1))

    rig.fly_until(heard)


def test_an_autopilot_that_comes_back_in_flight_is_sent_the_present_state(
    config: PlantConfig, capfd: pytest.CaptureFixture[str]
) -> None:
    """From another port, as a process that was started again has one."""
    with ExitStack() as stack, bind_udp(ANY_PORT, "test") as again:
        rig = Rig(config.model_copy(update={"wait_for_restart": True}), stack)
        for armed in (False, True):
            for system, peer in rig.peers.items():
                rig.heartbeat(peer, system, armed)

        def is_back() -> bool:
            rig.heartbeat(again, 1, True)
            return has_state(received_by(again))

        rig.fly_until(is_back)
    assert "the autopilot of UAV 1 is back at 0.000 s" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("system", "component", "reason"),
    [(9, 1, DropReason.STRANGER), (1, 2, DropReason.STRANGER)],
)
def test_messages_of_other_systems_and_components_are_dropped(
    rig: Rig, system: int, component: int, reason: DropReason
) -> None:
    rig.heartbeat(rig.peers[1], system, False, component)
    rig.fly_until(lambda: rig.plant.refused().total() > 0)
    assert rig.plant.refused() == {reason.text: 1}
    assert rig.received(1) == []  # it is no autopilot of this plant


def test_a_second_autopilot_and_damaged_messages_are_dropped(rig: Rig) -> None:
    for sender in (rig.peers[1], rig.peers[2]):
        rig.heartbeat(sender, 1, False)
    rig.peers[1].sendto(b"\xfd" + bytes(11), rig.sock.getsockname())
    rig.fly_until(lambda: rig.plant.refused().total() == 2)
    assert rig.plant.refused()[DropReason.STRANGER.text] == 1
    assert has_state(rig.received(1))
    assert rig.received(2) == []


def test_a_datagram_that_cannot_be_sent_is_lost_and_nothing_more(rig: Rig) -> None:
    """The counters of dropped datagrams reach the next autopilot all the same."""
    link = rig.plant._link  # no claim can come from such an address: broadcasting is not allowed
    link.peers["known"][0], link.peers["heard_s"][0] = 1, math.inf
    link.peers["address"][0] = sockaddr(UdpAddress("255.255.255.255", 9))

    def has_drops() -> bool:
        rig.heartbeat(rig.peers[2], 2, False)
        return any(message.get_type() == "FTC_DROPS" for message in rig.received(2))

    rig.fly_until(has_drops)


def test_a_plant_that_is_stopped_ends_without_a_loss(rig: Rig) -> None:
    rig.plant.stopping = True
    assert rig.plant.fly() is None
    assert rig.plant.wall_s == 0.0


def test_every_plant_process_is_another_run(config: PlantConfig) -> None:
    runs = set()
    for _ in range(3):
        with ExitStack() as stack:
            rig = Rig(config, stack)
            states: list[Any] = []

            def heard(rig: Rig = rig, states: list[Any] = states) -> bool:
                rig.heartbeat(rig.peers[1], 1, False)
                states += [m for m in rig.received(1) if m.get_type() == "FTC_SIM_STATE"]
                return len(states) > 1

            rig.fly_until(heard)
            (run,) = {state.run for state in states}
            runs.add(run)
    assert len(runs) == 3


def test_bad_input_is_refused_with_status_2(
    config: PlantConfig, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "plant.yaml"
    for arguments, problem in (
        ([], "no such file"),
        (["--record", "out"], "duration_s: missing; --record needs an end"),
        ([], "port"),
    ):
        with bind_udp(ANY_PORT, "test") as taken:
            if problem != "no such file":
                update = {"duration_s": None, "bind": f"127.0.0.1:{taken.getsockname()[1]}"}
                dump(config.model_copy(update=update), path)
            with pytest.raises(SystemExit) as exit_:
                main([str(path), *arguments])
        assert exit_.value.code == 2
        assert problem in capsys.readouterr().err
