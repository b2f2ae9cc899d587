"""Flights from Python: one, or many on all cores."""

import contextlib
import itertools
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from gcs.api.errors import python_errors
from gcs.api.event_loops import LOOK_S, beside_any_loop, raise_if_cancelled, unless_cancelled
from gcs.api.flight import Flight, Source, open_run
from gcs.commands.common import check_simulators, warm_up
from gcs.commands.progress import working
from gcs.errors import BadInput, GcsError
from gcs.fleet.flight import fly_over_udp
from gcs.fleet.in_process import OnProgress, fly_and_summarise, fly_in_steps
from gcs.fleet.local_workers import LocalWorkers
from gcs.fleet.ports import check_ports, on_free_ports
from gcs.results.choices import Record
from gcs.results.disk_space import check_space
from gcs.results.figures import FlightSummary
from gcs.results.flight_mark import FlightMark, marked
from gcs.results.recorder import FlightRecorder
from gcs.results.recording import Ending
from gcs.results.run_folder import make_run_folder
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario
from gcs.scenario.settings import plain
from gcs.scenario.signing_key import signed
from gcs.terminal import console_of
from mavlink_defs.endpoint import UdpAddress

if TYPE_CHECKING:
    import pyarrow as pa

Recorded: TypeAlias = Literal["full", "light", "none"]
"""How much of the steps is recorded: all, the main signals at 50 Hz, or nothing."""

Changes: TypeAlias = Mapping[str, Any]
"""Values by key, as in ``{"controller.kind": "surviving", "faults": []}``; mappings are merged."""

ScenarioLike: TypeAlias = Scenario | Path | str
"""A scenario, a file, or the name of a bundled one."""


def fly(
    scenario: ScenarioLike,
    changes: Changes | None = None,
    *,
    overlays: Sequence[Path | str] = (),
    over_udp: bool = False,
    record: Recorded = "light",
    out: Path | str | None = None,
    speed: float | None = None,
    free_ports: bool = True,
    autopilot_processes: int | None = None,
    signing_key: Path | str | None = None,
    on_progress: OnProgress | None = None,
) -> Flight:
    """Fly a scenario to its end, or until it is lost, as `gcs fly` does.

    A lost flight is a flight, too: `Flight.loss` says why, and what was recorded is there.
    `Flight.check` raises for it what ends `gcs fly`.

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
        loaded = _scenario(scenario, changes, overlays)
        mark = _mark(scenario, loaded, changes, overlays)
        loaded = signed(loaded, None if signing_key is None else str(signing_key))
        recording = _record(record)
        if over_udp:
            _check_udp(loaded, speed, free_ports, autopilot_processes)
        else:
            _check_in_process(loaded, speed, autopilot_processes)
        check_simulators(loaded)
        warm_up(loaded, console_of())
        if not over_udp:
            on_progress = unless_cancelled(on_progress)
            if out is None and recording is Record.NONE:
                summary = fly_and_summarise(loaded, on_progress)
                return _in_memory(loaded, summary, None, None)
            folder = None if out is None else make_run_folder(Path(out), loaded.name)
            return _fly(
                loaded,
                mark,
                folder,
                recording,
                lambda recorder: fly_in_steps(loaded, recorder.add, on_progress),
            )
        with contextlib.ExitStack() as stack:
            if out is None:
                temporary = stack.enter_context(tempfile.TemporaryDirectory(prefix="ftc-sitl-"))
                files, folder = Path(temporary), None
            else:
                files = folder = make_run_folder(Path(out), loaded.name)

            def over_the_wire(recorder: FlightRecorder) -> Ending:
                def flown(on_ports: Scenario, _hub: UdpAddress | None = None) -> Ending:
                    return beside_any_loop(
                        lambda: fly_over_udp(
                            on_ports,
                            files,
                            recorder.add,
                            speed,
                            on_progress,
                            autopilot_processes=autopilot_processes,
                        )
                    )

                return on_free_ports(loaded, flown) if free_ports else flown(loaded)

            return _fly(loaded, mark, folder, recording, over_the_wire, over_udp=True)


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
        scenarios = [_one_of_many(k, one, overlays) for k, one in enumerate(flights)]
        if not scenarios:
            return []
        console = console_of(quiet=not progress)
        warm_up(scenarios[0], console)
        count = min(jobs or os.cpu_count() or 1, len(scenarios))
        done: dict[int, Done] = {}
        with (
            contextlib.closing(LocalWorkers[Job, Done](count, _fly_job)) as workers,
            working(console) as work,
        ):
            task = work.add("flying", len(scenarios), "flights")
            rest = (Job(k, one.model_dump(), recording) for k, one in enumerate(scenarios))
            for job in itertools.islice(rest, count):
                workers.submit(job)
            while len(done) < len(scenarios):
                while not workers.done(LOOK_S):
                    raise_if_cancelled()
                job, flown = workers.wait()
                if flown is None:
                    raise GcsError(f"flights[{job.number}] killed its process")
                done[job.number] = flown
                task.advance()
                if (following := next(rest, None)) is not None:
                    workers.submit(following)
    return [_in_memory(one, *done[k]) for k, one in enumerate(scenarios)]


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
    scenario: Scenario,
    summary: FlightSummary,
    trajectory: "bytes | pa.Buffer | None",
    events: "bytes | pa.Buffer | None",
) -> Flight:
    import pyarrow as pa

    recorded = (None if one is None else pa.py_buffer(one) for one in (trajectory, events))
    return Flight(Source(lambda: summary, lambda: scenario, *recorded))


def _one_of_many(
    number: int,
    one: ScenarioLike | tuple[ScenarioLike, Changes],
    overlays: Sequence[Path | str],
) -> Scenario:
    """Return the scenario of a flight of many, checked.

    Raises:
        BadInput: It cannot be flown; its index is named.
    """
    scenario, changes = one if isinstance(one, tuple) else (one, None)
    try:
        with python_errors():
            loaded = _scenario(scenario, changes, overlays)
            _check_in_process(loaded, None, None)
            check_simulators(loaded)
            return loaded
    except BadInput as problem:
        raise BadInput(f"flights[{number}]: {problem}", problem.hint) from None


def _scenario(
    scenario: ScenarioLike, changes: Changes | None, overlays: Sequence[Path | str]
) -> Scenario:
    if not isinstance(scenario, Scenario | Path | str):
        kind = type(scenario).__name__
        raise BadInput(f"scenario: expected a name, a path or a Scenario, got {kind}")
    if isinstance(overlays, str | Path):
        raise BadInput(f"overlays: expected a list, as in [{str(overlays)!r}]")
    if changes is not None and not isinstance(changes, Mapping):
        kind = type(changes).__name__
        raise BadInput(
            f"changes: expected a mapping, got {kind}", "as in {'controller.kind': 'surviving'}"
        )
    for key, value in (changes or {}).items():
        if callable(value):
            name = getattr(value, "__name__", type(value).__name__)
            raise BadInput(
                f"changes: {key} is {name}, an object of Python; expected plain data",
                f"name its file and class in a text: 'FILE.py:{name}'",
            )
    try:
        return with_changes(scenario, overlays, plain(changes or {}), "changes")
    except TypeError as problem:
        raise BadInput(f"changes: expected plain data: {problem}") from None


def _record(record: Recorded) -> Record:
    known = (Record.FULL, Record.LIGHT, Record.NONE)
    if record not in known:
        names = ", ".join(map(repr, map(str, known)))
        raise BadInput(f"record: expected {names}, got {record!r}", "npz: see gcs export --to npz")
    return Record(record)


def _check_udp(
    scenario: Scenario, speed: float | None, free_ports: bool, processes: int | None
) -> None:
    if speed is not None and not 0.0 < speed < float("inf"):
        raise BadInput(f"speed is {speed:g}, expected a factor above 0", "1 is real time")
    if processes is not None and (speed is not None or processes < 1):
        raise BadInput(
            f"autopilot_processes is {processes}: expected at least 1, and no speed: autopilots "
            "share processes only in lockstep"
        )
    if not free_ports:
        check_ports(scenario)


def _check_in_process(scenario: Scenario, speed: float | None, processes: int | None) -> None:
    for name, value in (("speed", speed), ("autopilot_processes", processes)):
        if value is not None:
            raise BadInput(f"{name} is of processes; a flight in process has none", "over_udp=True")
    if scenario.links.impairments is not None:
        text = "links.impairments apply to the wire; a flight in process has none"
        raise BadInput(text, "over_udp=True, or leave them out")


def _mark(
    named: ScenarioLike, loaded: Scenario, changes: Changes | None, overlays: Sequence[Path | str]
) -> FlightMark:
    """Return the mark of a run folder of `fly`, by which `gcs runs` lists it."""
    name = named.name if isinstance(named, Scenario) else str(named)
    additions = [str(one) for one in overlays]
    return FlightMark.of("fly", name, loaded, additions, plain(changes or {}))


def _fly(
    scenario: Scenario,
    mark: FlightMark,
    folder: Path | None,
    record: Record,
    flown: Callable[[FlightRecorder], Ending],
    *,
    over_udp: bool = False,
) -> Flight:
    """Fly, and record to a folder or in memory."""
    with contextlib.ExitStack() as stack:
        if folder is not None:
            check_space(folder, scenario, record, over_udp=over_udp)
            stack.enter_context(marked(folder, scenario, mark))
        recorder = stack.enter_context(contextlib.closing(FlightRecorder(scenario, folder, record)))
        recorder.load_code()
        summary = recorder.finish(flown(recorder))
    if folder is None:
        return _in_memory(scenario, summary, recorder.trajectory, recorder.events)
    return open_run(folder)
