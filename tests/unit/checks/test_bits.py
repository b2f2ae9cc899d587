"""Compiled functions have the same bits in plain Python: they call what both round alike.

In machine code x**2 is a product, and hypot the C library's. In plain Python x**2 is C's pow, one
unit in the last place off in one of a thousand, and math.hypot has an algorithm of its own.
"""

import ast

import numpy as np
from parsed import trees

from sitl_plant.vec3 import hypot, square

DECORATORS = {"compiled", "inlined", "apart"}


def decorators(node: ast.FunctionDef) -> set[str]:
    called = (each.func if isinstance(each, ast.Call) else each for each in node.decorator_list)
    return {ast.unparse(each) for each in called}


def rounds_otherwise(node: ast.expr) -> bool:
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        whole = isinstance(node.right, ast.Constant) and isinstance(node.right.value, int)
        return whole and not isinstance(node.left, ast.Constant)
    return isinstance(node, ast.Attribute) and ast.unparse(node) == "math.hypot"


def test_compiled_functions_round_as_in_plain_python() -> None:
    compiled = [
        (name, node)
        for name, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and decorators(node) & DECORATORS
    ]
    assert len(compiled) > 500
    found = [
        f"{name}:{each.lineno}: {ast.unparse(each)}"
        for name, node in compiled
        for each in ast.walk(node)
        if isinstance(each, ast.expr) and rounds_otherwise(each)
    ]
    assert not found, "`square` and `hypot` of sitl_plant.vec3 have the same bits both ways"


def test_what_is_called_instead_rounds_alike() -> None:
    lengths = np.random.default_rng(7).uniform(-3.0, 3.0, (2000, 2)).tolist()
    for function in (square, hypot):
        plain = getattr(function, "__wrapped__", function)
        pairs = [pair[: 1 + (function is hypot)] for pair in lengths]
        assert [function(*pair) for pair in pairs] == [plain(*pair) for pair in pairs]
