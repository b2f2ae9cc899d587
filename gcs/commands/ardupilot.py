"""``gcs ardupilot``: an ArduPilot SITL flies a scenario's aircraft, in place of our autopilots."""

import contextlib
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from gcs.commands import common
from gcs.commands.station import systems_in
from gcs.console.errors import FlightLost, Interrupted, NoAnswer
from gcs.console.lines import print_json
from gcs.console.progress import working
from gcs.console.terminal import console_of
from gcs.results.choices import Record
from gcs.scenario.settings import values_of
from mavlink_defs.endpoint import UdpAddress
from sitl_plant.ardupilot.protocol import PORT, PORTS_APART

if TYPE_CHECKING:
    from gcs.fleet.ardupilot.recorded import ArduPilotFlown


def ardupilot(
    scenario: common.ScenarioArgument,
    additions: common.WithOption = None,
    settings: common.SetOption = None,
    port: Annotated[
        int,
        typer.Option(
            min=1,
            max=65535,
            help=f"UDP port of the first UAV; each further one has a port {PORTS_APART} higher, as "
            "the instances of ArduPilot do.",
            metavar="PORT",
        ),
    ] = PORT,
    patience: Annotated[float, typer.Option(min=0.1, metavar="S")] = 60.0,
    faults_port: Annotated[int | None, typer.Option(min=1, max=65535, metavar="PORT")] = None,
    uav: Annotated[str | None, typer.Option(metavar="IDS")] = None,
    out: common.RunFolderOption = None,
    record: Record = Record.LIGHT,
    no_figures: Annotated[bool, typer.Option("--no-figures", envvar="FTC_SITL_NO_FIGURES")] = False,
    quiet: common.QuietOption = False,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """Let ArduPilot SITLs fly a scenario's aircraft.

    It has the scenario's faults, servos, wind and sensors.

    The plant answers as the physics of ArduPilot's JSON interface (--model JSON): one UDP port for
    each UAV. The scenario's law, trigger and profile, or mission, are not flown: ArduPilot decides.
    The aircraft are held until ArduPilot commands thrust, and launched to their initial state;
    then the time of the scenario, and of its faults, begins. Changes of the outputs are counted as
    the events of our autopilots are.

    Args:
        patience: Silence of an ArduPilot after which the flight ends [s].
        faults_port: UDP port where gcs fault sets, clears and lists faults in flight, with
            --connect udpout:HOST:PORT. Without it, only the scenario's faults act.
        uav: Fly these UAVs only, such as 1,3; all of the scenario by default.
        record: What is recorded of the steps, as of gcs fly.
        no_figures: Draw no figures.
        as_json: Print summary.json on standard output instead.

    Examples:
        - gcs ardupilot paper/scenario1 --uav 1    (then: arduplane --model JSON:127.0.0.1 -I 0)
        - gcs ardupilot my.yaml --set duration_s=600 --set ardupilot.throttle.min_us=1100
        - gcs ardupilot my.yaml --set step_us=2500 --json
        - gcs ardupilot my.yaml --faults-port 14570    (then: gcs fault set rudder --stuck-deg 5
          --connect udpout:127.0.0.1:14570)

    Exit status: 0 flown to its end, 1 lost, not recorded, or an ArduPilot fell silent, 2 bad input,
    4 no ArduPilot came, 130 Ctrl-C (143 SIGTERM, 129 SIGHUP).
    """
    from gcs.fleet.ardupilot.recorded import ArduPilotFlown, prepare_ardupilot
    from gcs.fleet.ardupilot.sockets import bound, how_to_start
    from gcs.fleet.preparation import begun
    from gcs.fleet.warm_up import warm_up
    from gcs.results.run_folder import make_run_folder

    flight = prepare_ardupilot(
        scenario,
        None if uav is None else systems_in(uav),
        port,
        additions=additions or (),
        values=values_of(settings or ()),
        record=record,
    )
    loaded, host = flight.scenario, flight.scenario.links.host
    addresses = [UdpAddress(host, port + PORTS_APART * k) for k in range(len(loaded.uavs))]
    console = console_of(quiet=quiet)
    stations = [] if faults_port is None else [UdpAddress(host, faults_port)]
    with (
        bound(addresses) as sockets,
        bound(stations, "choose another with --faults-port") as station,
    ):
        is_new = out is None or not out.exists()
        folder = make_run_folder(out, loaded.name)
        try:
            common.tell(flight.remarks, console)
            warm_up(None, console)
            notify = partial(console.print, soft_wrap=True)
            with (
                begun(flight, folder),
                contextlib.closing(ArduPilotFlown(flight, folder, addresses, notify)) as flown,
            ):
                notify(
                    "waiting for ArduPilot, which flies in place of the scenario's law "
                    f"({loaded.controller.kind}) and its profile or mission; start"
                )
                common.tell(how_to_start(loaded, addresses), console)
                with working(console) as work:
                    task = work.add(loaded.name, loaded.duration_s, "s", rated=False)
                    flown.fly(
                        sockets,
                        patience,
                        next(iter(station), None),
                        lambda time_s, events: task.show(time_s, f"{events} events"),
                    )
                _report(flown, console, no_figures=no_figures, as_json=as_json)
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


def _report(flown: "ArduPilotFlown", console: Console, *, no_figures: bool, as_json: bool) -> None:
    from gcs.reports.ardupilot import ardupilot_tables

    served = flown.served
    summary, ending = flown.finish()
    output = console_of(stderr=as_json, quiet=console.quiet)
    if as_json:
        print_json(summary.to_json(), indent=2)
    else:
        output.print(*ardupilot_tables(summary, flown.scenario), sep="\n")
    output.print(f"results in {flown.folder}", soft_wrap=True)
    if ending.steps and not no_figures:
        from gcs.reports.figures.overview import draw_flight

        with working(console, "drawing the flight"):
            preview = flown.recorder.preview
            draw_flight(preview.recording(ending), flown.scenario, preview.gaps(), flown.folder)
    if flown.stopped:
        raise Interrupted(f"interrupted at {summary.flight.duration_s:g} s")
    if served.silence is not None:
        raise FlightLost(
            served.silence, "a longer --patience waits longer, for one that is started again, say"
        )
    if summary.flight.loss is not None:
        raise FlightLost(summary.flight.loss)
