"""Workers that fly batches of rows: processes on this machine, or workers of a dask scheduler."""

import contextlib
import functools
import logging
import pickle
import re
import time
import zlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias

from ftc_lab.campaigns.flights import Flights, Row, fly_rows
from gcs.errors import BadInput, GcsError
from gcs.fleet.local_workers import LocalWorkers
from gcs.scenario.code import code_digest, code_version
from gcs.scenario.model import Scenario

if TYPE_CHECKING:
    import pyarrow as pa
    from distributed import Client, Future

Batch: TypeAlias = Sequence[Row]

_CONNECT_S = 10.0
_DASK = {
    "distributed.scheduler.allowed-failures": 0,  # the engine counts the processes that are killed
    "distributed.comm.timeouts.connect": f"{_CONNECT_S:g}s",
    "distributed.admin.tick.limit": "1h",  # a machine under load is no news
}


class Flown(NamedTuple):
    """A batch that was flown.

    Attributes:
        worker: Name of the worker; empty if none lived to the end of it.
        rows: Rows of the results.
        wall_s: Time that they took [s].
        cpu_s: Processor time that they took [s]; on a busy machine less than `wall_s`.
    """

    worker: str
    rows: "pa.Table"
    wall_s: float
    cpu_s: float


def fly_batch(flights: Flights, batch: Batch, worker: str) -> Flown:
    """Fly a batch in this process."""
    begin, cpu_begin = time.perf_counter(), time.process_time()
    rows = fly_rows(flights, batch)
    return Flown(worker, rows, time.perf_counter() - begin, time.process_time() - cpu_begin)


def local_workers(count: int, flights: Flights) -> LocalWorkers[Batch, Flown]:
    """Return processes on this machine that fly batches."""
    return LocalWorkers(count, functools.partial(fly_batch, flights))


class Workers(Protocol):
    """What flies the rows of a campaign."""

    def capacity(self) -> int:
        """Return how many batches fly at a time; 0 while there are no workers."""

    def submit(self, batch: Batch) -> None:
        """Let a batch fly."""

    def wait(self) -> tuple[Batch, Flown | None]:
        """Return the next batch that ended; None if it killed its worker."""


class WrongCode(BadInput):
    """A worker runs other code than we do."""


class ClusterWorkers:
    """The workers of a dask scheduler that somebody else started; it and they stay."""

    def __init__(self, client: "Client", flights: Flights) -> None:
        from distributed import as_completed

        self._client, self._flights = client, _packed(flights)
        self._running: dict[Future, Batch] = {}
        self._finished = as_completed(loop=client.loop)  # it would look for a default client

    def capacity(self) -> int:
        """Return the number of threads of all workers.

        Raises:
            GcsError: The scheduler was lost.
        """
        try:
            return sum(self._client.nthreads().values())
        except (OSError, ValueError, RuntimeError) as problem:
            raise _scheduler_lost() from problem

    def submit(self, batch: Batch) -> None:
        """Let some worker fly a batch."""
        future = self._client.submit(
            _fly_on_cluster, self._flights, _packed(batch), code_digest(), pure=False
        )
        self._running[future] = batch
        self._finished.add(future)

    def wait(self) -> tuple[Batch, Flown | None]:
        """Return the next batch that ended; None if it killed its worker.

        Raises:
            GcsError: The scheduler was lost.
            WrongCode: A worker that joined runs other code.
        """
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        future = next(self._finished)
        batch = self._running.pop(future)
        try:
            return batch, future.result()
        except KilledWorker:
            return batch, None
        except (FutureCancelledError, OSError) as problem:
            raise _scheduler_lost() from problem

    def prepare(self, scenario: Scenario | None) -> None:
        """Check that every worker runs our code, and have it compiled once on every host.

        Args:
            scenario: A scenario to compile for; None if there is nothing to compile.

        Raises:
            BadInput: Workers run other code, or none; each is named with its digest.
        """
        ours = code_version(), code_digest()
        found = self._client.run(_code, on_error="return")
        wrong = {address: code for address, code in found.items() if code != ours}
        if wrong:
            raise BadInput(
                "\n".join(
                    f"worker {address} runs {_described(code)}, expected ftc-sitl {ours[0]} "
                    f"with digest {ours[1]}"
                    for address, code in sorted(wrong.items())
                ),
                "install the same version on every host, and restart the workers",
            )
        if scenario is not None:
            first_of_host = {address.rpartition(":")[0]: address for address in sorted(found)}
            futures = [
                self._client.submit(compile_for, scenario, workers=[address], pure=False)
                for address in first_of_host.values()
            ]
            self._client.gather(futures)

    def close(self) -> None:
        """Cancel what still flies."""
        self._client.cancel(list(self._running), force=True)


def check_scheduler(address: str) -> None:
    """Check how the address of a dask scheduler is written.

    Raises:
        BadInput: It is no address.
    """
    if not re.fullmatch(r"(tcp|tls)://[^/]+:\d+", address):
        raise BadInput(f"--scheduler is {address!r}, expected tcp://HOST:PORT or tls://HOST:PORT")


@contextlib.contextmanager
def cluster(address: str, flights: Flights) -> Iterator[ClusterWorkers]:
    """Connect to a dask scheduler.

    Args:
        address: As in tcp://host:8786.
        flights: From rows to flights.

    Raises:
        BadInput: It is no address, none answers there, or it has no workers.
    """
    import dask
    from distributed import Client

    check_scheduler(address)
    with dask.config.set(_DASK), _silent(), contextlib.ExitStack() as stack:
        try:
            client = Client(address, timeout=_CONNECT_S, set_as_default=False)
        except OSError as problem:
            raise BadInput(
                f"--scheduler: no dask scheduler answers at {address}: {problem}",
                "start one with `dask scheduler`, and workers with `dask worker ADDRESS`",
            ) from problem
        stack.enter_context(client)
        try:
            client.wait_for_workers(1, timeout=_CONNECT_S)
        except TimeoutError:
            raise BadInput(
                f"--scheduler: the scheduler at {address} has no workers",
                f"start some: dask worker {address} --nthreads 1",
            ) from None
        yield stack.enter_context(contextlib.closing(ClusterWorkers(client, flights)))


def compile_for(scenario: Scenario) -> None:
    """Compile the numeric core on this host, unless it is cached."""
    from gcs.fleet.precompile import compile_everything
    from mavlink_defs.runtime.jit import cache_is_cold

    if cache_is_cold():
        compile_everything(scenario)


def _fly_on_cluster(flights: bytes, batch: bytes, digest: str) -> Flown:
    """Fly a batch; this runs on a worker."""
    from distributed import get_worker

    worker = get_worker().address
    if code_digest() != digest:
        raise WrongCode(
            f"worker {worker} runs ftc-sitl {code_version()} with digest {code_digest()}, "
            f"expected digest {digest}",
            "install the same version on every host, and restart the workers",
        )
    return fly_batch(_unpacked(flights), pickle.loads(zlib.decompress(batch)), worker)


def _packed(value: object) -> bytes:
    """Return a value as bytes: the scheduler, which keeps tasks for a while, need not know it."""
    return zlib.compress(pickle.dumps(value))


@functools.lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Flights:
    flights: Flights = pickle.loads(zlib.decompress(packed))
    return flights


def _scheduler_lost() -> GcsError:
    return GcsError(
        "the connection to the scheduler was lost; the flights so far are stored",
        "the same command continues, with or without --scheduler",
    )


def _code() -> tuple[str, str]:
    return code_version(), code_digest()


def _described(code: Any) -> str:
    if isinstance(code, tuple):
        return f"ftc-sitl {code[0]} with digest {code[1]}"
    return f"no ftc-sitl that can be called ({type(code).__name__}: {code})"


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Keep the logs of dask off the terminal; what matters ends in an exception of ours."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
