"""The cache of compiled code, and what may be called from Python."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]
MODULES = {
    "constant.py": "FACTOR = 2\n",
    "inner.py": (
        "from mavlink_defs.runtime.jit import compiled\n"
        "from mavlink_defs.constant import FACTOR\n"
        "@compiled\n"
        "def scaled(x, power):\n"
        "    return FACTOR * x**power\n"
    ),
    "outer.py": (
        "from mavlink_defs import inner\n"
        "from mavlink_defs.runtime.jit import compiled\n"
        "@compiled\n"
        "def both(x):\n"
        "    return inner.scaled(x, 1) + inner.scaled(x, 2)\n"
    ),
    "alone.py": (
        "from mavlink_defs.runtime.jit import compiled\n@compiled\ndef alone(x):\n    return x\n"
    ),
}
RUN = """
from mavlink_defs.alone import alone
from mavlink_defs.inner import scaled
from mavlink_defs.outer import both
alone(3)
value = both(3)
from_cache = [not f.stats.cache_misses for f in (alone, both)]
print(value, len(scaled.signatures), *from_cache)
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of the package with three compiled modules more."""
    package = tmp_path / "mavlink_defs"
    shutil.copytree(ROOT / "mavlink_defs", package, ignore=shutil.ignore_patterns("__pycache__"))
    for name, text in MODULES.items():
        (package / name).write_text(text)
    return tmp_path


def run(project: Path) -> list[str]:
    """Value, specialisations of the inner function, and whether each came from the cache."""
    env = os.environ | {"NUMBA_CACHE_DIR": str(project / "cache"), "NUMBA_DISABLE_JIT": "0"}
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(
        command, check=False, cwd=project, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_change_reaches_callers_and_leaves_the_rest_cached(project: Path) -> None:
    assert run(project) == ["24", "1", "False", "False"]
    assert run(project)[0::2] == ["24", "True"]
    (project / "mavlink_defs" / "constant.py").write_text("FACTOR = 3\n")
    assert run(project) == ["36", "1", "True", "False"]


def test_python_calls_no_compiled_function_that_has_no_wrapper() -> None:
    """It would end the process."""
    trees = {path: ast.parse(path.read_text()) for path in sources()}
    unwrapped = {
        f"{'.'.join(path.relative_to(ROOT).with_suffix('').parts)}.{name}"
        for path, tree in trees.items()
        for name in compiled_functions(tree)
        if name.startswith("_")
    }
    assert len(unwrapped) > 50
    calls = [
        f"{path.relative_to(ROOT)} calls {name}"
        for path, tree in trees.items()
        for name in names_called_by_python(path, tree)
        if name in unwrapped
    ]
    assert not calls


def sources() -> list[Path]:
    folders = (
        "mavlink_defs",
        "sitl_plant",
        "ftc_autopilot",
        "gcs",
        "benchmarks",
        "fuzzing",
        "tests",
    )
    generated = ROOT / "mavlink_defs" / "dialect.py"
    return [path for f in folders for path in (ROOT / f).rglob("*.py") if path != generated]


def compiled_functions(tree: ast.Module) -> dict[str, ast.FunctionDef]:
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return {f.name: f for f in functions if "compiled" in map(ast.unparse, f.decorator_list)}


def names_called_by_python(path: Path, tree: ast.Module) -> set[str]:
    """Dotted names of what a file calls outside its compiled functions."""
    meaning = dict.fromkeys(compiled_functions(tree), "")
    here = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    meaning = {name: f"{here}.{name}" for name in meaning}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            for name in node.names:
                meaning[name.asname or name.name] = f"{node.module}.{name.name}"
    inside = {
        id(node) for f in compiled_functions(tree).values() for node in ast.walk(f) if node is not f
    }
    called = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and id(node) not in inside:
            first, _, rest = ast.unparse(node.func).partition(".")
            called.add(f"{meaning.get(first, first)}.{rest}".rstrip("."))
    return called
