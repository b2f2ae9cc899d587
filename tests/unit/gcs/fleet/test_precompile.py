"""Ctrl-C while the numeric core is compiled.

Each case has a process of its own: an interrupt that goes astray would end the one that tests.
"""

import subprocess
import sys

import pytest

from gcs.fleet.precompile import _other_process
from gcs.scenario.model import Scenario

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


def test_the_other_process_compiles_to_its_end(scenario1: Scenario) -> None:
    """Nobody would notice: what it fails to compile, the caller compiles in twice the time."""
    with _other_process(scenario1.model_copy(update={"duration_s": 0.002})) as child:
        assert child.wait(300.0) == 0
