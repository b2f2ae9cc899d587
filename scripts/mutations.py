"""The small changes of equations that `find_mutants.py` tries: operators on syntax trees."""

import ast
import copy
import difflib
from collections.abc import Iterator
from typing import NamedTuple

_BINARY: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}
_BOUNDARY: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
}
_NEGATED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
}
_PERIOD = "dt"
"""What integrations multiply by: with none of it they stand still, with twice of it they double."""
_CALLED = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "abs": "float"}


class Change(NamedTuple):
    """A new value of a field of a syntax node, or of one item of that field."""

    field: str
    item: int | None
    value: object
    is_integration: bool = False

    def make(self, node: ast.AST) -> None:
        """Change a node in place."""
        if self.item is None:
            setattr(node, self.field, self.value)
        else:
            getattr(node, self.field)[self.item] = self.value


class Mutant(NamedTuple):
    """A function, or the assignment of numbers, before and after a change."""

    before: ast.stmt
    after: ast.stmt
    is_integration: bool

    def diff(self) -> str:
        """Return where it is, and the lines that are changed."""
        before, after = ast.unparse(self.before).split("\n"), ast.unparse(self.after).split("\n")
        lines = list(difflib.unified_diff(before, after, n=0, lineterm=""))[2:]
        changed = [f"    {x[0]} {x[1:].strip()}" for x in lines if not x.startswith("@@")]
        name = getattr(self.before, "name", "")
        return "\n".join([f"  line {self.before.lineno} {name}", *changed])


def mutants_of(source: str) -> list[Mutant]:
    """Return every mutant of a module."""
    found = []
    for statement in ast.parse(source).body:
        for at, node in enumerate(_changeable(statement)):
            for change in changes(node):
                after = copy.deepcopy(statement)
                change.make(_changeable(after)[at])
                after = ast.fix_missing_locations(after)
                found.append(Mutant(statement, after, change.is_integration))
    return found


def _changeable(statement: ast.stmt) -> list[ast.AST]:
    """Return the nodes of a statement of a module that may be changed."""
    match statement:
        case ast.FunctionDef(body=body):
            return [statement, *(node for inner in body for node in ast.walk(inner))]
        case ast.Assign(value=value) if not any(
            isinstance(node, ast.Call | ast.Lambda | ast.Dict) for node in ast.walk(value)
        ):
            return list(ast.walk(value))
    return []


def changes(node: ast.AST) -> Iterator[Change]:
    """Yield the ways in which one node is changed."""
    match node:
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in _BINARY:
            yield Change("op", None, _BINARY[type(op)]())
        case ast.BoolOp(op=ast.And()):
            yield Change("op", None, ast.Or())
        case ast.BoolOp(op=ast.Or()):
            yield Change("op", None, ast.And())
        case ast.UnaryOp(op=ast.USub()):
            yield Change("op", None, ast.UAdd())
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield Change("operand", None, ast.UnaryOp(ast.Not(), operand))
        case ast.Compare(ops=ops):
            for table in (_BOUNDARY, _NEGATED):
                for i, one in enumerate(ops):
                    if type(one) in table:
                        yield Change("ops", i, table[type(one)]())
        case ast.Constant(value=bool() | str() | None):
            pass
        case ast.Constant(value=int(whole)):
            yield Change("value", None, whole + 1)
        case ast.Constant(value=float(number)):
            yield Change("value", None, 2.0 * number if number else 1.0)
        case ast.Call(func=ast.Name(id=name)) if name in _CALLED:
            yield Change("func", None, ast.Name(_CALLED[name], ast.Load()))
        case ast.Call(func=ast.Attribute(value=math, attr=name)) if name in _CALLED:
            yield Change("func", None, ast.Attribute(math, _CALLED[name], ast.Load()))
    if isinstance(node, ast.BinOp | ast.UnaryOp | ast.Call | ast.keyword | ast.AugAssign):
        for name, value in ast.iter_fields(node):
            for i, inner in enumerate(value if isinstance(value, list) else [value]):
                if _is_period(inner):
                    item = i if isinstance(value, list) else None
                    for factor in (0.0, 2.0):
                        new = ast.BinOp(ast.Constant(factor), ast.Mult(), inner)
                        yield Change(name, item, new, is_integration=True)
    for block in ("body", "orelse"):
        statements = getattr(node, block, None)
        for i, inner in enumerate(statements if isinstance(statements, list) else ()):
            if _is_removable(inner):
                yield Change(block, i, ast.Pass())


def _is_period(node: object) -> bool:
    """Return whether a node is the control period, `dt` or `now.dt`."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name == _PERIOD
    return False


def _is_removable(statement: ast.stmt) -> bool:
    """Return whether a function still has a meaning without a statement."""
    match statement:
        case ast.AugAssign() | ast.Expr(value=ast.Call()) | ast.Continue() | ast.Break():
            return True
        case ast.Assign(targets=targets):
            written = [one for target in targets for one in getattr(target, "elts", [target])]
            return all(isinstance(one, ast.Subscript) for one in written)
    return False
