"""A fleet in a test: real processes and a connected client, behind plain function calls.

The asyncio client runs on a thread of its own. In lockstep, simulated time advances only within
`run_until` and similar calls, so that everything a test does in between happens at an exact step,
and every run gives the same events. At a given speed, time runs on as for an operator.
"""

import asyncio
import contextlib
import math
import threading
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, TypeVar

from gcs.console.errors import BadInput, FlightLost, NoAnswer
from gcs.fleet.collector import Collector
from gcs.fleet.processes import FleetProcesses
from gcs.fleet.start import prepare, start_vehicle
from gcs.results.recording import Mode
from gcs.scenario.model import Scenario
from gcs.station.client import Client
from gcs.testing.results import FlightResult
from gcs.testing.step_gate import StepGate
from gcs.testing.uav import FlyingUav
from mavlink_defs.capture.tlog import TlogWriter
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.endpoint import Connection, UdpAddress

T = TypeVar("T")

_POLL_S = 0.005
_SETTLE_S = 0.03  # until autopilots have sent their telemetry of the step at which time stopped
_END_TIMEOUT_S = 10.0
_PATIENCE_S = 10.0


class TestFleet:
    """The processes of a scenario and the operations of a test on them.

    Attributes:
        scenario: The scenario, on the ports that it flies on.
        folder: `flight.tlog`, and `processes/` with configurations and logs of all processes.
        client: The asyncio client; `call` runs its coroutines.
    """

    __test__ = False  # pytest would collect a class of this name

    def __init__(self, scenario: Scenario, folder: Path, speed: float | None = None) -> None:
        """Prepare a fleet.

        Args:
            scenario: On ports that are free.
            folder: Exists.
            speed: Real-time factor; None for lockstep.
        """
        # what a test reads after `run_until` must not depend on how fast time has passed
        links = scenario.links.model_copy(update={"telemetry_clock": "simulated"})
        self.scenario = scenario.model_copy(update={"links": links})
        self.folder = folder
        self._speed = speed
        self._ids = [uav.id for uav in scenario.uavs]
        self._gate = StepGate(self._ids, closed=speed is None)
        processes = folder / "processes"
        self._fleet = FleetProcesses(self.scenario, speed, processes, gate=self._gate)
        self._relay = self._fleet.relay
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="client", daemon=True)
        self._stack = contextlib.ExitStack()
        self._flight: FlightResult | None = None

    def open(self) -> None:
        """Start everything, upload profile and faults; no UAV is armed.

        The caller must `close` the fleet, unless this fails: then nothing is left running.

        Raises:
            GcsError: As of `gcs.fleet.flight.prepare`.
        """
        links = self.scenario.links
        connection = Connection("in", UdpAddress(links.host, links.gcs_port))
        with contextlib.ExitStack() as stack:
            self._thread.start()
            stack.callback(self._end_loop)
            tlog = stack.enter_context(TlogWriter(self.folder / "flight.tlog"))
            key = links.signing_key
            self.client = Client(connection, tlog=tlog, private=True, signing_key=key)
            self.call(self.client.__aenter__())
            stack.callback(lambda: self.call(self.client.__aexit__(None, None, None)))
            stack.enter_context(self._fleet)
            self.call(prepare(self.client, self._fleet, self.scenario, start=False))
            self._stack = stack.pop_all()

    def close(self) -> None:
        """Stop all processes of the fleet."""
        self._gate.open()  # the processes end their links through it
        self._stack.close()

    def __repr__(self) -> str:
        return f"<fleet of {self.scenario.name!r} at {self.time_s:.3f} s>"

    def call(self, work: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine of the client to its end, and return its result."""
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return future.result()
        except BaseException:
            future.cancel()
            raise

    @property
    def uavs(self) -> dict[int, FlyingUav]:
        """All UAVs, by system id."""
        return {i: self.uav(i) for i in self._ids}

    def uav(self, system: int) -> FlyingUav:
        """Return one UAV, by its system id; KeyError if there is none."""
        return FlyingUav(self.client.vehicle(system), self.call, self.sent)

    # the wire

    @property
    def time_s(self) -> float:
        """Simulated time [s], as the tap has seen it; 0 before the flight begins."""
        with self._relay.counting() as tap:
            return tap.simulated_s or 0.0

    def sent(self, system: int, channel: str) -> int:
        """Return the transmissions of a channel ("rudder") of one UAV, as the tap counted.

        Raises:
            BadInput: There is no such channel.
        """
        if channel not in ACTUATORS:
            raise BadInput(f"channel: expected {', '.join(ACTUATORS)}, got {channel!r}")
        with self._relay.counting() as tap:
            return tap.events(system, channel)

    def wire(self) -> dict[str, Any]:
        """Return everything that the tap has counted so far, as in wire.json."""
        return self._relay.report().to_json()

    # time

    def begin(self) -> None:
        """Start the missions and arm all UAVs: simulated time begins, and stands at 0."""
        for system in self._ids:
            self.call(start_vehicle(self.client.vehicle(system), self.scenario))
        for uav in self.uavs.values():
            uav.arm()

    def run_until(self, time_s: float) -> None:
        """Let simulated time pass until the step at a time [s] is done.

        Raises:
            BadInput: The scenario ends before that time, or it has passed.
            FlightLost: An aircraft or a process was lost.
            NoAnswer: Time does not advance, because not every UAV is armed.
        """
        step = round(time_s * 1e6 / self.scenario.step_us)
        if not self.time_s <= step * self.scenario.step_us / 1e6 < self.scenario.duration_s:
            raise BadInput(
                f"cannot run until {time_s:g} s: it is {self.time_s:g} s, and the scenario ends "
                f"at {self.scenario.duration_s:g} s, which run_to_end() flies to"
            )
        if self._speed is not None:
            self._wait(lambda: self.time_s >= time_s)
        else:
            self._gate.move(step)
            self._wait(lambda: self._gate.is_reached)
            time.sleep(_SETTLE_S)
        if self._fleet.plant_returncode is not None:
            raise FlightLost(self.end().loss or "the plant ended")

    def run_for(self, duration_s: float) -> None:
        """Let simulated time pass [s]; as `run_until`."""
        self.run_until(self.time_s + duration_s)

    def wait_until(
        self, condition: Callable[[], bool], within_s: float, every_s: float = 0.1
    ) -> None:
        """Let simulated time pass until a condition is met; it is checked every `every_s` [s].

        Raises:
            AssertionError: It is not met within this simulated time [s].
            GcsError: As of `run_until`.
        """
        __tracebackhide__ = True
        begin_s = self.time_s
        while not condition():
            if self.time_s - begin_s >= within_s - 1e-9:
                text = f"expected within {within_s:g} s from {begin_s:.3f} s on, but not met"
                raise AssertionError(f"{text} at {self.time_s:.3f} s")
            self.run_until(min(self.time_s + every_s, begin_s + within_s))

    def run_to_end(self) -> FlightResult:
        """Fly until the scenario's end, or until an aircraft is lost."""
        self._gate.open()
        self._wait(lambda: False)
        return self.end()

    def end(self) -> FlightResult:
        """End the flight now, and return its result.

        Raises:
            FlightLost: It had not begun, or a process left no recording.
        """
        if self._flight is None:
            if not self._has_begun:
                raise FlightLost("the flight had not begun: begin() arms everybody")
            self._gate.open()
            over = self._fleet.plant_returncode is not None
            self._fleet.wait(_END_TIMEOUT_S if over else 0.0)
            self.call(self.client.catch_up(_END_TIMEOUT_S))
            mode: Mode = "real_time" if self._speed else "lockstep"
            self._fleet.check()
            recording = Collector(self.scenario, self._fleet.recording_of).recording(mode)
            self._flight = FlightResult(self.scenario, recording, self._relay.report(), self.folder)
        return self._flight

    # inside

    @property
    def _has_begun(self) -> bool:
        with self._relay.counting() as tap:
            return tap.simulated_s is not None

    def _wait(self, condition: Callable[[], bool]) -> None:
        """Wait for a condition or the end of the plant while simulated time advances."""
        newest_s, moved_at = -math.inf, time.monotonic()
        while not condition() and self._fleet.plant_returncode is None:
            self._fleet.check()
            time.sleep(_POLL_S)
            if (now_s := self.time_s) > newest_s:
                newest_s, moved_at = now_s, time.monotonic()
            elif time.monotonic() - moved_at > _PATIENCE_S:
                idle = [str(i) for i, uav in self.uavs.items() if not uav.state.armed]
                why = f": UAV {', '.join(idle)} not armed" if idle else ""
                raise NoAnswer(f"simulated time stands at {newest_s:.3f} s{why}")
        self._fleet.check()

    def _end_loop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
