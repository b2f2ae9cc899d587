"""``gcs wire``: count traffic and impair links."""

import contextlib
import io
import json
import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Group
from rich.live import Live

from gcs.commands.options import JsonOption, options_of, with_options
from gcs.console.errors import BadInput, GcsError
from gcs.console.lines import print_json, print_line
from gcs.console.outputs import write_file
from gcs.console.progress import working
from gcs.console.terminal import console_of
from gcs.reports.wire import wire_tables, write_csv
from mavlink_defs import dialect
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.capture.pcap import PcapCutOff, PcapError, is_pcap, read_pcap
from mavlink_defs.capture.relay import Relay, Route
from mavlink_defs.capture.tap import DEFAULT_PORTS, LinkNames, Tap
from mavlink_defs.capture.tap_report import TapReport
from mavlink_defs.capture.tlog import TlogCutOff, TlogError, read_frames
from mavlink_defs.config.files import parse, validate
from mavlink_defs.config.problems import counted
from mavlink_defs.config.user_files import open_file
from mavlink_defs.constants import LAST_SYSTEM
from mavlink_defs.endpoint import EndpointError, is_loopback, parse_address
from mavlink_defs.framing.signing import counts_text
from mavlink_defs.ports import FORMATION_BASE_PORT, GCS_PORT, PLANT_PORT
from mavlink_defs.runtime.shutdown import on_stop
from mavlink_defs.visible import visible

_REFRESH_S = 0.5


@dataclass(frozen=True)
class WireOptions:
    """Options of ``gcs wire``.

    Attributes:
        relay: Listen at an address and relay to another and back; may be repeated.
        impair: Impairments of the relays: keys of a scenario's links.impairments.
        period_us: Control period [µs], for captures without FTC_SIM_STATE, which carries it.
        seconds: Stop relaying after this time [s].
        csv: Also write the counts as CSV.
    """

    relay: Annotated[list[str] | None, typer.Option(metavar="LISTEN=TARGET")] = None
    impair: Annotated[str | None, typer.Option(metavar="KEY=VALUE,...")] = None
    link: Annotated[
        list[str] | None,
        typer.Option(
            help="Name the link whose fixed end has this UDP port; may be repeated. "
            f"Without it: gcs {GCS_PORT}, plant {PLANT_PORT}, formation "
            f"{FORMATION_BASE_PORT + 1}-{FORMATION_BASE_PORT + LAST_SYSTEM}.",
            metavar="NAME=PORT",
        ),
    ] = None
    period_us: Annotated[int | None, typer.Option(min=1, metavar="US")] = None
    seconds: Annotated[float | None, typer.Option(min=0.0, metavar="S")] = None
    csv: Annotated[Path | None, typer.Option(metavar="FILE")] = None
    as_json: JsonOption = False


@with_options("options", options_of(WireOptions), WireOptions)
def wire(
    file: Annotated[Path | None, typer.Argument(metavar="FILE")] = None, *, options: WireOptions
) -> None:
    """Count frames and bytes of a capture or a relay.

    Counts are per link, sender, message and actuator channel.

    Reads a file, or relays UDP datagrams and shows the counts live; a relay can also lose, delay,
    duplicate, reorder and damage datagrams. Actuator channels are compared with periodic sending.

    Args:
        file: Capture (pcap, pcapng), telemetry log (tlog) or wire.json.

    Examples:
        - gcs wire runs/first/flight.tlog
        - gcs wire capture.pcap --link plant=24560 --csv counts.csv
        - gcs wire runs/first/wire.json (of a flight with `links.impairments`)
        - gcs wire --relay 127.0.0.1:14570=127.0.0.1:14560 --impair loss=0.1,delay_ms=20,seed=3
        - gcs wire --relay ... --impair 'bursts={begin=0.01,end=0.2},outages=[{from_s=3,to_s=5}]'

    For the first relay above, fly a scenario whose `links.plant_relay` is 127.0.0.1:14570.

    A relay runs until Ctrl-C or --seconds, then prints its counts.

    Exit status: 0 counted, 1 no MAVLink 2 frame in the file, 2 bad input.
    """
    if (file is None) == (not options.relay):
        raise BadInput("expected either a FILE or --relay LISTEN=TARGET", "see `gcs wire --help`")
    if options.impair is not None and not options.relay:
        raise BadInput("--impair is for relays; a file cannot be impaired")
    ports = {**DEFAULT_PORTS, **dict(map(_named_port, options.link or []))}
    tap = Tap(period_us=options.period_us)
    if file is not None:
        report, remark = _count_file(file, tap, LinkNames(ports))
        if remark:
            print_line(f"warning: {remark}", stderr=True)
    else:
        impairment = None if options.impair is None else _impairment(options.impair)
        routes = [_route(text, ports, impairment) for text in options.relay or []]
        report = _relay(routes, tap, options.seconds, options.as_json)
    if options.csv is not None:
        _save_csv(report, options.csv)
    if options.as_json:
        print_json(report.to_json(), indent=2)
    else:
        console_of(stderr=False).print(*wire_tables(report), sep="\n")
    if file is not None and not report.messages:
        raise GcsError(f"{file}: no MAVLink 2 frame of the dialect")


def _count_file(path: Path, tap: Tap, names: LinkNames) -> tuple[TapReport, str]:
    """Count the traffic in a file; its first bytes show its format.

    Args:
        path: A pcap, pcapng or tlog file, or the wire.json of a flight.
        tap: Tap that counts, with no counts yet.
        names: Names of the links of a capture. A telemetry log's link is "gcs".

    Returns:
        The report, and a remark for the user or "".

    Raises:
        BadInput: The file cannot be read, or is something else.
    """
    skipped: Counter[str] = Counter()
    try:
        if report := _saved_report(path):
            return report, ""
        if is_pcap(path):
            for packet in read_pcap(path, skipped):
                link, direction = names.of(packet.source, packet.destination)
                tap.count(packet.time_s, link, direction, packet.payload)
        else:
            for time_us, frame in read_frames(path, complain=True):
                tap.count(time_us / 1e6, "gcs", _direction(frame), frame)
    except (PcapCutOff, TlogCutOff) as problem:
        return tap.report(), "; ".join(
            [f"{problem}; what comes before is counted", *_skipped_text(skipped)]
        )
    except OSError as problem:
        raise BadInput(f"{path} cannot be read: {problem.strerror}") from problem
    except PcapError as problem:
        raise BadInput(str(problem)) from problem
    except TlogError as problem:
        text = f"{path} is no capture (pcap, pcapng), telemetry log (tlog) or wire.json"
        raise BadInput(text, str(problem)) from problem
    return tap.report(), "".join(f"{path}: {text}" for text in _skipped_text(skipped))


def _skipped_text(skipped: Counter[str]) -> list[str]:
    """Return a text of the packets that hold no UDP datagram, if there are any."""
    if not skipped:
        return []
    packets = counted(skipped.total(), "packet")
    return [f"{packets} skipped that hold no UDP datagram over IPv4: {counts_text(skipped)}"]


def _saved_report(path: Path) -> TapReport | None:
    """Return the report in a wire.json; None if the file is something else."""
    with open_file(path) as file:
        if file.read(1) != b"{":
            return None
    try:
        return TapReport.from_json(json.loads(path.read_bytes()))
    except ValueError:
        return None


def _direction(frame: bytes) -> str:
    """Return the direction of a logged frame, seen from the ground station."""
    version_2 = frame[0] == dialect.PROTOCOL_MARKER_V2
    system, component = frame[5:7] if version_2 else frame[3:5]
    ground = system > LAST_SYSTEM or component == dialect.MAV_COMP_ID_MISSIONPLANNER
    return "from" if ground else "to"


def _relay(routes: list[Route], tap: Tap, seconds: float | None, as_json: bool) -> TapReport:
    console = console_of()
    for route in routes:
        console.print(f"{route.link}: relaying {route.listen} to {route.target}", soft_wrap=True)
    try:
        with Relay(routes, tap) as relay:
            with _display(relay, live=console.is_terminal and not as_json) as show:
                _watch(show, seconds)
            return relay.report()
    except EndpointError as problem:
        raise BadInput(str(problem)) from problem


@contextlib.contextmanager
def _display(relay: Relay, live: bool) -> Iterator[Callable[[], None]]:
    """Give a function that shows the counts: live tables, or how many datagrams there were."""
    if live:
        with Live(console=console_of(), auto_refresh=False, transient=True) as shown:
            yield lambda: shown.update(Group(*wire_tables(relay.report(), live=True)), refresh=True)
        return
    with working(console_of()) as work:
        task = work.add("relaying", unit="datagrams")
        yield lambda: task.show(sum(link.datagrams for link in relay.report().links))


def _watch(show: Callable[[], None], seconds: float | None) -> None:
    """Show the counts until a signal or the end of `seconds`."""
    stop = threading.Event()
    on_stop(stop.set)
    end = math.inf if seconds is None else time.monotonic() + seconds
    while (left_s := end - time.monotonic()) > 0.0 and not stop.is_set():
        stop.wait(min(_REFRESH_S, left_s))
        show()


def _named_port(text: str) -> tuple[int, str]:
    name, _, port = text.partition("=")
    if not (name and port.isdecimal() and 1 <= int(port) <= 65535):
        raise BadInput(f"--link is '{text}', expected NAME=PORT with a port 1-65535")
    return int(port), visible(name)


def _route(text: str, names: dict[int, str], impairment: Impairment | None) -> Route:
    listen, _, target = text.partition("=")
    try:
        ends = parse_address(listen), parse_address(target)
        if not is_loopback(ends[0]):
            print_line(f"warning: {ends[0]} can be reached from other machines", stderr=True)
    except EndpointError as problem:
        raise BadInput(f"--relay is '{text}', expected LISTEN=TARGET: {problem}") from problem
    return Route(names.get(ends[1].port, str(ends[1])), *ends, impairment)


def _impairment(text: str) -> Impairment:
    """Read "loss=0.1,bursts={begin=0.01,end=0.2}": YAML's flow style, with = for a colon."""
    return validate("--impair", parse("--impair", f"{{{text.replace('=', ': ')}}}"), Impairment)


def _save_csv(report: TapReport, path: Path) -> None:
    text = io.StringIO(newline="")
    write_csv(report, text)
    write_file(path, text.getvalue(), "--csv")
