"""Flying the rows of a campaign on workers: batches, lost workers, what is stored when."""

import functools
import itertools
import math
import pickle
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gcs.errors import BadInput, GcsError
from gcs.lab.campaigns.cluster import capacity
from gcs.lab.campaigns.flights import Flights, Row, ended, fly_rows
from gcs.lab.campaigns.store import append_results, read_results
from gcs.scenario.code import code_digest, code_version

if TYPE_CHECKING:
    import pyarrow as pa
    from distributed import Client, Future

KILLS = 3
"""Processes that a flight may kill before it is recorded as such."""
_BATCH_S = 2.0  # the time that a batch is meant to take; handing one over takes milliseconds
_LARGEST_BATCH = 1000
_STORE_S = 2.0  # rows are stored at least this often,
_STORE_SHARE = 0.01  # or, in long campaigns, when this share of the time has passed since
_CAPACITY_S = 5.0  # how often workers are counted


class Flown(NamedTuple):
    """A batch that was flown.

    Attributes:
        worker: Address of the worker.
        rows: Rows of the results.
        wall_s: Time that they took [s].
        cpu_s: Processor time that they took [s]; on a busy machine less than `wall_s`.
    """

    worker: str
    rows: "pa.Table"
    wall_s: float
    cpu_s: float


class WrongCode(BadInput):
    """A worker runs other code than we do."""


def missing_rows(folder: Path, planned: int) -> np.ndarray:
    """Return the numbers of planned rows that have no results, in order."""
    stored = read_results(folder, ["row"]).column("row").to_numpy()
    missing = np.ones(planned, bool)
    missing[stored] = False
    return np.flatnonzero(missing)


def fly(
    client: "Client",
    flights: Flights,
    rows: Iterable[Row],
    count: int,
    folder: Path,
    on_flown: Callable[[Flown], None],
    enough: Callable[[], bool] = lambda: False,
) -> None:
    """Fly rows and store their results; what is flown is stored however this ends.

    A worker that dies takes its batch along: the flights of that batch fly again at the end, one
    at a time and nothing else meanwhile, so that no flight answers for another. One that kills
    `KILLS` processes is stored with the outcome ``crashed``.

    Args:
        client: Client of a cluster whose workers `prepare` has checked.
        flights: From rows to flights.
        rows: Rows to fly.
        count: How many they are.
        folder: Folder of the campaign.
        on_flown: Called with each batch that ended.
        enough: Asked whenever results were stored; True ends the campaign early.

    Raises:
        GcsError: The scheduler was lost, or results cannot be written.
        BadInput: A worker that joined runs other code.
    """
    packed = _packed(flights)
    with _Storing(folder, enough) as store:
        queue = _Queue(iter(rows), count)
        suspects: list[Row] = []
        kills: Counter[int] = Counter()
        for batch, flown in _in_parallel(client, packed, queue):
            if flown is None:
                suspects += batch
                kills.update(row["row"] for row in batch)
                continue
            queue.took(flown)
            on_flown(flown)
            if store.add(flown.rows):
                return
        for row in suspects:
            flown = _alone(client, flights, packed, row, kills)
            on_flown(flown)
            if store.add(flown.rows):
                return


def _in_parallel(
    client: "Client", flights: bytes, queue: "_Queue"
) -> Iterator[tuple[list[Row], Flown | None]]:
    """Yield each batch with what became of it; None if it lost its worker."""
    from distributed import as_completed

    running: dict[Future, list[Row]] = {}
    finished = as_completed(loop=client.loop)  # it would look for a default client
    counted_at, workers = -math.inf, 1
    try:
        while True:
            if time.monotonic() - counted_at > _CAPACITY_S:
                counted_at, workers = time.monotonic(), max(_connected(client), 1)
            while len(running) < workers and (batch := queue.next_batch(workers)):
                future = _submit(client, flights, batch)
                running[future] = batch
                finished.add(future)
            if not running:
                return
            future = next(finished)
            yield running.pop(future), _result(future)
    finally:
        client.cancel(list(running), force=True)


def _alone(
    client: "Client", flights: Flights, packed: bytes, row: Row, kills: Counter[int]
) -> Flown:
    """Fly one row while nothing else flies, until it is flown or has killed enough processes."""
    import pyarrow as pa

    while kills[row["row"]] < KILLS:
        future = _submit(client, packed, [row])
        try:
            flown = _result(future)
        finally:
            client.cancel([future], force=True)
        if flown is not None:
            return flown
        kills[row["row"]] += 1
    reason = f"its process was killed {KILLS} times"
    crashed = pa.Table.from_pylist([ended(row, "crashed", reason)], flights.schema)
    return Flown("", crashed, 0.0, 0.0)


def _submit(client: "Client", flights: bytes, batch: list[Row]) -> "Future":
    return client.submit(_fly_batch, flights, _packed(batch), code_digest(), pure=False)


def _packed(value: object) -> bytes:
    """Return a value as bytes: the scheduler, which keeps tasks for a while, need not know it."""
    return zlib.compress(pickle.dumps(value))


@functools.lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Flights:
    flights: Flights = pickle.loads(zlib.decompress(packed))
    return flights


def _result(future: "Future") -> Flown | None:
    """Return the result of a batch; None if its worker died.

    Raises:
        GcsError: The scheduler was lost.
    """
    from distributed import KilledWorker
    from distributed.client import FutureCancelledError

    try:
        flown: Flown = future.result()
    except KilledWorker:
        return None
    except (FutureCancelledError, OSError) as problem:
        raise _scheduler_lost() from problem
    return flown


def _connected(client: "Client") -> int:
    try:
        return capacity(client)
    except (OSError, ValueError, RuntimeError) as problem:
        raise _scheduler_lost() from problem


def _scheduler_lost() -> GcsError:
    return GcsError(
        "the connection to the scheduler was lost; the flights so far are stored",
        "the same command continues, with or without --scheduler",
    )


def _fly_batch(flights: bytes, batch: bytes, digest: str) -> Flown:
    """Fly a batch; this runs on a worker."""
    from distributed import get_worker

    worker = get_worker().address
    if code_digest() != digest:
        raise WrongCode(
            f"worker {worker} runs ftc-sitl {code_version()} with digest {code_digest()}, "
            f"expected digest {digest}",
            "install the same version on every host, and restart the workers",
        )
    begin, cpu_begin = time.perf_counter(), time.process_time()
    rows = fly_rows(_unpacked(flights), pickle.loads(zlib.decompress(batch)))
    wall_s, cpu_s = time.perf_counter() - begin, time.process_time() - cpu_begin
    return Flown(worker, rows, wall_s, cpu_s)


@dataclass
class _Queue:
    """Rows that wait, dealt in batches of about `_BATCH_S`."""

    rows: Iterator[Row]
    waiting: int
    flight_s: float | None = field(default=None, init=False)

    def took(self, flown: Flown) -> None:
        """Note how long flights take."""
        latest = flown.wall_s / max(flown.rows.num_rows, 1)
        before = latest if self.flight_s is None else self.flight_s
        self.flight_s = 0.7 * before + 0.3 * latest

    def next_batch(self, workers: int) -> list[Row]:
        """Return the next batch; smaller ones at the end, which all workers reach together."""
        size = 1
        if self.flight_s is not None:
            fitting = _BATCH_S / max(self.flight_s, 1e-6)
            size = int(min(fitting, _LARGEST_BATCH, math.ceil(self.waiting / (2 * workers))))
        batch = list(itertools.islice(self.rows, max(size, 1)))
        self.waiting -= len(batch)
        return batch


class _Storing:
    """Collects rows and stores them every few seconds, and at the end whatever happens."""

    def __init__(self, folder: Path, enough: Callable[[], bool]) -> None:
        self._folder, self._enough = folder, enough
        self._tables: list[pa.Table] = []
        self._begin = self._stored_at = time.monotonic()

    def __enter__(self) -> "_Storing":
        return self

    def __exit__(self, *_: object) -> None:
        self._store()

    def add(self, rows: "pa.Table") -> bool:
        """Add rows; return whether there are enough now."""
        self._tables.append(rows)
        now = time.monotonic()
        if now - self._stored_at < max(_STORE_S, _STORE_SHARE * (now - self._begin)):
            return False
        self._store()
        return self._enough()

    def _store(self) -> None:
        import pyarrow as pa

        if not self._tables:
            return
        rows, self._tables = pa.concat_tables(self._tables), []
        append_results(self._folder, rows)
        self._stored_at = time.monotonic()
