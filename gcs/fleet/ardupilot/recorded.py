"""A flight by ArduPilot SITLs in place of our autopilots: prepared, flown and recorded."""

import shutil
import socket
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ftc_autopilot.plugins.loading import without_code
from gcs.console.errors import BadInput
from gcs.fleet.ardupilot.flight import ArduPilotFlight
from gcs.fleet.ardupilot.sockets import Served, serve
from gcs.fleet.preparation import How, Prepared, check_simulators
from gcs.fleet.remarks import exposures
from gcs.results.ardupilot import (
    ArduPilotSummary,
    FrameSummary,
    MotionBands,
    MotionExtremes,
    ardupilot_summary,
)
from gcs.results.choices import Record
from gcs.results.flight_mark import FLIGHT, FlightMark
from gcs.results.recorder import FlightRecorder
from gcs.results.recording import Ending, Steps
from gcs.results.run_folder import SCENARIO
from gcs.scenario.changes import ScenarioLike, with_changes
from gcs.scenario.model import Scenario
from gcs.scenario.sections import Network, ScenarioUav
from mavlink_defs.endpoint import UdpAddress
from sitl_plant.ardupilot.peer import Peer
from sitl_plant.ardupilot.protocol import MAX_STEP_US, PORTS_APART

_LAST_PORT = 65535


def prepare_ardupilot(
    scenario: ScenarioLike,
    uavs: Collection[int] | None,
    port: int,
    *,
    additions: Sequence[str],
    values: Mapping[str, Any],
    record: Record,
) -> Prepared:
    """Prepare a flight by ArduPilots.

    Args:
        scenario: A scenario, a file, or the name of a bundled one; its law is not loaded.
        uavs: The UAVs that fly, each by itself; None for all.
        port: UDP port of the first.
        additions: As of ``--with``.
        values: As of ``--set``.
        record: How much of the steps is recorded.

    Raises:
        BadInput: ArduPilot cannot fly it, or there is no such UAV.
        ConfigError: A file cannot be used, or the result is no valid scenario.
    """
    with without_code():
        flown = _chosen(with_changes(scenario, additions, values, "--set"), uavs)
    _check(flown, port)
    check_simulators(flown)
    mark = FlightMark.of("ardupilot", str(scenario), flown, additions, values)
    remarks = tuple(exposures(flown.links, with_key=False))
    how = How(over_udp=False, record=record)
    return Prepared(flown, how, replace(mark, law="ArduPilot", trigger=""), remarks)


def _chosen(scenario: Scenario, ids: Collection[int] | None) -> Scenario:
    """Return a scenario with these UAVs only, each by itself: without network, slots and path.

    Raises:
        BadInput: It has no such UAV.
    """
    known = [uav.id for uav in scenario.uavs]
    if strange := set(ids or ()) - set(known):
        raise BadInput(
            f"--uav: expected UAVs of the scenario, {', '.join(map(str, known))}, "
            f"got {', '.join(map(str, sorted(strange)))}"
        )
    flown = set(known if ids is None else ids)
    return scenario.model_copy(
        update={
            "uavs": tuple(uav for uav in scenario.uavs if uav.id in flown),
            "faults": tuple(fault for fault in scenario.faults if fault.uav in flown),
            "network": Network(leader_access={}),
            "formation": None,
            "mission": None,
        }
    )


def _check(scenario: Scenario, port: int) -> None:
    """Check that ArduPilot can fly a scenario.

    Raises:
        BadInput: It cannot.
    """
    last = port + PORTS_APART * (len(scenario.uavs) - 1)
    if last > _LAST_PORT:
        raise BadInput(
            f"--port is {port}: the last of {len(scenario.uavs)} UAVs would have port {last}, "
            f"expected at most {_LAST_PORT}",
            "choose a lower one",
        )
    if scenario.step_us >= MAX_STEP_US:
        raise BadInput(
            f"step_us is {scenario.step_us} us: ArduPilot's clock stands still with steps of "
            f"{MAX_STEP_US} us or more",
            "choose shorter ones, as with --set step_us=1000",
        )
    if scenario.links.impairments is not None:
        raise BadInput(
            "links.impairments apply to our own links, of which ArduPilot uses none",
            "leave them out, as with --set links.impairments=null",
        )


class ArduPilotFlown:
    """A flight by ArduPilot, and its recording: another one begins when the flight begins again.

    Attributes:
        scenario: What is flown.
        folder: Its run folder.
        served: The flight.
        recorder: Its recording.
        stopped: Whether Ctrl-C ended it.
    """

    def __init__(
        self,
        prepared: Prepared,
        folder: Path,
        addresses: Sequence[UdpAddress],
        tell: Callable[[str], None],
    ) -> None:
        """Load the code and make the files.

        Args:
            prepared: The flight.
            folder: Its run folder.
            addresses: Where the ArduPilot of each UAV sends to.
            tell: Called with lines for the operator.

        Raises:
            OSError: A file cannot be written; it is named.
        """
        self.scenario, self.folder = prepared.scenario, folder
        self._record, self._addresses, self._tell = prepared.how.record, addresses, tell
        self.recorder = FlightRecorder(self.scenario, folder, self._record)
        self.recorder.load_code()
        self._motion = MotionExtremes(len(self.scenario.uavs))
        flight = ArduPilotFlight(self.scenario, self._add, tell, self._begin_again)
        flight.load_code()
        self.served = Served(flight)
        self.stopped = False

    def fly(
        self,
        sockets: Sequence[socket.socket],
        patience_s: float,
        station: socket.socket | None,
        on_progress: Callable[[float, int], None],
    ) -> None:
        """Serve the ArduPilots to the end of the flight, or until Ctrl-C.

        Args:
            sockets: As of `serve`.
            patience_s: As of `serve`.
            station: As of `serve`.
            on_progress: Called with the simulated time [s] and the number of events so far.

        Raises:
            NoAnswer: No ArduPilot came.
        """
        flight = self.served.flight

        def show(time_s: float) -> None:
            on_progress(time_s, int(flight.events.sum()))

        try:
            serve(self.scenario, self.served, sockets, patience_s, self._tell, show, station)
        except KeyboardInterrupt:
            if not (flight.step or flight.restarts):
                raise
            self.stopped = True
        flight.keep()

    def finish(self) -> tuple[ArduPilotSummary, Ending]:
        """Complete the recording, with its summary."""
        ending = self.served.flight.ending(self.served.wall_s)
        uavs, peers = self.scenario.uavs, self.served.flight.peers
        bands = map(self._motion.bands, range(len(uavs)))
        frames = list(map(_frames, uavs, self._addresses, peers, bands))
        summary = ardupilot_summary(self.recorder.finish(ending), frames)
        summary.save(self.folder)
        return summary, ending

    def close(self) -> None:
        """Complete the files of the recording."""
        self.recorder.close()

    def _add(self, steps: Steps) -> None:
        self.recorder.add(steps)
        self._motion.add(steps)

    def _begin_again(self) -> None:
        """Keep what was flown so far in a folder of its own, and begin another recording."""
        self.recorder.close()
        flight = self.served.flight
        if flight.step:
            self.finish()
            kept = self.folder / f"before-restart-{flight.restarts}"
            kept.mkdir()
            for path in self.folder.glob("*.*"):
                if path.name == SCENARIO:
                    shutil.copy(path, kept)
                elif path.name != FLIGHT:
                    path.rename(kept / path.name)
            self._tell(f"what was flown before is in {kept}")
        self.recorder = FlightRecorder(self.scenario, self.folder, self._record)
        self._motion = MotionExtremes(len(self.scenario.uavs))


def _frames(
    uav: ScenarioUav, address: UdpAddress, peer: Peer, motion: MotionBands | None
) -> FrameSummary:
    return FrameSummary(
        uav=uav.id,
        port=address.port,
        channels=len(peer.packet.pulses_us) if peer.packet else 0,
        rate_hz=peer.packet.rate_hz if peer.packet else 0,
        frames=peer.frames,
        repeated=peer.repeated,
        missing=peer.missing,
        restarts=peer.restarts,
        dropped=dict(peer.dropped),
        motion=motion,
    )
