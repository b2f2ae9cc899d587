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
import importlib
import inspect
import os
import random
import signal
import sys
import time
from pathlib import Path
from typing import NamedTuple

import pytest
from mutations import Mutant, mutants_of

ROOT = Path(__file__).parents[1]
UNIT = ROOT / "tests" / "unit"
_C, _P = "ftc_autopilot/control", "sitl_plant"
_CONTROL = tuple(
    f"{_C}/{name}"
    for name in ("test_vectors_controller", "test_successive_steps", "laws/test_courses")
)
_PLANT = tuple(
    f"{_P}/{name}"
    for name in ("test_vectors_plant", "test_successive_steps", "loop/test_period", "test_courses")
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
    f"{_C}/diagnosis/suspicions.py": _DIAGNOSIS,
    f"{_C}/diagnosis/diagnose.py": (f"{_C}/diagnosis/test_measurement", *_DIAGNOSIS),
    f"{_C}/diagnosis/excitation.py": (f"{_C}/diagnosis/test_excitation", *_DIAGNOSIS),
    f"{_P}/airframe/aerodynamics.py": (*_PLANT, f"{_P}/airframe/test_aerodynamics"),
    f"{_P}/airframe/rigid_body.py": (*_PLANT, f"{_P}/airframe/test_rigid_body"),
    f"{_P}/actuators/servo.py": (*_PLANT, f"{_P}/actuators/test_servo"),
    f"{_P}/actuators/faults.py": (*_PLANT, f"{_P}/actuators/test_faults"),
    f"{_P}/actuators/lag.py": (*_PLANT, f"{_P}/actuators/test_servo"),
    f"{_P}/air/wind.py": (*_PLANT, f"{_P}/air/test_wind"),
    f"{_P}/air/turbulence.py": (*_PLANT, f"{_P}/air/test_turbulence"),
    f"{_P}/loop/period.py": (*_PLANT, f"{_P}/airframe/test_rigid_body"),
    f"{_P}/sensing/true_state.py": (*_PLANT, f"{_P}/sensing/test_true_state"),
    f"{_P}/air/disturbance.py": _PLANT,
    f"{_P}/vec3.py": _PLANT,
    f"{_P}/air/gaussian.py": (f"{_P}/air/test_gaussian",),
}
"""Modules with equations, and the tests of each under tests/unit."""
MAX_TEST_S = 3
"""Tests that take longer as plain Python, or do not pass as such, are left out."""
FLIGHT = "fly_in_process"
"""So are tests that call this."""


def tests_of(module: str) -> set[Path]:
    """Return the files of the tests of a module."""
    return {UNIT / f"{name}.py" for name in TESTS[module]}


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
            status = self._status_of([item], MAX_TEST_S)
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
    if os.environ.get("NUMBA_DISABLE_JIT") != "1":
        parser.error("compiled code would not notice a change: set NUMBA_DISABLE_JIT=1")
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
