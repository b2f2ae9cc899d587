"""How sources are written: names of classes, constructions of records, roundings of equations."""

import ast
from collections import defaultdict

import numpy as np
from parsed import nodes

from sitl_plant.vec3 import hypot, square

DECORATORS = {"compiled", "inlined", "apart"}
MANY = 8


def is_record(node: ast.ClassDef) -> bool:
    above = [ast.unparse(each) for each in (*node.bases, *node.decorator_list)]
    return any("NamedTuple" in each or "dataclass" in each for each in above)


def test_no_two_classes_have_one_name() -> None:
    places = defaultdict(list)
    for name, node in nodes():
        if isinstance(node, ast.ClassDef):
            places[node.name].append(name)
    assert len(places) > 500
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_what_has_many_fields_is_made_by_their_names() -> None:
    classes = [node for _, node in nodes() if isinstance(node, ast.ClassDef)]
    records = {node.name for node in classes if is_record(node)}
    assert len(records) > 100
    found = [
        f"{name}:{node.lineno}: {ast.unparse(node.func)} of {len(node.args)} by position"
        for name, node in nodes()
        if isinstance(node, ast.Call)
        and len(node.args) >= MANY
        and ast.unparse(node.func).rpartition(".")[2] in records
    ]
    assert not found, "\n".join(found)


def decorators(function: ast.FunctionDef) -> set[str]:
    names = (one.func if isinstance(one, ast.Call) else one for one in function.decorator_list)
    return {one.id for one in names if isinstance(one, ast.Name)}


def rounds_otherwise(node: ast.expr) -> bool:
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        whole = isinstance(node.right, ast.Constant) and isinstance(node.right.value, int)
        return whole and not isinstance(node.left, ast.Constant)
    return isinstance(node, ast.Attribute) and ast.unparse(node) == "math.hypot"


def test_compiled_functions_round_as_in_plain_python() -> None:
    """In machine code x**2 is a product, and hypot the C library's.

    In plain Python x**2 is C's pow, one unit in the last place off in one of a thousand, and
    math.hypot has an algorithm of its own.
    """
    compiled = [
        (name, node)
        for name, node in nodes()
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
