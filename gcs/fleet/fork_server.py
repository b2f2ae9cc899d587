"""A process from which plant and autopilots of a fleet are forked, so that they share imports.

Python, numpy, the dialect and the compiled core take a second of processor time and most of the
memory of an autopilot; a forked one begins with them. Linux only: elsewhere libraries do not
allow a fork, and every process of a fleet is one of its own from the start.

Requests come as lines of JSON on standard input, ``{"program": NAME, "arguments": [...], "log":
FILE}`` with ``sitl-plant`` or ``ftc-autopilot`` and its arguments, and are numbered from 0.
Standard output gets a line for every process that was started, ``[number, pid, null]``, or has
ended, ``[number, pid, status]``, with the status as in `subprocess.Popen.returncode`. From the
first request on, what the server has to say about itself goes to that request's log. At the end of
the input all that still run are stopped.

All are in the session of the server. Linux divides the processors among sessions first, so that
the ground station, alone in another, is not starved by a hundred autopilots. The plant is not to
be alone: it polls while it waits for answers, and would get a processor for that which those who
have to answer need.
"""

import contextlib
import ctypes
import gc
import json
import os
import select
import signal
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import ftc_autopilot.process
import ftc_autopilot.warm_up
import sitl_plant.loop.process
import sitl_plant.loop.warm_up
from gcs.scenario.model import load_scenario
from mavlink_defs.config.models import ConfigError
from mavlink_defs.runtime.heap import give_memory_back
from mavlink_defs.runtime.jit import cold_parts

_PLANT, _AUTOPILOT = "sitl-plant", "ftc-autopilot"
_MODULE: dict[str, Any] = {_PLANT: sitl_plant.loop.process, _AUTOPILOT: ftc_autopilot.process}


class _Request(NamedTuple):
    program: str
    arguments: list[str]
    log: str


def main() -> None:
    """Run the server."""
    _load_compiled_code()
    wake, waker = os.pipe()
    os.set_blocking(waker, False)
    signal.set_wakeup_fd(waker)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    numbers: dict[int, int] = {}
    waiting: list[_Request] = []
    requests, is_warm = 0, False
    unread = b""
    try:
        while True:
            readable, _, _ = select.select([0, wake], [], [], 0.0 if waiting else None)
            if wake in readable:
                os.read(wake, 4096)
                _report_ended(numbers)
            if 0 in readable:
                received = os.read(0, 1 << 16)
                if not received:
                    break
                *lines, unread = (unread + received).split(b"\n")
                waiting += [_Request(**json.loads(line)) for line in lines]
                if waiting and not requests:
                    _write_to(waiting[0].log, 2)
            elif waiting and not is_warm and waiting[-1].program == _AUTOPILOT:
                ftc_autopilot.warm_up.warm_up_with(Path(waiting[-1].arguments[0]))
                is_warm = True  # and meanwhile all others of the fleet have been asked for
            elif waiting:
                for request, prepared in zip(waiting, _prepared(waiting), strict=True):
                    pid = _fork(request, prepared, (wake, waker))
                    numbers[pid] = requests
                    _report(requests, pid, None)
                    requests += 1
                waiting = []
    except BrokenPipeError:
        pass  # nobody is left who would read the reports
    finally:
        for pid in numbers:
            os.kill(pid, signal.SIGTERM)


def _load_compiled_code() -> None:
    """Load what is in the cache, while the ground station still reads what to fly."""
    try:
        is_cold = cold_parts(("plant", "autopilot", "messages"))
    except ConfigError:  # which the ground station reports
        return
    if is_cold:
        return
    scenario = load_scenario("paper/scenario1")
    sitl_plant.loop.warm_up.call_everything(scenario.plant_config(speed=None))
    ftc_autopilot.warm_up.call_everything(scenario.autopilot_config(scenario.uavs[0].id))
    gc.freeze()


def _prepared(requests: Sequence[_Request]) -> list[Any]:
    """Return what the processes of a fleet begin with, made before the first of them is forked.

    Python counts the references to all that it uses, in the pages where that lies: each process
    has its own copy of a page from then on. What is done here is done to pages that all share.
    A single process, started again, does it itself, and so does one that fails, which reports it.
    """
    prepared = [None] * len(requests)
    for i, (program, arguments, _) in enumerate(requests if len(requests) > 1 else ()):
        with contextlib.suppress(Exception):
            prepared[i] = _MODULE[program].prepare([*arguments, *_of(os.getpid())])
    give_memory_back()
    gc.freeze()  # the collector would write to, and so copy, every page
    return prepared


def _report_ended(numbers: dict[int, int]) -> None:
    while numbers:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if pid == 0:
            return
        _report(numbers.pop(pid), pid, os.waitstatus_to_exitcode(status))


def _report(number: int, pid: int, status: int | None) -> None:
    os.write(1, json.dumps([number, pid, status]).encode() + b"\n")


def _write_to(log: str, *descriptors: int) -> None:
    with open(log, "ab") as output:
        for descriptor in descriptors:
            os.dup2(output.fileno(), descriptor)


def _fork(request: _Request, prepared: Any, pipes: tuple[int, int]) -> int:
    """Start a program; return its process id."""
    program, arguments, log = request
    parent = os.getpid()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})  # which here ends the server
    pid = os.fork()
    if pid:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
        return pid
    status = 1
    try:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for pipe in pipes:
            os.close(pipe)
        with open(os.devnull, "rb") as nothing:
            os.dup2(nothing.fileno(), 0)
        _write_to(log, 1, 2)
        _set_command_line(program, *arguments)
        _MODULE[program].main([*arguments, *_of(parent)], prepared)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _of(server: int) -> list[str]:
    return ["--exit-with-parent", str(server)]


def _set_command_line(*arguments: str) -> None:
    """Show other arguments in ps and top; what does not fit is cut off."""
    fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    begin, end = int(fields[45]), int(fields[46])  # arg_start and arg_end of proc(5)
    text = os.fsencode("\0".join(arguments))[: end - begin - 1]
    ctypes.memmove(begin, text.ljust(end - begin, b"\0"), end - begin)
