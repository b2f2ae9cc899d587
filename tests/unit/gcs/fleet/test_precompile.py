"""Ctrl-C while the numeric core is compiled."""

import ctypes
import signal
import sys
import time
from collections.abc import Callable

import llvmlite
import pytest

from gcs.fleet.precompile import ctrl_c_while_compiling


def called_back(function: Callable[[], None]) -> None:
    """Call a function as LLVM does: through C, from a function of the compiler's package."""
    names: dict[str, Callable[..., None]] = {}
    source = "def notify(function): function()"
    exec(compile(source, llvmlite.__file__, "exec"), names)
    ctypes.CFUNCTYPE(None)(lambda: names["notify"](function))()


def ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)


def interrupted_while_compiling() -> None:
    with ctrl_c_while_compiling():
        called_back(ctrl_c)
        time.sleep(10.0)
        pytest.fail("the interrupt was lost")


def interrupted_between_two_calls() -> None:
    with ctrl_c_while_compiling():
        ctrl_c()
        pytest.fail("not interrupted at once")


def test_an_interrupt_in_a_call_back_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the test below would do without the context."""
    lost: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda what: lost.append(what.exc_type))
    called_back(ctrl_c)
    assert lost == [KeyboardInterrupt]


@pytest.mark.parametrize("moment", [interrupted_while_compiling, interrupted_between_two_calls])
def test_ctrl_c_interrupts_the_compiler(moment: Callable[[], None]) -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        moment()
    assert signal.getsignal(signal.SIGINT) is before
