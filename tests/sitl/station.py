"""Tools of the tests of the operator's station: a running fleet, commands that talk to it."""

import contextlib
import json
import select
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from flying import (
    TIMEOUT_S,
    assert_one_message,
    environment,
    kill_all,
    processes_of,
    run,
    start,
    wait_until,
    write_scenario,
)

ACCEPTED, BAD_INPUT, REFUSED, NO_ANSWER = 0, 2, 3, 4  # exit status
ALL = ("--uav", "1,2,3")
SOMEDAY = ("--start-s", "10000")  # of a fault that is set but never acts


@dataclass
class Up:
    """A running `gcs up`."""

    popen: subprocess.Popen[str]
    folder: Path
    hub: str
    gcs_port: int

    def gcs(self, *arguments: str | Path, connect: str | None = None) -> Any:
        """Run a command against the fleet to its end."""
        env = environment(FTC_SITL_CONNECT=connect or self.hub)
        return run("gcs", *arguments, env=env)

    def gcs_json(self, *arguments: str | Path, status: int = 0) -> Any:
        """Run it with --json and return its output."""
        done = self.gcs(*arguments, "--json")
        assert done.returncode == status, (done.stderr, self.ended())
        return json.loads(done.stdout)

    def ended(self) -> str:
        """Return what `gcs up` wrote if it has ended: why nobody answers."""
        return "" if self.popen.poll() is None else self.popen.communicate()[1]

    def begin(
        self, *arguments: str | Path, connect: str | None = None, output: Path | None = None
    ) -> subprocess.Popen[str]:
        """Start a command that runs until it is stopped."""
        env = environment(FTC_SITL_CONNECT=connect or self.hub)
        return start("gcs", *arguments, env=env, output=output)

    def stop(self, number: int = signal.SIGINT) -> tuple[int, str]:
        """Stop `gcs up`; its exit status and standard error."""
        self.popen.send_signal(number)
        _, stderr = self.popen.communicate(timeout=TIMEOUT_S)
        return self.popen.returncode, stderr


@contextlib.contextmanager
def up(folder: Path, *arguments: str | Path, tree: dict[str, Any] | None = None) -> Iterator[Up]:
    """`gcs up` of a scenario (or scenario 1); whatever is left of it in the end is killed.

    If no argument says how fast, it flies slowly: others need the processor, and may be late.
    """
    folder.mkdir(exist_ok=True)
    scenario = write_scenario(folder, tree)
    slowly = () if {"--speed", "--lockstep"} & {*arguments} else ("--speed", "0.3")
    options = ("--out", folder / "run", "--json", "--free-ports", *slowly)
    popen = start("gcs", "up", scenario, *options, *arguments)
    try:
        assert popen.stdout is not None
        line = popen.stdout.readline()
        assert line, popen.communicate()
        addresses = json.loads(line)
        gcs_port = int(addresses["gcs"].removeprefix("udpin:127.0.0.1:"))
        yield Up(popen, folder / "run", addresses["hub"], gcs_port)
    finally:
        kill_all(popen, folder)


@contextlib.contextmanager
def flying_fleet(folder: Path) -> Iterator[Up]:
    """Scenario 1 in flight.

    In the end its `gcs up` is killed, and nothing is left.
    """
    with up(folder, "--start") as fleet:
        yield fleet
        assert len(processes_of(fleet.folder)) == 5
        assert fleet.stop(signal.SIGKILL)[0] == -signal.SIGKILL
        wait_until(lambda: not processes_of(fleet.folder), "no process is left")


def failed(done: subprocess.CompletedProcess[str], status: int) -> str:
    """Return the message of a command that failed with this exit status."""
    assert done.returncode == status, (done.stdout, done.stderr)
    assert_one_message(done.stderr)
    return done.stderr


def status_when(
    fleet: Up, condition: Callable[[list[dict[str, Any]]], bool], *options: str
) -> dict[str, Any]:
    """Ask for the status until a condition on the vehicles in it holds.

    One status shows what has arrived within a second, which on a busy machine may not be all.
    """
    status: dict[str, Any] = {}

    def holds() -> bool:
        done = fleet.gcs("status", *options, "--json")
        assert done.returncode in {ACCEPTED, NO_ANSWER}, done.stderr
        if not done.stdout:  # not one vehicle was heard in time
            assert done.returncode == NO_ANSWER, done.stderr
            return False
        status.update(json.loads(done.stdout))
        assert (done.returncode == NO_ANSWER) == bool(status["not_heard"])
        return condition(status["vehicles"])

    wait_until(holds, "the status")
    return status


def state_of(fleet: Up, uav: int) -> dict[str, Any]:
    """Return all that a vehicle tells; nothing is None that it would tell later."""

    def complete(states: list[dict[str, Any]]) -> bool:
        return all(states[0][key] is not None for key in ("time_s", "steps", "faults", "profile"))

    (state,) = status_when(fleet, complete, "--uav", str(uav))["vehicles"]
    return dict(state)


class LossyRelay(threading.Thread):
    """Stands between a ground station and a hub and loses some datagrams of both."""

    def __init__(self, hub: str, loss: float) -> None:
        super().__init__(daemon=True)
        host, port = hub.removeprefix("udpout:").split(":")
        self._hub = (host, int(port))
        self._loss = loss
        self._random = Random(1)
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.bind(("127.0.0.1", 0))
        self._closing = threading.Event()
        self.lost = 0

    @property
    def connect(self) -> str:
        return f"udpout:127.0.0.1:{self._front.getsockname()[1]}"

    def __enter__(self) -> "LossyRelay":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        self.join()

    def run(self) -> None:
        backs: dict[tuple[str, int], socket.socket] = {}
        stations: dict[socket.socket, tuple[str, int]] = {}
        with contextlib.ExitStack() as stack:
            stack.enter_context(self._front)
            while not self._closing.is_set():
                for sock in select.select([self._front, *stations], [], [], 0.05)[0]:
                    with contextlib.suppress(ConnectionRefusedError):
                        datagram, sender = sock.recvfrom(4096)
                        if self._random.random() < self._loss:
                            self.lost += 1
                        elif sock is not self._front:
                            self._front.sendto(datagram, stations[sock])
                        else:
                            if sender not in backs:
                                back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                                backs[sender] = stack.enter_context(back)
                                back.connect(self._hub)
                                stations[back] = sender
                            backs[sender].send(datagram)
