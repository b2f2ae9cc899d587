"""Functions that compiled code calls by an address, which their first call finds.

`mavlink_defs.runtime.jit.apart` says which and why.
"""

import ctypes
import inspect
import os
import signal
import threading
import traceback
from collections.abc import Callable, Mapping
from typing import Any, cast, get_args, get_origin, get_type_hints

import llvmlite.binding
import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils as numba_cgutils
from numba.core import types as numba_types
from numba.extending import lower_builtin, type_callable

_types: Any = numba_types  # without annotations
_typeof: Any = numba.typeof
_cgutils: Any = numba_cgutils
_LATER_S = 0.02


class Part:
    """A function that is called by its address, which is 0 before it is ready."""

    def __init__(
        self,
        function: Callable[..., Any],
        call: Callable[..., Any],
        memory: Mapping[str, Any],
        compile_as: Callable[[Any], Any],
    ) -> None:
        """Let compiled code call it.

        Args:
            function: The function.
            call: As it stands in the code of its callers.
            memory: As of `jit.apart`.
            compile_as: Makes its code for a signature, or loads it; numba's dispatcher with it.
        """
        self._function, self._memory, self._compile_as = function, memory, compile_as
        self._address = ctypes.c_void_p(0)
        self._code: Any = None
        self._resolver = ctypes.CFUNCTYPE(None)(self._resolve_in_flight)
        self._symbol = f"ftc_sitl.{function.__module__}.{function.__qualname__}"
        add_symbol = cast(Any, llvmlite.binding).add_symbol
        add_symbol(self._symbol, ctypes.addressof(self._address))
        resolver = ctypes.cast(self._resolver, ctypes.c_void_p).value
        add_symbol(f"{self._symbol}.resolve", resolver)
        self._signature: Any = None
        parameters = inspect.signature(function)

        def typer(_context: Any) -> Any:
            def of_call(*arguments: Any, **keywords: Any) -> Any:
                given, typed = parameters.bind(*arguments, **keywords).args, self._typed()
                if not all(map(_fits, given, typed.args)):
                    return None
                return typed.return_type(*map(_like_in_memory, given, typed.args))

            vars(of_call)["__signature__"] = parameters
            return of_call

        cast(Any, type_callable)(call)(typer)
        cast(Any, lower_builtin)(call, _types.VarArg(_types.Any))(self._lower)

    def resolve(self) -> None:
        """Find the address."""
        if self._code is None:
            self._code = self._compile_as(self._typed())
        (code,) = self._code.overloads.values()
        named = code.fndesc.llvm_func_name
        self._address.value = code.library.get_pointer_to_function(named)

    def _resolve_in_flight(self) -> None:
        """Resolve it from compiled code, into which no error can be raised."""
        interrupted = False
        while not self._address.value:
            try:
                self.resolve()
            except KeyboardInterrupt:
                interrupted = True
            except BaseException:
                traceback.print_exc()
                os._exit(1)
        if interrupted:
            again = threading.Timer(
                _LATER_S, signal.pthread_kill, [threading.get_ident(), signal.SIGINT]
            )
            again.daemon = True
            again.start()

    def _typed(self) -> Any:
        if self._signature is None:
            hints = get_type_hints(self._function)
            result = _type_of(hints.pop("return"))
            given = [self._memory.get(name, hint) for name, hint in hints.items()]
            self._signature = result(*map(_type_of, given))
        return self._signature

    def _lower(self, context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        typed, module = self._typed(), builder.module
        convention = context.call_conv
        pointer = convention.get_function_type(typed.return_type, typed.args).as_pointer()
        address = module.globals.get(self._symbol) or ir.GlobalVariable(
            module, pointer, self._symbol
        )
        resolver = module.globals.get(f"{self._symbol}.resolve") or ir.Function(
            module, ir.FunctionType(ir.VoidType(), []), f"{self._symbol}.resolve"
        )
        unknown = builder.icmp_unsigned("==", builder.load(address), ir.Constant(pointer, None))
        with builder.if_then(unknown, likely=False):
            builder.call(resolver, [])
        status, result = convention.call_function(
            builder, builder.load(address), typed.return_type, typed.args, arguments
        )
        with _cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return result


def _fits(given: Any, declared: Any) -> bool:
    """Return whether an argument is no other record than the declared one, such as a longer one."""
    return given == declared or not isinstance(declared, _types.Record)


def _like_in_memory(given: Any, declared: Any) -> Any:
    """Return the type as which an argument is passed: an array in a record is an array, too."""
    if isinstance(given, _types.BaseTuple) and isinstance(declared, _types.BaseTuple):
        alike = map(_like_in_memory, given.types, declared.types)
        return given if list(alike) == list(given.types) else declared
    if isinstance(given, _types.Array) and isinstance(declared, _types.Array):
        shapes = ((one.dtype, one.ndim, one.layout) for one in (given, declared))
        return given if next(shapes) == next(shapes) else declared
    return declared


def _type_of(kind: Any) -> Any:
    """Return the compiler's type of what `apart` or an annotation names."""
    if isinstance(kind, np.dtype):
        return _typeof(np.zeros(1, kind)[0])
    if isinstance(kind, np.ndarray | tuple):
        return _typeof(kind)
    if kind in {None, type(None)}:
        return _types.none
    if kind in {bool, int, float}:
        return {bool: _types.boolean, int: _types.int64, float: _types.float64}[kind]
    if get_origin(kind) is tuple:
        return _types.BaseTuple.from_types([_type_of(part) for part in get_args(kind)])
    parts = [_type_of(part) for part in get_type_hints(kind).values()]
    return (
        _types.NamedTuple(parts, kind)
        if len(set(parts)) > 1
        else _types.NamedUniTuple(parts[0], len(parts), kind)
    )
