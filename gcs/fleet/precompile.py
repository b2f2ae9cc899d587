"""Compile the numeric core ahead of its first use, once for all processes."""

import contextlib
import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from types import FrameType

import llvmlite
import numpy as np

from ftc_autopilot.warm_up import call_controller, call_loop, call_messages, endless_path
from gcs.fleet.in_process import fly_in_process
from gcs.results.path_following import PathFigures
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario
from mavlink_defs.capture import relay_loop
from mavlink_defs.capture.impairing import new_directions
from mavlink_defs.capture.tap_counts import new_counts
from mavlink_defs.runtime.code_cache import mark_cache_warm, not_cached
from sitl_plant.loop.warm_up import call_everything as call_plant

_COMPILER = os.path.dirname(llvmlite.__file__) + os.sep
_LATER_S = 0.02
_OBJECTS = 200_000  # made between two searches for garbage


def compile_everything(scenario: Scenario) -> None:
    """Call every compiled entry point once, so that its machine code is in the cache.

    Two processes share the work.

    Args:
        scenario: Any scenario; a few steps of it are flown in process.

    Raises:
        ConfigError: The cache cannot be written.
        OSError: Too many files are open.
    """
    try:
        with _seldom_collected():
            _call_everything(scenario)
        mark_cache_warm()
    except OSError as problem:
        raise not_cached(problem) from problem


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


def call_everything(scenario: Scenario) -> None:
    """Call every entry point in this process.

    Args:
        scenario: As above.
    """
    with _seldom_collected():
        short = _short(scenario)
        _call_processes(short)
        _call_rest(short)


def _call_everything(scenario: Scenario) -> None:
    short = _short(scenario)
    with _other_process(short):
        _call_processes(short)
    _call_rest(short)


def _short(scenario: Scenario) -> Scenario:
    return scenario.model_copy(update={"duration_s": 2 * scenario.step_us / 1e6})


def _call_processes(scenario: Scenario) -> None:
    """Call what plant, relay and autopilot call in flight."""
    call_plant(scenario.plant_config(speed=None))
    _call_relay()
    call_loop(scenario.autopilot_config(scenario.uavs[0].id))


@contextlib.contextmanager
def _other_process(scenario: Scenario) -> Iterator[subprocess.Popen[bytes]]:
    """Compile the rest elsewhere meanwhile: the flight in process, messages.

    What fails there is left to the caller. It begins with the controller, which the caller needs
    last and then finds in the cache.
    """
    command = [sys.executable, "-m", __spec__.name if __spec__ else __name__]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet) as child:
        assert child.stdin is not None
        try:
            pickle.dump(scenario.model_dump(), child.stdin)
            child.stdin.flush()
            yield child
            child.wait()
        except BrokenPipeError:
            return
        finally:
            child.kill()


def _call_rest(scenario: Scenario) -> None:
    call_messages(scenario.autopilot_config(scenario.uavs[0].id))
    flight = fly_in_process(scenario)
    summarise(flight, scenario)
    paths = np.stack([endless_path()] * len(scenario.uavs))
    PathFigures(paths, (0,), scenario.step_us).add(flight.steps)  # without a mission, too


def _call_relay() -> None:
    relay = relay_loop.new_relay_state(-1, [], [], [], new_directions([]))
    relay_loop.pause(relay)
    relay_loop.run(relay, new_counts(window_s=1.0))


def _end_with_parent() -> None:
    while os.read(0, 1):  # not by `sys.stdin`, whose lock a thread may not hold in the end
        pass
    os._exit(1)


if __name__ == "__main__":
    given = Scenario.model_validate(pickle.load(sys.stdin.buffer))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with _seldom_collected():
        call_controller(given.autopilot_config(given.uavs[0].id))
        _call_rest(given)
