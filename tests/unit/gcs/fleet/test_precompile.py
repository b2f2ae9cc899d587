"""Ctrl-C while the numeric core is compiled.

Each case has a process of its own: an interrupt that goes astray would end the one that tests.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CALLED_BACK = """
import ctypes, signal, sys, time
import llvmlite
from gcs.fleet.precompile import ctrl_c_while_compiling

def called_back(function):
    "Call a function as LLVM does: through C, from a function of the compiler's package."
    names = {}
    source = "def notify(function): function()"
    exec(compile(source, llvmlite.__file__, "exec"), names)
    ctypes.CFUNCTYPE(None)(lambda: names["notify"](function))()

def ctrl_c():
    signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
"""
LOST = """
lost = []
sys.unraisablehook = lambda what: lost.append(what.exc_type.__name__)
called_back(ctrl_c)
print(*lost)
"""
IN_A_CALL_BACK = "called_back(ctrl_c); time.sleep(30.0)"
BETWEEN_TWO_CALLS = "ctrl_c()"
INTERRUPTED = """
try:
    with ctrl_c_while_compiling():
        {}
        print("the interrupt was lost")
except KeyboardInterrupt:
    print("interrupted", signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""


def output(code: str) -> str:
    command = [sys.executable, "-c", CALLED_BACK + code]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_an_interrupt_in_a_call_back_is_lost() -> None:
    """What the test below would do without the context."""
    assert output(LOST) == "KeyboardInterrupt"


@pytest.mark.parametrize("moment", [IN_A_CALL_BACK, BETWEEN_TWO_CALLS])
def test_ctrl_c_interrupts_the_compiler(moment: str) -> None:
    assert output(INTERRUPTED.format(moment)) == "interrupted True"


SHARED = """
import sys
from gcs.fleet import precompile
from mavlink_defs.runtime.jit import cold_parts

compiled, compile_one = [], precompile._compile
precompile._compile = lambda part: (compiled.append(part), compile_one(part))
precompile.os.cpu_count = lambda: 2
precompile._taken = {taken}
begun = []
precompile.compile_parts(["turbulence"], begun.append)
print(compiled, begun, cold_parts(["turbulence", "relay"]))
"""
OURS = "precompile._taken"
NONE = "lambda queue: iter(())"


@pytest.mark.parametrize(
    ("taken", "printed"),
    [(OURS, "['turbulence'] [0] ['relay']"), (NONE, "['turbulence'] [] ['relay']")],
)
def test_what_no_process_has_compiled_the_caller_does(
    taken: str, printed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert output(SHARED.format(taken=taken)) == printed


def test_the_others_compile_to_their_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody would notice: what they fail to compile, the caller compiles in twice the time."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    queue, to_queue = os.pipe()
    os.write(to_queue, bytes([1]))
    os.close(to_queue)
    command = [sys.executable, "-m", "gcs.fleet.precompile", str(queue), "relay", "turbulence"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[queue]) as child:
        os.close(queue)
        assert child.wait(300.0) == 0
    (mark,) = (tmp_path / "core").glob("warm-*")
    assert mark.name.endswith("-turbulence")
