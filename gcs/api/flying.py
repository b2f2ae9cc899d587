"""Flights from Python: one, or many on all cores."""

import contextlib
import itertools
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from gcs.api.flight import Flight, Source, open_run
from gcs.console.errors import BadInput, FlightLost, GcsError, python_errors
from gcs.console.progress import working
from gcs.console.terminal import console_of
from gcs.fleet.event_loops import LOOK_S, raise_if_cancelled
from gcs.fleet.flying import fly as fly_prepared
from gcs.fleet.flying import recorded
from gcs.fleet.in_process import OnProgress, fly_and_summarise, fly_in_steps
from gcs.fleet.local_workers import LocalWorkers
from gcs.fleet.preparation import How, Prepared, prepare
from gcs.fleet.remarks import warn
from gcs.fleet.warm_up import warm_up
from gcs.results.choices import Record
from gcs.results.figures import FlightSummary
from gcs.results.recorder import FlightRecorder
from gcs.results.run_folder import make_run_folder
from gcs.scenario.changes import ScenarioLike
from gcs.scenario.model import Scenario

if TYPE_CHECKING:
    import pyarrow as pa
    from rich.console import Console

Recorded: TypeAlias = Literal["full", "light", "none"]
"""How much of the steps is recorded: all, the main signals at 50 Hz, or nothing."""

Changes: TypeAlias = Mapping[str, Any]
"""Values by key, as in ``{"controller.kind": "surviving", "faults": []}``; mappings are merged."""


def fly(
    scenario: ScenarioLike,
    changes: Changes | None = None,
    *,
    overlays: Sequence[Path | str] = (),
    over_udp: bool = False,
    record: Recorded = "light",
    out: Path | str | None = None,
    speed: float | None = None,
    restart: bool = False,
    free_ports: bool = True,
    autopilot_processes: int | None = None,
    signing_key: Path | str | None = None,
    on_progress: OnProgress | None = None,
) -> Flight:
    """Fly a scenario to its end, or until it is lost, as `gcs fly` does.

    A lost flight is a flight, too: `Flight.loss` says why, and what was recorded is there.
    `Flight.check` raises for it what ends `gcs fly`.

    What should be known of a flight before it begins is a ``UserWarning`` if it is one of the
    warnings of `gcs fly`, as that nothing keeps UAVs apart; all of it is in `Flight.remarks`.

    `fly` can be called from any thread, and while an event loop runs, which then waits;
    ``await asyncio.to_thread(fly, ...)`` lets the loop go on. Ctrl-C ends the flight, in a task of
    `asyncio.run` as well.

    Args:
        scenario: A scenario, a file, or the name of a bundled one.
        changes: Values by key, as of ``--set``: ``"trigger.b2_deg"``, ``"faults[0].uav"``, or
            ``"controller"`` with a mapping that is merged. None removes a key.
        overlays: Files or bundled additions merged into the scenario before, as of ``--with``.
        over_udp: Whether plant and autopilots are processes that talk MAVLink over UDP; else all
            is in this process, with the same events bit for bit, and faster.
        record: How much of the steps is recorded; the figures are always of every step.
        out: Run folder, new or empty, with the files of `gcs fly` but its figures; None to record
            in memory.
        speed: Real-time factor of a flight over UDP; None for lockstep.
        restart: Whether autopilots that fail over UDP are started again; they resume their flight.
        free_ports: Whether a flight over UDP takes free ports; else the scenario's.
        autopilot_processes: Processes that the autopilots share over UDP in lockstep; None for one
            each.
        signing_key: Key file that signs the links of a flight over UDP.
        on_progress: Called with the simulated time [s] and the event counts so far, shape (n, 4).

    Raises:
        BadInput: The scenario, a change or an argument cannot be used; with the text of the
            command line.
        FlightLost: A process over UDP ended before simulated time began, or left no recording.
        CommandRefused: A vehicle refused its profile, a fault, its mission or arming.
        NoAnswer: A vehicle did not appear or did not answer.
        OSError: A file cannot be written; it is named.
        asyncio.CancelledError: The task that called this was cancelled, as by Ctrl-C in
            `asyncio.run`.
    """
    with python_errors():
        how = How(
            over_udp=over_udp,
            speed=speed,
            restart=restart,
            autopilot_processes=autopilot_processes,
            free_ports=free_ports,
            record=_record(record),
        )
        flight = prepare(scenario, how, additions=overlays, values=changes, signing_key=signing_key)
        warn(flight.remarks)
        warm_up(flight.scenario, console_of(), in_process=not over_udp)
        folder = None if out is None else make_run_folder(Path(out), flight.scenario.name)
        summary = None
        try:
            with recorded(flight, folder) as recorder:
                ending = fly_prepared(flight, recorder, folder, on_progress)
                summary = recorder.finish(ending)
                if summary.loss is not None:
                    raise FlightLost(summary.loss)  # as its mark says
        except FlightLost:
            if summary is None:
                raise
        if folder is None:
            return _in_memory(flight, summary, recorder.trajectory, recorder.events)
        flown = open_run(folder)
        flown.remarks = flight.remarks
        return flown


class Job(NamedTuple):
    """A flight of `fly_many`, as a worker gets it: classes of pydantic cannot all be pickled."""

    number: int
    tree: dict[str, Any]
    record: Record


class Done(NamedTuple):
    """What became of it: the figures, and contents of the files of the recording, if there is."""

    summary: FlightSummary
    trajectory: bytes | None
    events: bytes | None


def fly_many(
    flights: Iterable[ScenarioLike | tuple[ScenarioLike, Changes]],
    *,
    overlays: Sequence[Path | str] = (),
    jobs: int | None = None,
    record: Recorded = "none",
    progress: bool = True,
) -> list[Flight]:
    """Fly many scenarios in process, on all cores; return their flights in the same order.

    All are checked before the first one flies. Without a recording, a flight takes about 1.2 times
    the processor time of one without figures. A script needs no ``if __name__ == "__main__":``.

    Args:
        flights: Each a scenario, or a scenario and changes, as of `fly`.
        overlays: As of `fly`, for all of them.
        jobs: Worker processes; None for as many as there are cores.
        record: As of `fly`; without a recording a flight has its `summary` and `figures` only.
        progress: Whether progress is shown on standard error.

    Raises:
        BadInput: A flight cannot be flown; its index is named.
        GcsError: A flight killed its process.
    """
    with python_errors():
        recording = _record(record)
        if jobs is not None and jobs < 1:
            raise BadInput(f"jobs is {jobs}, expected at least 1")
        if isinstance(flights, ScenarioLike):
            got = flights.name if isinstance(flights, Scenario) else str(flights)
            raise BadInput(f"flights: expected a list of scenarios, as in [{got!r}]")
        prepared = [_one_of_many(k, one, overlays) for k, one in enumerate(flights)]
        if not prepared:
            return []
        warn(dict.fromkeys(text for one in prepared for text in one.remarks))
        console = console_of(quiet=not progress)
        warm_up(None, console)
        done = _done(prepared, recording, jobs or os.cpu_count() or 1, console)
    return [_in_memory(one, *done[k]) for k, one in enumerate(prepared)]


def _done(
    flights: Sequence[Prepared], recording: Record, jobs: int, console: "Console"
) -> dict[int, Done]:
    """Fly in worker processes, with progress; return what became of each flight by its number."""
    rest = (Job(k, one.scenario.model_dump(), recording) for k, one in enumerate(flights))
    done: dict[int, Done] = {}
    count = min(jobs, len(flights))
    with (
        contextlib.closing(LocalWorkers[Job, Done](count, _fly_job)) as workers,
        working(console) as work,
    ):
        task = work.add("flying", len(flights), "flights")
        for job in itertools.islice(rest, count):
            workers.submit(job)
        while len(done) < len(flights):
            while not workers.done(LOOK_S):
                raise_if_cancelled()
            job, flown = workers.wait()
            if flown is None:
                raise GcsError(f"flights[{job.number}] killed its process")
            done[job.number] = flown
            task.advance()
            if (following := next(rest, None)) is not None:
                workers.submit(following)
    return done


def _fly_job(job: Job, _worker: str) -> Done:
    """Fly a job; this runs in a worker."""
    scenario = Scenario.model_validate(job.tree)
    if job.record is Record.NONE:
        return Done(fly_and_summarise(scenario), None, None)
    recorder = FlightRecorder(scenario, None, job.record)
    summary = recorder.finish(fly_in_steps(scenario, recorder.add))
    assert recorder.trajectory is not None
    assert recorder.events is not None
    return Done(summary, recorder.trajectory.to_pybytes(), recorder.events.to_pybytes())


def _in_memory(
    flight: Prepared,
    summary: FlightSummary,
    trajectory: "bytes | pa.Buffer | None",
    events: "bytes | pa.Buffer | None",
) -> Flight:
    import pyarrow as pa

    parts = (None if one is None else pa.py_buffer(one) for one in (trajectory, events))
    source = Source(lambda: summary, lambda: flight.scenario, *parts)
    return Flight(source, flight.remarks)


def _one_of_many(
    number: int, one: ScenarioLike | tuple[ScenarioLike, Changes], overlays: Sequence[Path | str]
) -> Prepared:
    """Prepare a flight of many.

    Raises:
        BadInput: It cannot be flown; its index is named.
    """
    scenario, changes = one if isinstance(one, tuple) else (one, None)
    try:
        with python_errors():
            return prepare(scenario, additions=overlays, values=changes)
    except BadInput as problem:
        raise BadInput(f"flights[{number}]: {problem}", problem.hint) from None


def _record(record: Recorded) -> Record:
    known = (Record.FULL, Record.LIGHT, Record.NONE)
    if record not in known:
        names = ", ".join(map(repr, map(str, known)))
        raise BadInput(f"record: expected {names}, got {record!r}", "npz: see gcs export --to npz")
    return Record(record)
