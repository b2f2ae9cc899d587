"""``gcs ardupilot``: an ArduPilot SITL flies a scenario's aircraft, in place of our autopilots."""

import contextlib
import shutil
import socket
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from ftc_autopilot.plugins.loading import without_code
from gcs.commands.common import (
    QuietOption,
    RunFolderOption,
    ScenarioArgument,
    SetOption,
    WithOption,
    changed_scenario,
    check_simulators,
    warm_up,
)
from gcs.commands.progress import working
from gcs.commands.station import systems_in
from gcs.errors import BadInput, FlightLost, Interrupted, NoAnswer
from gcs.results.choices import Record
from gcs.results.run_folder import SCENARIO
from gcs.scenario.model import Scenario
from gcs.scenario.sections import Network
from gcs.scenario.settings import values_of
from gcs.station.connection import warn_if_exposed
from gcs.terminal import console_of, print_json
from mavlink_defs.endpoint import UdpAddress
from sitl_plant.ardupilot.protocol import LONGEST_STEP_US, PORT, PORTS_APART

if TYPE_CHECKING:
    from gcs.fleet.ardupilot_sockets import Served
    from gcs.results.ardupilot import ArduPilotSummary, FrameSummary
    from gcs.results.recording import Ending, Steps

_LAST_PORT = 65535

EPILOG = """
Examples:

- gcs ardupilot paper/scenario1 --uav 1    (then: arduplane --model JSON:127.0.0.1 -I 0)
- gcs ardupilot my.yaml --set duration_s=600 --set ardupilot.throttle.min_us=1100
- gcs ardupilot my.yaml --set step_us=2500 --json
- gcs ardupilot my.yaml --faults-port 14570    (then: gcs fault set rudder --stuck-deg 5
  --connect udpout:127.0.0.1:14570)

Exit status: 0 flown to its end, 1 lost, not recorded, or an ArduPilot fell silent, 2 bad input,
4 no ArduPilot came, 130 Ctrl-C (143 SIGTERM, 129 SIGHUP).
"""


def ardupilot(
    scenario: ScenarioArgument,
    additions: WithOption = None,
    settings: SetOption = None,
    port: Annotated[
        int,
        typer.Option(
            min=1,
            max=_LAST_PORT,
            help=f"UDP port of the first UAV; each further one has a port {PORTS_APART} higher, as "
            "the instances of ArduPilot do.",
            metavar="PORT",
        ),
    ] = PORT,
    patience: Annotated[
        float,
        typer.Option(
            min=0.1, help="Silence of an ArduPilot after which the flight ends [s].", metavar="S"
        ),
    ] = 60.0,
    faults_port: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=_LAST_PORT,
            help="UDP port where gcs fault sets, clears and lists faults in flight, with --connect "
            "udpout:HOST:PORT. Without it, only the scenario's faults act.",
            metavar="PORT",
        ),
    ] = None,
    uav: Annotated[
        str | None,
        typer.Option(
            metavar="IDS", help="Fly these UAVs only, such as 1,3; all of the scenario by default."
        ),
    ] = None,
    out: RunFolderOption = None,
    record: Annotated[
        Record, typer.Option(help="What is recorded of the steps, as of gcs fly.")
    ] = Record.LIGHT,
    no_figures: Annotated[
        bool, typer.Option("--no-figures", envvar="FTC_SITL_NO_FIGURES", help="Draw no figures.")
    ] = False,
    quiet: QuietOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print summary.json on standard output instead.")
    ] = False,
) -> None:
    """Let ArduPilot SITLs fly a scenario's aircraft.

    It has the scenario's faults, servos, wind and sensors.

    The plant answers as the physics of ArduPilot's JSON interface (--model JSON): one UDP port for
    each UAV. The scenario's law, trigger and profile, or mission, are not flown: ArduPilot decides.
    The aircraft are held until ArduPilot commands thrust, and launched to their initial state;
    then the time of the scenario, and of its faults, begins. Changes of the outputs are counted as
    the events of our autopilots are.
    """
    with without_code():
        whole = changed_scenario(scenario, additions, settings)
    loaded = _chosen(whole, None if uav is None else systems_in(uav))
    _check(loaded, port)
    check_simulators(loaded)
    from gcs.fleet.ardupilot_sockets import bound
    from gcs.results.disk_space import check_space
    from gcs.results.flight_mark import FlightMark, marked
    from gcs.results.run_folder import make_run_folder

    mark = FlightMark.of("ardupilot", str(scenario), loaded, additions, values_of(settings or ()))
    mark = replace(mark, law="ArduPilot", trigger="")
    addresses = [
        UdpAddress(loaded.links.host, port + PORTS_APART * k) for k in range(len(loaded.uavs))
    ]
    console = console_of(quiet=quiet)
    stations = [] if faults_port is None else [UdpAddress(loaded.links.host, faults_port)]
    with (
        bound(addresses) as sockets,
        bound(stations, "choose another with --faults-port") as station,
    ):
        is_new = out is None or not out.exists()
        folder = make_run_folder(out, loaded.name)
        check_space(folder, loaded, record, over_udp=False, restart=False)
        for address in (*addresses, *stations):
            warn_if_exposed(address, with_key=False)
        try:
            warm_up(whole, console, law=False)
            flown = _Flown(loaded, folder, addresses, record, console)
            with marked(folder, loaded, mark), contextlib.closing(flown):
                flown.fly(sockets, patience, next(iter(station), None))
                _report(flown, no_figures=no_figures, as_json=as_json)
        except NoAnswer:
            _remove(folder, is_new)
            raise
        except KeyboardInterrupt:
            _remove(folder, is_new)
            raise Interrupted("interrupted before the flight began") from None


def _remove(folder: Path, is_new: bool) -> None:
    """Remove the recording of a flight that never began, and its folder if it is new."""
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            path.unlink()
        if is_new:
            folder.rmdir()


def _chosen(scenario: Scenario, ids: "set[int] | list[int] | None") -> Scenario:
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
    if scenario.step_us >= LONGEST_STEP_US:
        raise BadInput(
            f"step_us is {scenario.step_us} us: ArduPilot's clock stands still with steps of "
            f"{LONGEST_STEP_US} us or more",
            "choose shorter ones, as with --set step_us=1000",
        )
    if scenario.links.impairments is not None:
        raise BadInput(
            "links.impairments apply to our own links, of which ArduPilot uses none",
            "leave them out, as with --set links.impairments=null",
        )


class _Flown:
    """A flight by ArduPilot, and its recording: another one begins when the flight begins again."""

    def __init__(
        self,
        scenario: Scenario,
        folder: Path,
        addresses: list[UdpAddress],
        record: Record,
        console: Console,
    ) -> None:
        from gcs.fleet.ardupilot_flight import ArduPilotFlight
        from gcs.fleet.ardupilot_sockets import Served
        from gcs.results.recorder import FlightRecorder

        self.scenario, self.folder, self.addresses = scenario, folder, addresses
        self.console = console
        self._record = record
        self.recorder: FlightRecorder = FlightRecorder(scenario, folder, record)
        self.recorder.load_code()
        flight = ArduPilotFlight(
            scenario,
            self._add,
            lambda text: console.print(text, soft_wrap=True),
            self._begin_again,
        )
        flight.load_code()
        self.served: Served = Served(flight)
        self.stopped = False

    def _add(self, steps: "Steps") -> None:
        self.recorder.add(steps)

    def _begin_again(self) -> None:
        """Keep what was flown so far in a folder of its own, and begin another recording."""
        from gcs.results.flight_mark import FLIGHT
        from gcs.results.recorder import FlightRecorder

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
            self.console.print(f"what was flown before is in {kept}", soft_wrap=True)
        self.recorder = FlightRecorder(self.scenario, self.folder, self._record)

    def finish(self) -> "tuple[ArduPilotSummary, Ending]":
        """Complete the recording, with its summary."""
        from gcs.results.ardupilot import ardupilot_summary

        ending = self.served.flight.ending(self.served.wall_s)
        frames = _frames(self.served, self.scenario, self.addresses)
        summary = ardupilot_summary(self.recorder.finish(ending), frames)
        summary.save(self.folder)
        return summary, ending

    def close(self) -> None:
        """Complete the files of the recording."""
        self.recorder.close()

    def fly(
        self,
        sockets: list[socket.socket],
        patience_s: float,
        station: socket.socket | None,
    ) -> None:
        """Serve the ArduPilots to the end of the flight, or until Ctrl-C.

        Raises:
            NoAnswer: No ArduPilot came.
        """
        from gcs.fleet.ardupilot_sockets import how_to_start, serve

        scenario, console = self.scenario, self.console
        law = scenario.controller.kind
        lines = (
            f"waiting for ArduPilot, which flies in place of the scenario's law ({law}) and its "
            "profile or mission; start",
            *how_to_start(scenario, self.addresses),
        )
        for line in lines:
            console.print(line, soft_wrap=True)
        with working(console) as work:
            task = work.add(scenario.name, scenario.duration_s, "s", rated=False)

            def show(time_s: float) -> None:
                task.show(time_s, f"{int(self.served.flight.events.sum())} events")

            def notify(text: str) -> None:
                console.print(text, soft_wrap=True)

            try:
                serve(scenario, self.served, sockets, patience_s, notify, show, station)
            except KeyboardInterrupt:
                if not (self.served.flight.step or self.served.flight.restarts):
                    raise
                self.stopped = True
        self.served.flight.keep()


def _report(flown: _Flown, *, no_figures: bool, as_json: bool) -> None:
    from gcs.reports.ardupilot import ardupilot_tables

    served, console = flown.served, flown.console
    summary, ending = flown.finish()
    if ending.steps and not no_figures:
        from gcs.figures.overview import draw_flight

        with working(console, "drawing the flight"):
            preview = flown.recorder.preview
            draw_flight(preview.recording(ending), flown.scenario, preview.gaps(), flown.folder)
    output = console_of(stderr=as_json, quiet=console.quiet)
    if as_json:
        print_json(summary.to_json(), indent=2)
    else:
        output.print(*ardupilot_tables(summary, flown.scenario), sep="\n")
    output.print(f"results in {flown.folder}", soft_wrap=True)
    if flown.stopped:
        raise Interrupted(f"interrupted at {summary.flight.duration_s:g} s")
    if served.silence is not None:
        raise FlightLost(
            served.silence, "a longer --patience waits longer, for one that is started again, say"
        )
    if summary.flight.loss is not None:
        raise FlightLost(summary.flight.loss)


def _frames(
    served: "Served", scenario: Scenario, addresses: list[UdpAddress]
) -> "list[FrameSummary]":
    from gcs.results.ardupilot import FrameSummary

    return [
        FrameSummary(
            uav=uav.id,
            port=address.port,
            channels=len(peer.packet.pulses_us) if peer.packet else 0,
            rate_hz=peer.packet.rate_hz if peer.packet else 0,
            frames=peer.frames,
            repeated=peer.repeated,
            missing=peer.missing,
            restarts=peer.restarts,
            dropped=dict(peer.dropped),
        )
        for uav, address, peer in zip(scenario.uavs, addresses, served.flight.peers, strict=True)
    ]
