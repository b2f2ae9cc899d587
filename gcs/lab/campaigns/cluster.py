"""Workers: those of a cluster on this machine, or of a dask scheduler elsewhere."""

import contextlib
import logging
import multiprocessing.resource_tracker
import re
import signal
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from gcs.errors import BadInput
from gcs.scenario.code import code_digest, code_version
from gcs.scenario.model import Scenario

if TYPE_CHECKING:
    from distributed import Client

_CONNECT_S = 10.0
_QUIET = {
    "distributed.scheduler.allowed-failures": 0,  # the engine counts the processes that are killed
    "distributed.scheduler.http.routes": [],  # its server of web pages cannot be left out
    "distributed.worker.http.routes": [],
    "distributed.worker.memory.target": False,  # results are small, and flights end by themselves
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": False,
    "distributed.comm.timeouts.connect": f"{_CONNECT_S:g}s",
    "distributed.deploy.lost-worker-timeout": "1h",  # else one that starts slowly is given up
    "distributed.admin.low-level-log-length": 10,  # else the last 1000 messages are kept
    "distributed.admin.tick.limit": "1h",  # a machine under load is no news
}


@contextlib.contextmanager
def local_cluster(workers: int) -> Iterator["Client"]:
    """Start workers on this machine, one process each, on the loopback interface; end them."""
    import dask
    from distributed import Client, LocalCluster

    with dask.config.set(_QUIET), _silent(), contextlib.ExitStack() as stack:
        with _signals_are_ours():
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                    silence_logs=logging.CRITICAL,
                )
            )
            client = stack.enter_context(Client(cluster, set_as_default=False))
        yield client


def check_scheduler(address: str) -> None:
    """Check how the address of a dask scheduler is written.

    Raises:
        BadInput: It is no address.
    """
    if not re.fullmatch(r"(tcp|tls)://[^/]+:\d+", address):
        raise BadInput(f"--scheduler is {address!r}, expected tcp://HOST:PORT or tls://HOST:PORT")


@contextlib.contextmanager
def cluster_elsewhere(address: str) -> Iterator["Client"]:
    """Connect to a dask scheduler that somebody else started; it and its workers stay.

    Args:
        address: As in tcp://host:8786.

    Raises:
        BadInput: It is no address, none answers there, or it has no workers.
    """
    import dask
    from distributed import Client

    check_scheduler(address)
    with dask.config.set(_QUIET), _silent(), contextlib.ExitStack() as stack:
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
        yield client


def capacity(client: "Client") -> int:
    """Return how many batches the workers fly at a time; 0 while there are none."""
    return sum(client.nthreads().values())


def prepare(client: "Client", scenario: Scenario | None) -> None:
    """Check that every worker runs our code, and have it compiled once on every host.

    Args:
        client: Client of their cluster.
        scenario: A scenario to compile for; None if there is nothing to compile.

    Raises:
        BadInput: Workers run other code, or none; each is named with its digest.
    """
    ours = code_digest()
    found = client.run(_code, on_error="return")
    wrong = {address: code for address, code in found.items() if code != (code_version(), ours)}
    if wrong:
        raise BadInput(
            "\n".join(
                f"worker {address} runs {_described(code)}, expected ftc-sitl {code_version()} "
                f"with digest {ours}"
                for address, code in sorted(wrong.items())
            ),
            "install the same version on every host, and restart the workers",
        )
    if scenario is None:
        return
    first_of_host = {address.rpartition(":")[0]: address for address in sorted(found)}
    futures = [
        client.submit(_compile, scenario, workers=[address], pure=False)
        for address in first_of_host.values()
    ]
    client.gather(futures)


def _code() -> tuple[str, str]:
    return code_version(), code_digest()


def _described(code: Any) -> str:
    if isinstance(code, tuple):
        return f"ftc-sitl {code[0]} with digest {code[1]}"
    return f"no ftc-sitl that can be called ({type(code).__name__}: {code})"


def _compile(scenario: Scenario) -> None:
    from gcs.fleet.precompile import compile_everything
    from mavlink_defs.runtime.code_cache import cache_is_cold

    if cache_is_cold():
        compile_everything(scenario)


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Keep the logs of dask off the terminal; what matters ends in an exception of ours."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)


@contextlib.contextmanager
def _signals_are_ours() -> Iterator[None]:
    """Block Ctrl-C in threads that begin here, and so in every process that they start.

    A terminal sends it to all processes; the workers end when the command ends them.
    """
    multiprocessing.resource_tracker.ensure_running()  # it would unblock the signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
