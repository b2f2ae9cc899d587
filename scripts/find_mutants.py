"""Change the equations in small ways, one at a time, and print the changes that no test notices.

All runs as plain Python, as `make mutants` sets NUMBA_DISABLE_JIT=1: a changed function gets its
new code in place, whoever has imported it. The tests are collected once; each mutant is tried in a
fork of that process, which ends at the first test that fails. Changed are the functions of a module
and its numbers, but not its classes, which hold parameters. A mutant that takes several times as
long as all its tests together counts as noticed.
"""

import argparse
import ast
import copy
import difflib
import importlib
import inspect
import os
import random
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
UNIT = ROOT / "tests" / "unit"
_C, _P = "ftc_autopilot/control", "sitl_plant"
_CONTROL = tuple(
    f"{_C}/{name}"
    for name in ("test_vectors_controller", "test_successive_steps", "laws/test_courses")
)
_PLANT = tuple(
    f"{_P}/{name}"
    for name in ("test_vectors_plant", "test_successive_steps", "test_plant", "test_courses")
)
_TRIGGERS = (*_CONTROL, f"{_C}/triggers/test_triggers", f"{_C}/test_trigger")
_DIAGNOSIS = (
    *_CONTROL,
    *(
        f"{_C}/diagnosis/{name}"
        for name in ("test_decisions", "test_suspicions", "test_losses_and_returns", "test_courses")
    ),
)
_SURVIVING = (
    *_CONTROL,
    *(f"{_C}/laws/{name}" for name in ("test_surviving_gains", "test_surviving_trims")),
    f"{_C}/diagnosis/test_courses",
)
_TUBE = (*_CONTROL, f"{_C}/laws/test_tube_parts")
TESTS = {
    f"{_C}/speed.py": _CONTROL,
    f"{_C}/attitude.py": _CONTROL,
    f"{_C}/inversion.py": (*_CONTROL, f"{_C}/test_laws", f"{_C}/test_finite_commands"),
    f"{_C}/rbf.py": (*_CONTROL, f"{_C}/test_rbf"),
    f"{_C}/reference.py": (*_CONTROL, f"{_C}/test_reference"),
    f"{_C}/synchronisation_errors.py": (*_CONTROL, f"{_C}/test_formation"),
    f"{_C}/transmit.py": (*_TRIGGERS, f"{_C}/test_finite_commands"),
    f"{_C}/state_predictor.py": (f"{_C}/test_delay", *_CONTROL),
    f"{_C}/triggers/base.py": _TRIGGERS,
    f"{_C}/triggers/static.py": _TRIGGERS,
    f"{_C}/triggers/periodic.py": _TRIGGERS,
    f"{_C}/triggers/periodic_event.py": _TRIGGERS,
    f"{_C}/triggers/dynamic.py": _TRIGGERS,
    f"{_C}/triggers/self_triggered.py": _TRIGGERS,
    f"{_C}/triggers/scaled.py": _TRIGGERS,
    f"{_C}/laws/proposed.py": _CONTROL,
    f"{_C}/laws/backstepping.py": (*_CONTROL, f"{_C}/test_laws"),
    f"{_C}/laws/pid.py": (*_CONTROL, f"{_C}/test_laws"),
    f"{_C}/laws/surviving/gains.py": _SURVIVING,
    f"{_C}/laws/surviving/healthy.py": _SURVIVING,
    f"{_C}/laws/surviving/lateral.py": _SURVIVING,
    f"{_C}/laws/surviving/longitudinal.py": _SURVIVING,
    f"{_C}/laws/surviving/law.py": _SURVIVING,
    f"{_C}/laws/tube/adaptation.py": (*_TUBE, f"{_C}/laws/test_tube_adaptation"),
    f"{_C}/laws/tube/check.py": _TUBE,
    f"{_C}/laws/tube/fallback.py": _TUBE,
    f"{_C}/laws/tube/law.py": _TUBE,
    f"{_C}/laws/tube/observer.py": _TUBE,
    f"{_C}/laws/tube/plan.py": _TUBE,
    f"{_C}/laws/tube/prediction.py": _TUBE,
    f"{_C}/laws/tube/tube.py": _TUBE,
    f"{_C}/diagnosis/measurement.py": (f"{_C}/diagnosis/test_measurement", *_DIAGNOSIS),
    f"{_C}/diagnosis/regression.py": (f"{_C}/diagnosis/test_regression", *_DIAGNOSIS),
    f"{_C}/diagnosis/instrument.py": (f"{_C}/diagnosis/test_instrument", *_DIAGNOSIS),
    f"{_C}/diagnosis/decisions.py": _DIAGNOSIS,
    f"{_C}/diagnosis/diagnose.py": (f"{_C}/diagnosis/test_measurement", *_DIAGNOSIS),
    f"{_C}/diagnosis/excitation.py": (f"{_C}/diagnosis/test_excitation", *_DIAGNOSIS),
    f"{_P}/aerodynamics.py": (*_PLANT, f"{_P}/test_aerodynamics"),
    f"{_P}/rigid_body.py": (*_PLANT, f"{_P}/test_rigid_body"),
    f"{_P}/servo.py": (*_PLANT, f"{_P}/test_servo"),
    f"{_P}/actuators.py": (*_PLANT, f"{_P}/test_actuators"),
    f"{_P}/lag.py": (*_PLANT, f"{_P}/test_servo"),
    f"{_P}/wind.py": (*_PLANT, f"{_P}/test_wind"),
    f"{_P}/turbulence.py": (*_PLANT, f"{_P}/test_turbulence"),
    f"{_P}/plant.py": (*_PLANT, f"{_P}/test_rigid_body"),
    f"{_P}/sensors.py": (*_PLANT, f"{_P}/test_sensors"),
    f"{_P}/disturbance.py": _PLANT,
    f"{_P}/vec3.py": _PLANT,
    f"{_P}/gaussian.py": (f"{_P}/test_gaussian",),
}
"""Modules with equations, and the tests of each under tests/unit."""
LONGEST_S = 3
"""Tests that take longer as plain Python, or do not pass as such, are left out."""
FLIGHT = "fly_in_process"
"""So are tests that call this."""


def tests_of(module: str) -> set[Path]:
    """Return the files of the tests of a module."""
    return {UNIT / f"{name}.py" for name in TESTS[module]}


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


def put_in_place(mutant: Mutant, module: str) -> None:
    """Change a module that is loaded: the code of a function, or numbers wherever they are."""
    scope = vars(importlib.import_module(module))
    statement = copy.deepcopy(mutant.after)
    local: dict[str, object] = {}
    if isinstance(statement, ast.FunctionDef):
        statement.decorator_list = []
        exec(compile(ast.Module([statement], []), module, "exec"), scope, local)
        function = inspect.unwrap(scope[statement.name])
        function.__code__ = local[statement.name].__code__  # type: ignore[attr-defined] # of exec
        if hasattr(scope[statement.name], "cache_clear"):
            scope[statement.name].cache_clear()
        return
    exec(compile(ast.Module([statement], []), module, "exec"), scope, local)
    before = {name: scope[name] for name in local}
    for other in list(sys.modules.values()):
        for name, value in before.items():
            if vars(other).get(name) is value:
                vars(other)[name] = local[name]


class Outcome(NamedTuple):
    """What the tests of one module have noticed."""

    module: str
    tried: int
    missed: list[Mutant]

    def row(self) -> str:
        """Return a row of the table."""
        noticed = self.tried - len(self.missed)
        return f"{self.module:58} {noticed:5} of {self.tried:5}"


class Trials:
    """A plugin of pytest that runs the tests of each module once for each of its mutants."""

    def __init__(self, mutants: dict[str, list[Mutant]]) -> None:
        self.mutants = mutants
        self.outcomes: list[Outcome] = []
        self._seconds: dict[pytest.Item, float] = {}
        self._in_child = False

    @pytest.hookimpl(tryfirst=True)
    def pytest_configure(self) -> None:
        """Register a profile of hypothesis that looks for no smaller example of a failure."""
        from hypothesis import Phase, settings  # noqa: PLC0415 # pytest changes it on import

        quick = [Phase.explicit, Phase.generate]
        settings.register_profile("mutants", settings.default, phases=quick)

    @pytest.hookimpl
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """End a trial at the first failure."""
        if report.failed and self._in_child:
            os._exit(1)

    @pytest.hookimpl
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Time all tests unchanged, then run the ones of each module with each of its mutants."""
        for item in session.items:
            if isinstance(item, pytest.Function) and FLIGHT in inspect.getsource(item.function):
                continue
            before = time.monotonic()
            status = self._status_of([item], LONGEST_S)
            if status == 0:
                self._seconds[item] = time.monotonic() - before
            else:
                print(f"left out: {item.nodeid}, which ends with {status}", flush=True)
        in_order = sorted(self._seconds, key=lambda item: self._seconds[item])
        for module, mutants in self.mutants.items():
            files = tests_of(module)
            items = [item for item in in_order if item.path in files]
            seconds = sum(self._seconds[item] for item in items)
            within = 10 + int(4.0 * seconds)
            missed = [one for one in mutants if self._status_of(items, within, module, one) == 0]
            self.outcomes.append(Outcome(module, len(mutants), missed))
            print(f"{self.outcomes[-1].row()}   {len(items)} tests in {seconds:.1f} s", flush=True)
            for one in missed:
                print(one.diff(), flush=True)
        return True

    def _status_of(
        self,
        items: list[pytest.Item],
        within_s: int,
        module: str = "",
        mutant: Mutant | None = None,
    ) -> int:
        """Return the status with which a fork of this process ends that runs tests; 0: all pass."""
        child = os.fork()
        if child != 0:
            return os.waitpid(child, 0)[1]
        signal.alarm(within_s)
        self._in_child = True
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        try:
            if mutant is not None:
                put_in_place(mutant, module.removesuffix(".py").replace("/", "."))
            for item, following in zip(items, [*items[1:], None], strict=True):
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        finally:
            os._exit(0 if sys.exception() is None else 1)


def main() -> int:
    """Try mutants of modules, print a table and those that were missed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("modules", nargs="*", help="paths of modules; all of the table by default")
    parser.add_argument("--number", type=int, default=25, help="mutants of each module; 0: all")
    parser.add_argument(
        "--integrations",
        action="store_true",
        help="only the ones that freeze or double an integration, all of them",
    )
    parser.add_argument("--seed", type=int, default=1, help="by which they are drawn")
    arguments = parser.parse_args()
    os.chdir(ROOT)
    mutants = {}
    for module in arguments.modules or TESTS:
        every = mutants_of(Path(module).read_text())
        if arguments.integrations:
            mutants[module] = [one for one in every if one.is_integration]
            continue
        number = min(arguments.number or len(every), len(every))
        drawn = random.Random(f"{arguments.seed} {module}").sample(range(len(every)), number)
        mutants[module] = [every[i] for i in sorted(drawn)]
    trials = Trials(mutants)
    files = sorted({str(path) for module in mutants for path in tests_of(module)})
    options = ["-s", "-q", "-m", "not slow", "-p", "no:cacheprovider", "-p", "no:xdist"]
    pytest.main([*options, "--hypothesis-profile=mutants", *files], plugins=[trials])
    if not trials.outcomes:
        return 1
    print()
    for outcome in trials.outcomes:
        print(outcome.row())
    missed = [one for outcome in trials.outcomes for one in outcome.missed]
    tried = sum(outcome.tried for outcome in trials.outcomes)
    print(Outcome(f"all, by seed {arguments.seed}", tried, missed).row())
    return 0


if __name__ == "__main__":
    sys.exit(main())
