"""What watches a standing fleet fails, hangs or is late; it is told once, and nothing else ends."""

import asyncio
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fleet_writers import FRAME, Writers

from gcs.fleet import observer as observers
from gcs.fleet.hub import Hub
from gcs.fleet.hub_socket import HubSocket
from gcs.fleet.observer import Observer
from gcs.fleet.standing_record import StandingRecord
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import UdpAddress, bind_udp

FAILURES = [IndexError("index -4000"), ValueError("no"), OSError(5, "Input/output error", "/x")]
PARTS = ["_collector.pass_on_without_stragglers", "_trajectory.add", "_events.add", "_log.write"]


@pytest.fixture
def messages() -> list[str]:
    return []


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observers, "HANGS_S", 0.05)
    monkeypatch.setattr(observers, "_END_S", 0.05)


def raising(problem: Exception) -> Callable[..., Any]:
    def fail(*_: Any, **__: Any) -> Any:
        raise problem

    return fail


@pytest.mark.parametrize("problem", FAILURES, ids=lambda problem: type(problem).__name__)
def test_an_observer_that_raises_says_so_once(problem: Exception, messages: list[str]) -> None:
    observer = Observer("watcher", raising(problem), messages.append)
    while not messages:
        observer.check()
    observer.close()
    (message,) = messages
    assert message.startswith("watcher ended: ")
    assert problem.args[-1] in message or "Input/output" in message
    assert message.endswith("the fleet flies on")


def test_an_observer_that_hangs_is_told_once_and_left(hurried: None, messages: list[str]) -> None:
    released = threading.Event()

    def hang(_: Observer) -> None:
        released.wait()

    observer = Observer("watcher", hang, messages.append)
    try:
        while not messages:
            observer.check()
        begun = time.monotonic()
        observer.check()
        observer.close()
        assert time.monotonic() - begun < 5.0
        assert [message.startswith("watcher hangs") for message in messages] == [True]
    finally:
        released.set()


def test_an_observer_that_takes_its_turns_is_no_news(hurried: None, messages: list[str]) -> None:
    turns = threading.Semaphore(0)

    def watch(observer: Observer) -> None:
        while observer.goes_on(0.001):
            turns.release()

    observer = Observer("watcher", watch, messages.append)
    for _ in range(10):
        assert turns.acquire(timeout=600)
    observer.close()
    assert messages == []


@pytest.mark.parametrize("problem", FAILURES, ids=lambda problem: type(problem).__name__)
@pytest.mark.parametrize("part", PARTS)
def test_whatever_fails_in_a_recording_ends_it_with_one_message(
    scenario1: Scenario, tmp_path: Path, messages: list[str], part: str, problem: Exception
) -> None:
    record, writers = (
        StandingRecord(scenario1, tmp_path, messages.append),
        Writers(scenario1, tmp_path),
    )
    owner, method = part.split(".")
    setattr(getattr(record, owner), method, raising(problem))
    for second in range(5):
        writers.write()
        record.log(FRAME)
        record.collect(float(second))
        assert second == 0 or not list((tmp_path / "processes").rglob("*.npy")), "nothing piles up"
    record.close()
    (message,) = messages
    assert message.startswith("recording ended: ")
    assert message.endswith("the fleet flies on")
    assert not list((tmp_path / "processes").glob("*"))


def test_a_recording_that_hangs_holds_up_no_frame(
    scenario1: Scenario,
    tmp_path: Path,
    messages: list[str],
    hurried: None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    record, released = StandingRecord(scenario1, tmp_path, messages.append), threading.Event()

    def hangs(*_: Any) -> Any:
        released.wait(60.0)

    monkeypatch.setattr(record._collector, "pass_on_without_stragglers", hangs)
    observer = Observer("recording", record.watch, messages.append)
    try:
        while not messages:
            record.log(FRAME)
            observer.check()
        observer.close()
        assert len(messages) == 1
        assert messages[0].startswith("recording hangs")
    finally:
        released.set()


def test_a_hub_that_fails_on_a_datagram_serves_the_next(
    messages: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    hub = Hub([1])
    tries: list[bytes] = []

    def route(datagram: bytes, sender: Any, now: float) -> list[Any]:
        tries.append(datagram)
        if datagram != b"good":
            raise KeyError(datagram)
        return [sender]

    monkeypatch.setattr(hub, "route", route)

    async def serve() -> None:
        sock = bind_udp(UdpAddress("127.0.0.1", 0), "hub")
        served = HubSocket(sock, hub, messages.append)
        loop, heard = asyncio.get_running_loop(), asyncio.Event()

        class Station(asyncio.DatagramProtocol):
            def datagram_received(self, data: bytes, addr: Any) -> None:
                heard.set()

        transport, _ = await loop.create_datagram_endpoint(Station, remote_addr=sock.getsockname())
        try:
            for datagram in (b"bad", b"worse", b"good"):
                transport.sendto(datagram)
            async with asyncio.timeout(60.0):
                await heard.wait()
        finally:
            transport.close()
            served.close()

    asyncio.run(serve())
    assert tries == [b"bad", b"worse", b"good"]
    (message,) = messages
    assert message.startswith("hub: a defect of ftc-sitl: KeyError")
    assert hub.drops == {"that the hub failed on": 2}
