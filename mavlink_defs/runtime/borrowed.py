"""Arrays in compiled loops without counting references to them.

Compiled code counts a reference, by an atomic instruction, whenever it takes an array out of a
tuple. A flight's loop does so hundreds of times per step, which took half of its time. An entry
point whose caller keeps the arrays alive as long as it runs borrows them instead.
"""

from typing import Any, TypeVar, cast

import numba
from numba.core import cgutils, types
from numba.extending import intrinsic

__all__ = ["borrowed"]

_T = TypeVar("_T")


def _without_owner(context: Any, builder: Any, kind: types.Type, value: Any) -> Any:
    """Return an array, or a tuple of such, that nobody owns."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        for pointer in ("meminfo", "parent"):
            setattr(array, pointer, cgutils.get_null_value(getattr(array, pointer).type))
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts = zip(kind.types, cgutils.unpack_tuple(builder, value), strict=True)
        return context.make_tuple(
            builder, kind, [_without_owner(context, builder, inner, part) for inner, part in parts]
        )
    return value


@intrinsic
def _borrowed(_context: Any, kind: types.Type) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _without_owner(context, builder, signature.args[0], arguments[0])

    return kind(kind), build


def _same(value: _T) -> _T:
    return value


borrowed = _same if vars(numba.config)["DISABLE_JIT"] else cast("Any", _borrowed)
"""Return an array, or a tuple of arrays and tuples, whose references are not counted.

For the first line of a compiled entry point: what it returns must not outlive the argument.
"""
