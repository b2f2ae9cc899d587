"""What all kinds of plug-ins have in common: what is checked, and where their functions are."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from ftc_autopilot.plugins.functions import (
    ABI,
    Functions,
    Sizes,
    check_room,
    function_of,
    library_functions,
)
from ftc_autopilot.plugins.loading import calling, library_of, load_class, runs_code
from mavlink_defs.config.models import Model
from mavlink_defs.runtime.foreign import PluginError

_M = TypeVar("_M", bound=Model)


@dataclass(frozen=True)
class Interface(Generic[_M]):
    """How the plug-ins of a kind are called.

    Attributes:
        group: Group of their entry points.
        base: What a plug-in is a subclass of.
        unread: What stands for a plug-in whose code is not run.
        symbol: Struct that a shared library exports; the header's name without its ending.
        counts: Numbers of arguments that a Python function may have.
        signature: These arguments, for messages.
        given: Struct of the input.
        result: Struct of the output.
        further: Size of the largest record beside parameters and state [bytes]; 0: there is none.
        room: Largest record of parameters, and largest state [bytes].
        record: Returns the record of a plug-in's own parameters.
    """

    group: str
    base: type[_M]
    unread: type[_M]
    symbol: str
    counts: tuple[int, ...]
    signature: str
    given: np.dtype
    result: np.dtype
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

    def functions(
        self, found: type[_M], address_of: Callable[[Callable[..., Any]], int]
    ) -> Functions:
        """Return the addresses of a plug-in's C functions.

        Args:
            found: The class of the plug-in.
            address_of: Makes a C function of its Python function, and returns the address.

        Raises:
            PluginError: It cannot be used.
        """
        if found is self.unread:
            raise PluginError("a scenario that was read without its code cannot be flown")
        if library_of(found) is not None:
            return self._of_library(found)
        return Functions(address_of(self._of_python(found)), 0)

    def _of_python(self, found: type[_M]) -> Callable[..., Any]:
        return function_of(found, self.counts, self.signature)

    def _of_library(self, found: type[_M]) -> Functions:
        sizes = Sizes(
            ABI,
            self.given.itemsize,
            self.result.itemsize,
            self.further,
            self.record(found).itemsize,
            _state_of(found).itemsize,
        )
        return library_functions(found, self.symbol, sizes)


def _state_of(found: Any) -> np.dtype:
    state: np.dtype = found.STATE
    return state
