"""What all kinds of plug-ins have in common: what is checked, how their functions are called."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from ftc_autopilot.plugins.functions import (
    ABI,
    Functions,
    Sizes,
    array_at,
    check_room,
    compiled_function,
    function_of,
    library_functions,
    plain_function,
)
from ftc_autopilot.plugins.loading import calling, library_of, line_of, load_class, runs_code
from ftc_autopilot.plugins.memory import bytes_of, layout_of, tuple_at
from mavlink_defs.config.models import Model
from mavlink_defs.runtime.foreign import PluginError
from mavlink_defs.runtime.jit import is_compiled

_M = TypeVar("_M", bound=Model)


@dataclass(frozen=True, eq=False)
class Interface(Generic[_M]):
    """How the plug-ins of a kind are called.

    Attributes:
        group: Group of their entry points.
        base: What a plug-in is a subclass of.
        unread: What stands for a plug-in whose code is not run.
        symbol: Struct that a shared library exports; the header's name without its ending.
        entries: By the arguments that a Python function may have: makes of a compiled one what
            numba makes the C function of. Arguments are `now`, records, and fields of `now`.
        given: Type of the input, `now`.
        known: How much of it the struct of the header has [bytes].
        result: Compiled function that makes the output of what a Python function returns.
        output: Type of the output.
        expected: What a Python function is to return, for messages.
        records: Names of the records that a C function gets after input and output.
        further: Size of the largest record beside parameters and state [bytes]; 0: there is none.
        room: Largest record of parameters, and largest state [bytes].
        record: Returns the record of a plug-in's own parameters.
    """

    group: str
    base: type[_M]
    unread: type[_M]
    symbol: str
    entries: dict[str, Callable[[Callable[..., Any]], Callable[..., int]]]
    given: type[tuple[Any, ...]]
    known: int
    result: Callable[..., tuple[Any, ...]]
    output: type[tuple[Any, ...]]
    expected: str
    records: tuple[str, ...]
    further: int
    room: tuple[int, int]
    record: Callable[[type[_M]], np.dtype]

    def load(self, name: str) -> type[_M]:
        """Return the class of a name, FILE:CLASS or an entry point's; its interface is checked.

        Where no code is run, it is `unread`.

        Raises:
            PluginError: It cannot be used.
        """
        if not runs_code():
            return self.unread
        found = load_class(name, self.group, self.base)
        with calling(found, "record"):
            check_room(found, lambda: self.record(found), _state_of(found), self.room)
        if library_of(found) is not None:
            self._of_library(found)
        else:
            self._of_python(found)
        return found

    @functools.cache  # noqa: B019 - the interfaces are as old as the module
    def functions(self, found: type[_M], *further: np.dtype) -> Functions:
        """Return the addresses of a plug-in's C functions; compiled Python is compiled.

        Args:
            found: The class of the plug-in.
            further: Records that a C function gets after parameters and state.

        Raises:
            PluginError: It cannot be used.
        """
        if found is self.unread:
            raise PluginError("a scenario that was read without its code cannot be flown")
        if library_of(found) is not None:
            return self._of_library(found)
        names, function = self._of_python(found)
        own = (self.record(found), _state_of(found), *further)
        if not is_compiled(function):
            return Functions(self._plain(found, names, function, own), 0)
        records = (layout_of(self.given), layout_of(self.output), *own)
        return Functions(compiled_function(self.entries[names](function), records, found), 0)

    def _plain(
        self,
        found: type[_M],
        names: str,
        function: Callable[..., Any],
        records: tuple[np.dtype, ...],
    ) -> int:
        """Return the address of a C function that calls a plain function with the values there."""
        given, output, result = layout_of(self.given), layout_of(self.output), self.result

        def work(now_at: int, out: int, *addresses: int) -> None:
            now = tuple_at(self.given, array_at(now_at, given).tobytes())
            known = {name: getattr(now, name, now) for name in names.split(", ")}
            for name, address, dtype in zip(self.records, addresses, records, strict=True):
                known[name] = array_at(address, dtype)[0]
            answer = function(*(known[name] for name in names.split(", ")))
            try:
                written = bytes_of(inspect.unwrap(result)(answer))
            except (TypeError, ValueError, IndexError, OverflowError):
                text = f"{line_of(function)}: step: expected {self.expected}, got {answer!r}"
                raise PluginError(text) from None
            array_at(out, output)[:] = np.frombuffer(written, output)

        return plain_function(work, 2 + len(records), found)

    def _of_python(self, found: type[_M]) -> tuple[str, Callable[..., Any]]:
        """Return the arguments and the function of a plug-in."""
        by_count = {len(names.split()): names for names in self.entries}
        signature = " or ".join(f"({names})" for names in self.entries)
        function = function_of(found, tuple(by_count), signature)
        return by_count[len(inspect.signature(inspect.unwrap(function)).parameters)], function

    def _of_library(self, found: type[_M]) -> Functions:
        sizes = Sizes(
            ABI,
            self.known,
            layout_of(self.output).itemsize,
            self.further,
            self.record(found).itemsize,
            _state_of(found).itemsize,
        )
        return library_functions(found, self.symbol, sizes)


def _state_of(found: Any) -> np.dtype:
    state: np.dtype = found.STATE
    return state
