"""Starting and stopping the processes of a fleet: one plant, one for each autopilot or for several.

Each process gets its configuration files on its command line; everything else reaches it over UDP.
Processes run in sessions of their own, so that Ctrl-C reaches only the ground station, which
stops them in order; they stop by themselves if it ends without doing so.
"""

import contextlib
import itertools
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Self

from ftc_autopilot.config import PLUGIN_FAILED
from gcs.console.errors import BadInput, FlightLost, PortInUse
from gcs.fleet.forked import FORKS, Forked, ForkServer, processor_time_s, start_alone
from gcs.fleet.relays import Gate, relay_of, through
from gcs.fleet.restarts import MAX_IN_A_ROW, Restarts
from gcs.scenario.model import Scenario
from gcs.scenario.plugins import libraries_of
from mavlink_defs.config.files import dump
from mavlink_defs.endpoint import PortTaken, UdpAddress, bind_udp
from mavlink_defs.runtime.spool import SpoolReader

_STOP_S = 5.0
_SUPERVISED_SILENCE_S = 86_400.0  # of the plant, before an autopilot gives it up
_PLANT = "plant"


@dataclass
class _Process:
    name: str
    arguments: list[str]
    log: Path
    addresses: list[UdpAddress]  # that it binds
    recordings: list[Path]
    popen: subprocess.Popen[bytes] | Forked

    def last_line(self) -> str:
        """Its last line on standard error, or its exit status."""
        if self.popen.returncode is not None and self.popen.returncode < 0:
            return f"ended by signal {-self.popen.returncode}"
        lines: list[str] = []
        with contextlib.suppress(OSError):  # the run folder is gone
            lines = self.log.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"ended with status {self.popen.returncode}"


class FleetProcesses:
    """The processes of one scenario, as a context manager that stops them all.

    Their configurations, logs and recordings go into `folder`.

    Attributes:
        relay: The relays between them, as the scenario asks for them.
    """

    def __init__(
        self,
        scenario: Scenario,
        speed: float | None,
        folder: Path,
        *,
        endless: bool = False,
        record: bool = True,
        restart: bool = False,
        autopilot_processes: int | None = None,
        crashes: Mapping[int, Sequence[int]] = MappingProxyType({}),
        ground_stations: Sequence[UdpAddress] = (),
        gate: Gate | None = None,
    ) -> None:
        """Prepare a fleet.

        Args:
            scenario: The scenario.
            speed: Real-time factor; None for lockstep.
            folder: For the files of the processes.
            endless: Ignore the scenario's duration, wait for autopilots that have fallen silent,
                and fly on if a file of the run folder cannot be written.
            record: Record what a `Collector` takes away.
            restart: Start autopilots that fail again; they resume from their checkpoints.
            autopilot_processes: How many processes the autopilots share, only in lockstep and
                without `restart`; None: each has its own.
            crashes: Steps after which autopilots crash, by UAV, one for each start: for tests.
            ground_stations: Addresses that autopilots send to besides the scenario's GCS port.
            gate: As of `relay_of`.
        """
        self.relay = relay_of(scenario, gate)
        self._scenario = scenario
        self._speed = speed
        self._folder = folder
        self._endless = endless
        self._record = record
        self._restart = restart
        self._autopilot_processes = autopilot_processes
        self._crashes = {f"uav{uav}": list(steps) for uav, steps in crashes.items()}
        self._libraries = libraries_of(scenario.controller, scenario.trigger, scenario.guidance)
        self._restarts = Restarts()
        self._restarted: list[str] = []
        self._ground_stations = tuple(map(str, ground_stations))
        self._processes: list[_Process] = []
        self._server = ForkServer()
        self._ended: set[str] = set()
        self._given_up: set[str] = set()

    def __enter__(self) -> Self:
        """Write the configurations and start all processes."""
        scenario = self._scenario
        self._folder.mkdir(parents=True, exist_ok=True)
        with contextlib.ExitStack() as stack:
            stack.enter_context(self.relay)
            stack.callback(self.stop)
            self._configure()
            base = scenario.links.formation_base_port
            self._start([_PLANT], [scenario.links.plant_port], more=True)
            *shares, last = self._shares()
            for uavs in (*shares, last):
                ports, options = [base + uav for uav in uavs], self._options(uavs[0])
                names = [f"uav{uav}" for uav in uavs]
                self._start(names, ports, *options, more=uavs is not last)
            self._stack = stack.pop_all()
        return self

    def _shares(self) -> list[list[int]]:
        """Return the UAVs of each autopilot process, as many in one as in another.

        Each foreign autopilot has a bridge of its own.
        """
        foreign = self._scenario.foreign
        ids = [uav.id for uav in self._scenario.uavs if uav.id not in foreign]
        count = min(self._autopilot_processes or len(ids), len(ids))
        ends = [k * len(ids) // count for k in range(count + 1)] if ids else []
        ours = [ids[begin:end] for begin, end in itertools.pairwise(ends)]
        return [*ours, *([uav] for uav in foreign)]

    def _options(self, uav: int) -> list[str]:
        """Return the options that only an autopilot has."""
        if not self._restart:
            return []
        checkpoint = self._checkpoint_of(f"uav{uav}")
        checkpoint.unlink(missing_ok=True)
        return ["--checkpoint", str(checkpoint)]

    def _checkpoint_of(self, name: str) -> Path:
        return self._folder / f"{name}.checkpoint"

    def _is_restartable(self, process: _Process) -> bool:
        """Return whether a dead process is started again; a foreign autopilot once it flies."""
        if process.name == _PLANT or not self._restart:
            return False
        foreign = {f"uav{uav}" for uav in self._scenario.foreign}
        return process.name not in foreign or self._checkpoint_of(process.name).exists()

    def __exit__(self, *_: object) -> None:
        """Stop all processes that still run."""
        self._stack.close()

    def recording_of(self, name: str) -> Path:
        """Return the folder for the recording of the plant ("plant") or a UAV ("uav3")."""
        return self._folder / name

    @property
    def plant_returncode(self) -> int | None:
        """Exit status of the plant; None while it runs."""
        return self._processes[0].popen.poll()

    def computed_s(self, uav: int) -> float | None:
        """Return the processor time that a UAV's process has used [s]; None if that is unknown."""
        recording = self.recording_of(f"uav{uav}")
        (popen,) = (p.popen for p in self._processes if recording in p.recordings)
        return processor_time_s(popen.working_pid if isinstance(popen, Forked) else popen.pid)

    def restarts_of(self, uav: int) -> int:
        """Return how often an autopilot was started again."""
        return self._restarts.counts[f"uav{uav}"]

    def check(self) -> None:
        """Check that no process has ended early; start autopilots that failed again, if asked.

        The plant may have ended because the flight was lost, which its recording says.

        Raises:
            BadInput: A process could not start; its log says why. PortInUse if another program
                has its port.
            FlightLost: An autopilot ended in mid-flight, or the plant without a recording.
        """
        for process in list(self._processes):
            status = process.popen.poll()
            if process.name in self._given_up:
                continue
            if status == PLUGIN_FAILED and process.name != _PLANT:
                if self.plant_returncode is None:
                    self._processes[0].popen.terminate()  # the flight is over
                continue
            if status == BadInput.exit_status:
                if self._endless and self._restarts.counts[process.name]:
                    self._give_up(process, process.last_line())
                    continue
                try:
                    for address in process.addresses:
                        bind_udp(address, process.name).close()
                except PortTaken:
                    raise PortInUse(process.last_line()) from None
                raise BadInput(process.last_line())
            if status and self._is_torn(process):
                if not self._is_restartable(process):
                    raise FlightLost(f"{process.name}: {self._reason_of(process)}")
                self._start_again(process)

    def _reason_of(self, process: _Process) -> str:
        """Return the last line of a process, and what may be behind its end by a signal."""
        reason, killed = process.last_line(), (process.popen.returncode or 0) < 0
        if killed and process.name != _PLANT and self._libraries:
            reason += f"; it flew the shared library {' and '.join(self._libraries)}"
        return reason

    def _is_torn(self, process: _Process) -> bool:
        """Return whether a process ended without the end of its recording."""
        readers = map(SpoolReader, process.recordings)
        return self._endless or any(reader.facts is None for reader in readers)

    def newly_restarted(self) -> list[str]:
        """Return the autopilots that were started again since the last call, with the reason."""
        restarted, self._restarted = self._restarted, []
        return restarted

    def newly_ended(self) -> list[tuple[str, str]]:
        """Return name and last log line of each process that has ended since the last call."""
        over = [
            p
            for p in self._processes
            if p.popen.poll() is not None
            and p.name not in self._ended
            and (p.name in {*self._given_up, _PLANT} or not (self._restart and p.popen.returncode))
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
        if self._restart:
            plant = plant.model_copy(update={"wait_for_restart": True})
        foreign = self._scenario.foreign.values()
        patience_s = max((own.answers_within_s + _STOP_S for own in foreign), default=None)
        if patience_s is not None:  # a bridge says it first
            plant = plant.model_copy(update={"silence_timeout_s": patience_s})
        dump(plant, self._folder / f"{_PLANT}.yaml")
        for uav in self._scenario.uavs:
            config = through(self._scenario.autopilot_config(uav.id), self.relay.via)
            changes: dict[str, object] = {"gcs": (*config.gcs, *self._ground_stations)}
            if self._restart:  # the supervisor sees the plant end; a slow one is waited for
                changes["silence_timeout_s"] = _SUPERVISED_SILENCE_S
            elif patience_s is not None:
                changes["silence_timeout_s"] = patience_s
            dump(config.model_copy(update=changes), self._folder / f"uav{uav.id}.yaml")

    def _start(self, parts: Sequence[str], ports: Sequence[int], *options: str, more: bool) -> None:
        """Start the process of the plant or of autopilots, which bind `ports`; others follow."""
        name = parts[0] if len(parts) == 1 else f"{parts[0]}-{parts[-1]}"
        log, recordings = self._folder / f"{name}.log", list(map(self.recording_of, parts))
        configs = [str(self._folder / f"{part}.yaml") for part in parts]
        arguments = [*configs, *options]
        if self._record:
            arguments += itertools.chain(*(("--record", str(path)) for path in recordings))
        arguments += ["--record-optional"] if self._endless else []
        log.write_bytes(b"")
        addresses = [UdpAddress(self._scenario.links.host, port) for port in ports]
        popen = self._launched(name, arguments, log, more)
        self._processes.append(_Process(name, arguments, log, addresses, recordings, popen))

    def _start_again(self, process: _Process) -> None:
        """Start a dead autopilot again when its pause is over.

        Raises:
            FlightLost: It has failed too often.
            OSError: A file cannot be written; with `endless` the process is given up instead.
        """
        now, reason = time.monotonic(), self._reason_of(process)
        due = self._restarts.is_due(process.name, now)
        if due is None:
            if self._endless and self._libraries:
                self._give_up(process, f"{reason}, {MAX_IN_A_ROW + 1} times in a row")
                return
            text = f"{process.name}: {reason}, {MAX_IN_A_ROW + 1} times in a row"
            raise FlightLost(f"{text} soon after its start")
        if not due:
            return
        try:
            gone = self._restore_folder()
            process.popen = self._launched(process.name, process.arguments, process.log)
        except OSError as problem:
            if not self._endless:
                raise
            self._give_up(process, f"cannot write {problem.filename}: {problem.strerror}")
        else:
            how = ", without its checkpoint, which is gone: disarmed, no profile" if gone else ""
            self._restarted.append(f"{process.name}: {reason}; started again{how}")

    def _give_up(self, process: _Process, reason: str) -> None:
        """Leave a process dead, and the others flying."""
        self._given_up.add(process.name)
        self._restarted.append(f"{process.name}: not started again: {reason}")

    def _restore_folder(self) -> bool:
        """Write the configurations again if the run folder was removed; return whether it was."""
        if (self._folder / f"{_PLANT}.yaml").exists():
            return False
        self._folder.mkdir(parents=True, exist_ok=True)
        self._configure()
        return True

    def _launched(
        self, name: str, arguments: list[str], log: Path, more: bool = False
    ) -> "subprocess.Popen[bytes] | Forked":
        """Start a process that appends to its log; `more`: others follow at once."""
        crashes = self._crashes.get(name)
        crash = ["--crash-at", str(crashes.pop(0))] if crashes else []
        self._restarts.started(name, time.monotonic())
        program = "sitl-plant" if name == _PLANT else "ftc-autopilot"
        if not FORKS:
            return start_alone(program, [*arguments, *crash], log)
        return self._server.start(program, [*arguments, *crash], log, more=more)
