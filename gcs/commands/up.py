"""``gcs up``: a fleet that flies until it is stopped."""

import asyncio
import contextlib
from collections.abc import Coroutine, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from gcs.commands import common
from gcs.commands.listening import listen, listening_address
from gcs.commands.options import InsecureOption, options_of, with_options
from gcs.console.errors import BadInput, Interrupted
from gcs.console.extras import load_package
from gcs.console.lines import print_json
from gcs.console.progress import working
from gcs.console.stopping import stop_signals
from gcs.console.terminal import console_of
from gcs.scenario.model import Scenario
from gcs.scenario.signing_key import refuse_unsigned
from mavlink_defs.config.models import counted
from mavlink_defs.endpoint import Connection, UdpAddress
from mavlink_defs.ports import HUB_PORT

if TYPE_CHECKING:
    from gcs.commands.foxglove import FoxgloveServer

FOXGLOVE = "127.0.0.1:8765"
"""Where Foxglove looks for a WebSocket unless it is given another address."""


@dataclass(frozen=True)
class UpOptions(common.FleetOptions):
    """Options of ``gcs up``.

    Attributes:
        speed: Real-time factor; 1 by default.
        lockstep: As fast as the machine allows, instead of real time.
        start: Also start the mission and arm.
        no_record: Record neither log nor flight; otherwise the newest 256 MB of each are kept.
        foxglove_at: Serve the same at another address.
        as_json: Print addresses as one line of JSON once the fleet is up.
    """

    speed: Annotated[float | None, typer.Option(metavar="FACTOR")] = None
    lockstep: Annotated[bool, typer.Option("--lockstep")] = False
    start: Annotated[bool, typer.Option("--start")] = False
    restart: common.RestartOption = common.Restart.ON_FAILURE
    no_record: Annotated[bool, typer.Option("--no-record")] = False
    hub_port: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65535,
            help="UDP port that any number of ground stations can connect to; "
            f"{HUB_PORT} by default, or a free one with --free-ports.",
            metavar="PORT",
        ),
    ] = None
    foxglove: Annotated[
        bool,
        typer.Option(
            "--foxglove",
            help=f"Serve states, events, faults and texts to Foxglove, at {FOXGLOVE}; any page "
            "in a browser of this machine can read them.",
        ),
    ] = False
    foxglove_at: Annotated[str | None, typer.Option("--foxglove-at", metavar="HOST:PORT")] = None
    as_json: Annotated[bool, typer.Option("--json")] = False
    insecure: InsecureOption = False

    @property
    def pace(self) -> float | None:
        """Real-time factor; None in lockstep."""
        return None if self.lockstep else 1.0 if self.speed is None else self.speed

    def check(self) -> None:
        """Check that the options go together.

        Raises:
            BadInput: They do not.
        """
        if self.speed is not None and self.lockstep:
            raise BadInput("--speed paces the plant; --lockstep does not", "leave one of them out")


@with_options("options", options_of(UpOptions), UpOptions)
def up(scenario: common.ScenarioArgument, options: UpOptions) -> None:
    """Start a fleet that flies until it is stopped (Ctrl-C).

    The vehicles get the profile or the mission and the faults of the scenario and wait: time
    begins when all are armed. The duration of the scenario is ignored. One ground station can bind
    the GCS port (14550); any number can connect to the hub, as gcs's own commands do. Links that
    other machines can reach must be signed, unless --insecure is given.

    Examples:
        - gcs up paper/scenario1       (then: gcs start; gcs arm; gcs status --watch)
        - gcs up paper/scenario1 --start --speed 2
        - gcs up my.yaml --lockstep --free-ports --json
        - gcs up my.yaml --restart never
        - gcs up paper/scenario1 --foxglove

    Exit status: 0 stopped by Ctrl-C, SIGTERM or SIGHUP, 1 flight lost, 2 bad input, 3 a vehicle
    refused something, 4 a vehicle did not answer.
    """
    options.check()
    from gcs.fleet.ports import on_free_ports
    from gcs.fleet.warm_up import warm_up
    from gcs.results.flight_mark import marked
    from gcs.results.run_folder import make_run_folder

    hub_port = options.hub_port or HUB_PORT
    restart = options.restart is common.Restart.ON_FAILURE
    flight = common.prepared(
        scenario, options, "up", speed=options.pace, restart=restart, hub_port=hub_port
    )
    loaded = flight.scenario
    if not options.insecure:
        refuse_unsigned(loaded)
    foxglove = _foxglove_address(options)
    hub = UdpAddress(loaded.links.host, hub_port)
    folder = make_run_folder(options.out, loaded.name)
    console = console_of(quiet=options.quiet or options.as_json)

    def fly(scenario: Scenario, free_hub: UdpAddress) -> None:
        with _foxglove(scenario, folder, foxglove) as server:
            at = hub if options.hub_port else free_hub
            _up(scenario, folder, at, console, options, server)

    try:
        with marked(folder, loaded, flight.mark):
            common.tell(flight.remarks, console)
            warm_up(loaded, console, standing=True)
            if options.free_ports:
                on_free_ports(loaded, fly)
            else:
                fly(loaded, hub)
        console.print("stopped")
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted before the fleet was up; {folder} can be removed") from None


def _up(
    scenario: Scenario,
    folder: Path,
    hub: UdpAddress,
    console: Console,
    options: UpOptions,
    server: "FoxgloveServer | None",
) -> None:
    """Run a fleet until it is stopped."""
    from gcs.fleet.observer import Observer
    from gcs.fleet.standing import keep_up

    stderr = console_of()

    def notify(text: str) -> None:
        with contextlib.suppress(OSError):  # nobody reads it
            stderr.print(text, soft_wrap=True)

    starting = contextlib.ExitStack()

    def ready() -> list[Observer]:
        starting.close()
        with contextlib.suppress(OSError):
            _announce(scenario, folder, hub, console, options, server)
        if server is None:
            return []
        return [Observer("Foxglove", partial(server.feed, hub), notify)]

    fleet = keep_up(
        scenario,
        folder,
        hub,
        on_ready=ready,
        on_message=notify,
        on_start=lambda text: task.show(0.0, text),
        speed=options.pace,
        start=options.start,
        restart=options.restart is common.Restart.ON_FAILURE,
        record=not options.no_record,
        autopilot_processes=options.processes,
    )
    with starting:
        task = starting.enter_context(working(console)).add(f"starting {scenario.name}")
        asyncio.run(_until_stopped(fleet))


def _foxglove_address(options: UpOptions) -> UdpAddress | None:
    """Return where to serve Foxglove, None for nowhere.

    Raises:
        BadInput: It is no address, its port is in use, or the extra is not installed.
    """
    if not options.foxglove and options.foxglove_at is None:
        return None
    load_package("foxglove", "--foxglove", "foxglove")
    option = "--foxglove-at"
    address = listening_address(option, options.foxglove_at or FOXGLOVE)
    listen(option, address).close()
    return address


@contextlib.contextmanager
def _foxglove(
    scenario: Scenario, folder: Path, address: UdpAddress | None
) -> Iterator["FoxgloveServer | None"]:
    """Serve Foxglove at an address, None for nowhere."""
    if address is None:
        yield None
        return
    from gcs.commands.foxglove import FoxgloveServer

    server = FoxgloveServer(scenario, folder, address)
    try:
        yield server
    finally:
        server.stop()


async def _until_stopped(work: Coroutine[Any, Any, None]) -> None:
    task = asyncio.ensure_future(work)
    loop = asyncio.get_running_loop()
    for number in stop_signals():
        loop.add_signal_handler(number, task.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await task


def _addresses(scenario: Scenario, folder: Path, hub: UdpAddress) -> dict[str, Any]:
    gcs = Connection("in", UdpAddress(scenario.links.host, scenario.links.gcs_port))
    return {
        "scenario": scenario.name,
        "uavs": [uav.id for uav in scenario.uavs],
        "gcs": str(gcs),
        "hub": str(Connection("out", hub)),
        "folder": str(folder),
    }


def _files(folder: Path, record: bool) -> str:
    """Say where the files of a fleet are."""
    from gcs.fleet.standing_record import LIMIT_BYTES, LOG

    processes = f"logs of the processes: {folder / 'processes'}"
    if not record:
        return processes
    size = 2 * LIMIT_BYTES // 1_000_000
    return f"log and recording, at most {size} MB: {folder / LOG}, trajectory.arrows; {processes}"


def _announce(
    scenario: Scenario,
    folder: Path,
    hub: UdpAddress,
    console: Console,
    options: UpOptions,
    server: "FoxgloveServer | None",
) -> None:
    addresses = _addresses(scenario, folder, hub)
    mission = scenario.mission
    flown = (
        f"profile of {counted(len(scenario.profile), 'segment')}"
        if mission is None
        else f"mission of {counted(len(mission.items), 'item')}"
    )
    pace = "lockstep" if options.pace is None else f"{options.pace:g}× real time"
    state = "mission started, armed" if options.start else "not armed"
    connect = "" if hub.port == HUB_PORT else f" --connect {addresses['hub']}"
    then = ["gcs status --watch" + connect, "gcs fault set rudder --effectiveness 0.5" + connect]
    if not options.start:
        then[:0] = ["gcs start" + connect, "gcs arm" + connect]
    lines = [
        f"{scenario.name}: {len(scenario.uavs)} UAVs up ({pace}), {flown}, "
        f"{counted(len(scenario.faults), 'fault')} set, {state}",
        f"  one ground station: {addresses['gcs']}; any number: {addresses['hub']}",
        f"  {_files(folder, not options.no_record)}",
        *(f"  {'then:' if i == 0 else '     '} {text}" for i, text in enumerate(then)),
        "  Ctrl-C stops the fleet",
        *(f"  {line}" for line in (server.lines if server else ())),
    ]
    for line in lines:
        console.print(line, soft_wrap=True)
    if options.as_json:
        served = {} if server is None else {"foxglove": server.url}
        print_json(addresses | served)
