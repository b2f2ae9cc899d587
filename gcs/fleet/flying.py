"""A prepared flight, flown to its end, and its recording."""

import contextlib
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from gcs.fleet.event_loops import beside_any_loop, unless_cancelled
from gcs.fleet.flight import fly_over_udp
from gcs.fleet.foreign import check_foreign
from gcs.fleet.in_process import OnProgress, fly_and_summarise, fly_in_steps
from gcs.fleet.ports import on_free_ports
from gcs.fleet.preparation import Prepared, begun
from gcs.results.figures import FlightSummary
from gcs.results.recorder import FlightRecorder
from gcs.results.recording import Ending
from gcs.results.summary import summary_of
from gcs.results.tally import Tally
from gcs.scenario.model import Scenario
from mavlink_defs.endpoint import UdpAddress


@contextlib.contextmanager
def recorded(prepared: Prepared, folder: Path | None) -> Iterator[FlightRecorder]:
    """Record a flight while the context lasts, to its marked run folder.

    Args:
        prepared: The flight.
        folder: New; None to record in memory.

    Raises:
        BadInput: The flight does not fit on the disk.
        OSError: A file cannot be written; it is named.
    """
    with (
        contextlib.nullcontext() if folder is None else begun(prepared, folder),
        contextlib.closing(
            FlightRecorder(prepared.scenario, folder, prepared.how.record)
        ) as recorder,
    ):
        yield recorder


def fly(
    prepared: Prepared,
    recorder: FlightRecorder,
    folder: Path | None,
    on_progress: OnProgress | None = None,
    on_start: Callable[[str], None] = lambda _: None,
) -> Ending:
    """Fly to the end of the scenario, or until the flight is lost; a running event loop waits.

    Args:
        prepared: The flight.
        recorder: Gets its steps.
        folder: Gets what processes write; None to keep none of it.
        on_progress: Called with the simulated time [s] and the event counts so far, shape (n, 4).
        on_start: Called with how far the start of processes is.

    Raises:
        BadInput, FlightLost, CommandRefused, NoAnswer, OSError: As of `fly_over_udp`.
        asyncio.CancelledError: The task that called this was cancelled.
    """
    scenario, how = prepared.scenario, prepared.how
    if not how.over_udp:
        recorder.load_code()
        return fly_in_steps(scenario, recorder.add, unless_cancelled(on_progress))
    threading.Thread(target=_load_ahead, args=(recorder,), daemon=True).start()
    with contextlib.ExitStack() as stack:
        if folder is None:
            temporary = stack.enter_context(tempfile.TemporaryDirectory(prefix="ftc-sitl-"))
            folder = Path(temporary)

        def flown(on_ports: Scenario, _hub: UdpAddress | None = None) -> Ending:
            return beside_any_loop(
                lambda: fly_over_udp(
                    on_ports,
                    folder,
                    recorder.add,
                    how.speed,
                    on_progress,
                    on_start=on_start,
                    restart=how.restart,
                    autopilot_processes=how.autopilot_processes,
                )
            )

        return on_free_ports(scenario, flown) if how.free_ports else flown(scenario)


def figures_of_flight(scenario: Scenario) -> FlightSummary:
    """Fly a scenario and return its figures: in process, or with processes if one is a program.

    Raises:
        BadInput: It cannot be flown so.
        FlightLost, CommandRefused, NoAnswer, OSError: As of `fly_over_udp`, if processes fly it.
    """
    if not scenario.foreign:
        return fly_and_summarise(scenario)
    check_foreign(scenario, over_udp=True)
    tally = Tally(scenario)
    with tempfile.TemporaryDirectory(prefix="ftc-sitl-") as folder:

        def flown(on_ports: Scenario, _hub: UdpAddress) -> Ending:
            return beside_any_loop(lambda: fly_over_udp(on_ports, Path(folder), tally.add))

        return summary_of(tally, on_free_ports(scenario, flown), scenario)


def _load_ahead(recorder: FlightRecorder) -> None:
    """Load the recorder's code while the fleet starts; a failure is reported when it is needed."""
    with contextlib.suppress(Exception):
        recorder.load_code()
