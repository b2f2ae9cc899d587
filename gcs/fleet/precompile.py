"""Compile the numeric core ahead of its first use, once for all processes."""

import contextlib
import functools
import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import FrameType, MappingProxyType

import llvmlite
import numpy as np

from ftc_autopilot.warm_up import PARTS as AUTOPILOT_PARTS
from ftc_autopilot.warm_up import call_loop, call_messages, endless_path
from gcs.fleet.in_process import fly_in_process, room_of
from gcs.results.path_following import PathFigures
from gcs.results.recording import Ending, Recording
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.capture import relay_loop
from mavlink_defs.capture.impairing import new_directions
from mavlink_defs.capture.tap_counts import new_counts
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.framing.hot_signing import SIGNING_PARTS
from mavlink_defs.runtime.cache_folder import mark_warm, not_cached
from mavlink_defs.runtime.jit import EVERYTHING, PLAIN, cold_parts, load
from sitl_plant.air.turbulence import advance_turbulence
from sitl_plant.loop.period import GROUND_PARTS
from sitl_plant.loop.warm_up import call_everything as call_plant
from sitl_plant.sensing.sense import sense

_COMPILER = os.path.dirname(llvmlite.__file__) + os.sep
_LATER_S = 0.02
_OBJECTS = 200_000  # made between two searches for garbage


def compile_parts(
    parts: Sequence[str] | None = None, on_progress: Callable[[int], None] = lambda _: None
) -> None:
    """Compile parts of the numeric core that are not cached yet, on all processors.

    Args:
        parts: Keys of `PARTS`; None: all of them.
        on_progress: Called with the number of parts that were begun before.

    Raises:
        ConfigError: The cache cannot be written.
        OSError: Too many files are open.
    """
    try:
        left = cold_parts(PARTS if parts is None else parts)
        cold = [part for part in PARTS if part in left]  # the largest first
        with _seldom_collected(), _shared_out(cold) as taken:
            for k in taken:
                on_progress(k)
                _compile(cold[k])
        for name in cold_parts(cold):  # which another process failed to compile
            _compile(name)
        if parts is None and not PLAIN:
            mark_warm(EVERYTHING)
    except OSError as problem:
        raise not_cached(problem) from problem


def _compile(name: str) -> None:
    PARTS[name]()
    mark_warm(name)


@contextlib.contextmanager
def _seldom_collected() -> Iterator[None]:
    """Let Python collect garbage seldom: the compiler makes millions of objects that stay."""
    before = gc.get_threshold()
    gc.set_threshold(_OBJECTS)
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextlib.contextmanager
def _shared_out(names: Sequence[str]) -> Iterator[Iterator[int]]:
    """Share parts out to a process for each processor; yield the numbers of those left to us.

    Whoever reads a byte from the common pipe takes the part with that number. The processes end
    with ours.
    """
    queue, to_queue = os.pipe()
    os.write(to_queue, bytes(range(len(names))))
    os.close(to_queue)
    command = [sys.executable, "-m", __spec__.name if __spec__ else __name__, str(queue), *names]
    quiet = subprocess.DEVNULL
    others = [
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet, pass_fds=[queue]
        )
        for _ in range(min(os.cpu_count() or 1, len(names)) - 1)
    ]
    try:
        yield _taken(queue)
        for other in others:
            other.wait()
    finally:
        os.close(queue)
        for other in others:
            other.kill()
            other.communicate()


def _taken(queue: int) -> Iterator[int]:
    while number := os.read(queue, 1):
        yield number[0]


@contextlib.contextmanager
def ctrl_c_while_compiling() -> Iterator[None]:
    """Let Ctrl-C interrupt the compiler, too.

    LLVM calls Python back, and what is raised in such a call is printed and lost. So an interrupt
    that finds the compiler's own functions on the stack is sent again a moment later.
    """
    before = signal.getsignal(signal.SIGINT)
    if not callable(before) or threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _in_compiler(frame):
            again = threading.Timer(_LATER_S, signal.pthread_kill, [threading.get_ident(), number])
            again.daemon = True
            again.start()
        else:
            before(number, frame)

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _in_compiler(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith(_COMPILER):
            return True
        frame = frame.f_back
    return False


@functools.cache
def _example() -> Scenario:
    """Return any scenario, of two steps: what compiled code is given has the same types in all."""
    scenario = load_scenario("paper/scenario1")
    return scenario.model_copy(update={"duration_s": 2 * scenario.step_us / 1e6})


def _call_autopilot() -> None:
    call_loop(_example().autopilot_config(_example().uavs[0].id))


def _call_messages() -> None:
    call_messages(_example().autopilot_config(_example().uavs[0].id))


def _call_results() -> None:
    scenario, n = _example(), len(_example().uavs)
    steps = room_of(scenario, scenario.steps)
    repeats = np.zeros((n, N_CHANNELS), np.int64)
    ending = Ending(mode="in_process", steps=scenario.steps, repeats=repeats, wall_s=1.0, loss=None)
    ids = tuple(uav.id for uav in scenario.uavs)
    summarise(Recording.of(steps, ending, ids, scenario.step_us), scenario)
    paths = np.stack([endless_path()] * n)
    PathFigures(paths, (0,), scenario.step_us).add(steps)


def _call_relay() -> None:
    relay = relay_loop.new_relay_state(-1, [], [], [], new_directions([]))
    relay_loop.pause(relay)
    relay_loop.run(relay, new_counts(window_s=1.0))


PARTS: Mapping[str, Callable[[], object]] = MappingProxyType(
    {
        "autopilot": _call_autopilot,
        "plant": lambda: call_plant(_example().plant_config(speed=None)),
        **AUTOPILOT_PARTS,
        "in process": lambda: fly_in_process(_example()),
        "results": _call_results,
        "messages": _call_messages,
        "relay": _call_relay,
        "ground": lambda: load(*GROUND_PARTS),
        "sensors": lambda: load(sense),
        "signing": lambda: load(*SIGNING_PARTS),
        "turbulence": lambda: load(advance_turbulence),
    }
)
"""What is compiled apart: each calls, or loads, a part of the numeric core. The largest first."""


def _end_with_parent() -> None:
    while os.read(0, 1):  # not by `sys.stdin`, whose lock a thread may not hold in the end
        pass
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with _seldom_collected():
        for index in _taken(int(sys.argv[1])):
            _compile(sys.argv[2 + index])
