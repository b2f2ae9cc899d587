"""Starting and stopping the processes of a fleet: one plant, one autopilot per UAV.

Each process gets a configuration file on its command line; everything else reaches it over UDP.
Processes run in sessions of their own, so that Ctrl-C reaches only the ground station, which
stops them in order; they stop by themselves if it ends without doing so.
"""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Self, TypeVar

from gcs.errors import BadInput, FlightLost, PortInUse
from gcs.fleet.forked import Forked, ForkServer
from gcs.fleet.relays import through
from gcs.scenario.model import Scenario
from mavlink_defs.config.files import dump
from mavlink_defs.endpoint import EndpointError, PortTaken, UdpAddress, bind_udp, free_ports

__all__ = ["FleetProcesses", "check_ports", "on_free_ports"]

T = TypeVar("T")

_STOP_S = 5.0
_TRIES = 5
_PLANT = "plant"
_FORKS = sys.platform == "linux"  # elsewhere, libraries do not allow it


@dataclass(frozen=True)
class _Process:
    name: str
    popen: subprocess.Popen[bytes] | Forked
    log: Path
    address: UdpAddress  # that it binds

    def last_line(self) -> str:
        """Its last line on standard error, or its exit status."""
        if self.popen.returncode is not None and self.popen.returncode < 0:
            return f"ended by signal {-self.popen.returncode}"
        lines = self.log.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"ended with status {self.popen.returncode}"


def on_free_ports(scenario: Scenario, work: Callable[[Scenario, UdpAddress], T]) -> T:
    """Call `work` with free UDP ports, and again if another program takes one meanwhile.

    Args:
        scenario: On any ports.
        work: Called with the scenario on free ports of its host, and with an address for a hub.

    Raises:
        BadInput: The host is not this machine, or ports were taken on every attempt.
    """
    ids = [uav.id for uav in scenario.uavs]
    host = scenario.links.host
    tries = _TRIES
    while True:
        try:
            hub, gcs, plant, *formation = free_ports(4 + max(ids) - min(ids), host)
        except EndpointError as problem:
            raise BadInput(str(problem)) from None
        ports = {
            "gcs_port": gcs,
            "plant_port": plant,
            "formation_base_port": formation[0] - min(ids),
        }
        links = scenario.links.model_copy(update=ports)
        try:
            return work(scenario.model_copy(update={"links": links}), UdpAddress(host, hub))
        except PortInUse:
            tries -= 1
            if not tries:
                raise


def check_ports(scenario: Scenario, hub: UdpAddress | None = None) -> None:
    """Check that every port is free before any process starts.

    Args:
        scenario: The scenario.
        hub: Address for a hub; the GCS port is then not bound.

    Raises:
        BadInput: A port is in use, or the host is not this machine.
    """
    links = scenario.links
    ports = {
        "links.plant_port of the scenario": links.plant_port,
        **{
            f"links.formation_base_port + {uav.id} of the scenario": (
                links.formation_base_port + uav.id
            )
            for uav in scenario.uavs
        },
    }
    if hub is None:
        ports = {"links.gcs_port of the scenario": links.gcs_port, **ports}
    elif hub.port in {links.gcs_port, *ports.values()}:
        raise BadInput(f"--hub-port is {hub.port}, which the scenario already uses")
    else:
        ports = {"--hub-port": hub.port, **ports}
    for what, port in ports.items():
        try:
            address = UdpAddress(links.host, port)
            bind_udp(address, what, "let --free-ports choose others").close()
        except EndpointError as problem:
            raise BadInput(str(problem)) from None


class FleetProcesses:
    """The processes of one scenario, as a context manager that stops them all.

    Their configurations, logs and recordings go into `folder`. `via` maps addresses that
    autopilots send to onto those of relays, as `Relay.via` does.
    """

    def __init__(
        self,
        scenario: Scenario,
        speed: float | None,
        folder: Path,
        *,
        endless: bool = False,
        ground_stations: Sequence[UdpAddress] = (),
        via: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Prepare a fleet.

        Args:
            scenario: The scenario.
            speed: Real-time factor; None for lockstep.
            folder: For the files of the processes.
            endless: Ignore the scenario's duration, record nothing, and wait for autopilots that
                have fallen silent.
            ground_stations: Addresses that autopilots send to besides the scenario's GCS port.
            via: Relays to send through, as of `gcs.fleet.relays`.
        """
        self._scenario = scenario
        self._via = via
        self._speed = speed
        self._folder = folder
        self._endless = endless
        self._ground_stations = tuple(map(str, ground_stations))
        self._processes: list[_Process] = []
        self._server = ForkServer()
        self._ended: set[str] = set()

    def __enter__(self) -> Self:
        """Write the configurations and start all processes."""
        scenario = self._scenario
        self._folder.mkdir(parents=True, exist_ok=True)
        self._configure()
        steps = round(scenario.duration_s * 1e6 / scenario.step_us)
        try:
            self._start(_PLANT, scenario.links.plant_port, [])
            for uav in scenario.uavs:
                port = scenario.links.formation_base_port + uav.id
                arguments = [] if self._endless else ["--record-steps", str(steps)]
                self._start(f"uav{uav.id}", port, arguments)
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop all processes that still run."""
        self.stop()

    def recording_of(self, name: str) -> Path:
        """Return the file to which a process ("plant", "uav3") writes its recording at its end."""
        return self._folder / f"{name}.npz"

    @property
    def plant_returncode(self) -> int | None:
        """Exit status of the plant; None while it runs."""
        return self._processes[0].popen.poll()

    def check(self) -> None:
        """Check that no process has ended early.

        The plant may have ended because the flight was lost, which its recording says.

        Raises:
            BadInput: A process could not start; its log says why. PortInUse if another program
                has its port.
            FlightLost: An autopilot ended in mid-flight, or the plant without a recording.
        """
        for process in self._processes:
            status = process.popen.poll()
            if status == BadInput.exit_status:
                try:
                    bind_udp(process.address, process.name).close()
                except PortTaken:
                    raise PortInUse(process.last_line()) from None
                raise BadInput(process.last_line())
            if status and not self.recording_of(process.name).exists():
                raise FlightLost(f"{process.name}: {process.last_line()}")

    def newly_ended(self) -> list[tuple[str, str]]:
        """Return name and last log line of each process that has ended since the last call."""
        over = [
            p for p in self._processes if p.popen.poll() is not None and p.name not in self._ended
        ]
        self._ended |= {process.name for process in over}
        return [(process.name, process.last_line()) for process in over]

    def wait(self, timeout_s: float) -> None:
        """Wait for all processes to end by themselves, then stop the rest."""
        end = time.monotonic() + timeout_s
        for process in self._processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.popen.wait(max(end - time.monotonic(), 0.0))
        self.stop()

    def stop(self) -> None:
        """Terminate every process, and kill those that do not end."""
        running = [p.popen for p in self._processes if p.popen.poll() is None]
        for popen in running:
            popen.terminate()
        end = time.monotonic() + _STOP_S
        for popen in running:
            try:
                popen.wait(max(end - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                popen.kill()
                popen.wait(_STOP_S)
        self._server.close()

    def _configure(self) -> None:
        """Write the configuration file of each process."""
        plant = self._scenario.plant_config(self._speed, endless=self._endless)
        dump(plant, self._folder / f"{_PLANT}.yaml")
        for uav in self._scenario.uavs:
            config = through(self._scenario.autopilot_config(uav.id), self._via)
            gcs = (*config.gcs, *self._ground_stations)
            dump(config.model_copy(update={"gcs": gcs}), self._folder / f"uav{uav.id}.yaml")

    def _start(self, name: str, port: int, more: list[str]) -> None:
        config, log = self._folder / f"{name}.yaml", self._folder / f"{name}.log"
        record = [] if self._endless else ["--record", str(self.recording_of(name))]
        arguments = [str(config), *record, *more]
        popen: subprocess.Popen[bytes] | Forked
        if name != _PLANT and _FORKS:
            popen = self._server.start(arguments, log)
        else:
            module = "sitl_plant" if name == _PLANT else "ftc_autopilot"
            popen = _started(module, arguments, log)
        address = UdpAddress(self._scenario.links.host, port)
        self._processes.append(_Process(name, popen, log, address))


def _started(package: str, arguments: list[str], log: Path) -> subprocess.Popen[bytes]:
    """Start the process of a package."""
    command = [
        sys.executable,
        "-P",  # do not import from the user's current folder
        "-c",
        f"from {package}.process import main; main()",
        *arguments,
        "--exit-with-parent",
        str(os.getpid()),
    ]
    with log.open("wb") as output:
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
