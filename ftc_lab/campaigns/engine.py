"""Flying the rows of a campaign: batches, killed workers, what is stored when."""

import contextlib
import itertools
import math
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ftc_lab.campaigns.flights import Flights, Row, ended
from ftc_lab.campaigns.plan import Plan, rows_of
from ftc_lab.campaigns.store import alone_in, append_results, read_results
from ftc_lab.campaigns.workers import Batch, Flown, Workers, cluster, compile_core, local_workers

if TYPE_CHECKING:
    import pyarrow as pa

KILLS = 3
"""Processes that a flight may kill before it is recorded as such."""
_BATCH_S = 2.0  # the time that a batch is meant to take; handing one over takes milliseconds
_MAX_BATCH = 1000
_STORE_S = 2.0  # rows are stored at least this often,
_STORE_SHARE = 0.01  # or, in long campaigns, when this share of the time has passed since
_CAPACITY_S = 5.0  # how often workers are counted


def missing_rows(folder: Path, planned: int) -> np.ndarray:
    """Return the numbers of planned rows that have no results, in order."""
    stored = read_results(folder, ["row"]).column("row").to_numpy()
    missing = np.ones(planned, bool)
    missing[stored] = False
    return np.flatnonzero(missing)


def fly_missing(
    planned: Plan,
    folder: Path,
    scheduler: str | None,
    jobs: int | None,
    on_flown: Callable[[Flown], None],
    enough: Callable[[], bool] = lambda: False,
) -> None:
    """Fly the rows that an open folder lacks; arguments and errors as of `ftc_lab.run`."""
    with alone_in(folder), contextlib.ExitStack() as stack:
        missing = missing_rows(folder, planned.draws.num_rows)
        if not len(missing):
            return
        workers: Workers
        if scheduler is None:
            if planned.example is not None:
                compile_core()
            count = min(jobs or os.cpu_count() or 1, len(missing))
            local = local_workers(count, planned.flights)
            workers = stack.enter_context(contextlib.closing(local))
        else:
            remote = stack.enter_context(cluster(scheduler, planned.flights))
            remote.prepare(planned.example)
            workers = remote
        rows = rows_of(planned.draws.take(missing))
        fly(workers, planned.flights, rows, len(missing), folder, on_flown, enough)


def fly(
    workers: Workers,
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
        workers: What flies them.
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
    with _Storing(folder, enough) as store:
        queue = _Queue(iter(rows), count)
        suspects: list[Row] = []
        kills: Counter[int] = Counter()
        for batch, flown in _in_parallel(workers, queue):
            if flown is None:
                suspects += batch
                kills.update(row["row"] for row in batch)
                continue
            queue.took(flown)
            on_flown(flown)
            if store.add(flown.rows):
                return
        for row in suspects:
            flown = _alone(workers, flights, row, kills)
            on_flown(flown)
            if store.add(flown.rows):
                return


def _in_parallel(workers: Workers, queue: "_Queue") -> Iterator[tuple[Batch, Flown | None]]:
    """Yield each batch with what became of it; None if it lost its worker."""
    running, capacity, counted_at = 0, 1, -math.inf
    while True:
        if time.monotonic() - counted_at > _CAPACITY_S:
            counted_at, capacity = time.monotonic(), max(workers.capacity(), 1)
        while running < capacity and (batch := queue.next_batch(capacity)):
            workers.submit(batch)
            running += 1
        if not running:
            return
        yield workers.wait()
        running -= 1


def _alone(workers: Workers, flights: Flights, row: Row, kills: Counter[int]) -> Flown:
    """Fly one row while nothing else flies, until it is flown or has killed enough processes."""
    import pyarrow as pa

    while kills[row["row"]] < KILLS:
        workers.submit([row])
        _, flown = workers.wait()
        if flown is not None:
            return flown
        kills[row["row"]] += 1
    reason = f"its process was killed {KILLS} times"
    crashed = pa.Table.from_pylist([ended(row, "crashed", reason)], flights.schema)
    return Flown("", crashed, 0.0, 0.0)


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
            size = int(min(fitting, _MAX_BATCH, math.ceil(self.waiting / (2 * workers))))
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
