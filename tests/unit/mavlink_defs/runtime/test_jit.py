"""The cache of compiled code."""

import os
import re
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
import os
from pathlib import Path
from mavlink_defs.alone import alone
from mavlink_defs.outer import both
from mavlink_defs.runtime.cache_folder import compiled_functions
counted = compiled_functions()
def compiled_now():
    return {(path, path.stat().st_mtime_ns) for path in cache.rglob("*.nbc")}
cache = Path(os.environ["NUMBA_CACHE_DIR"])
before = compiled_now()
alone(3)
value = both(3)
after = compiled_now()
written = {path.name.split("-")[0] for path, _ in after - before}
cached = [path for path, _ in after if path.name.startswith("inner.scaled")]
print(value, len(cached), *(name not in written for name in ("alone.alone", "outer.both")))
print(counted)
"""

CACHE_VARIABLES = ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT")
HOMELESS = """
import pwd
def nobody(_):
    raise KeyError
pwd.getpwuid = nobody
from mavlink_defs.runtime.jit import cold_parts
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.config.models import ConfigError
assert compiled(lambda x: x + 1)(2) == 3
try:
    cold_parts(['plant'])
except ConfigError as problem:
    print(problem)
"""

ALGEBRA = """
from mavlink_defs.runtime.jit import compiled
import numpy as np
@compiled
def product(x, y):
    return x @ y
x = np.array([[1.0, 2.0], [3.0, 5.0]])
print(product(x, x).ravel().tolist())
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of the package with three compiled modules more."""
    package = tmp_path / "mavlink_defs"
    shutil.copytree(ROOT / "mavlink_defs", package, ignore=shutil.ignore_patterns("*.pyc.*"))
    for name, text in MODULES.items():
        (package / name).write_text(text)
    return tmp_path


def run(project: Path) -> list[str]:
    """Value, variants of the inner function in the cache, whether the others came from it.

    The last is how many functions of these sources lay in the cache before.


    Without .pyc: Python takes a file changed within a second, and as long as before, for the same.
    """
    own = {"NUMBA_CACHE_DIR": str(project / "cache"), "NUMBA_DISABLE_JIT": "0"}
    env = os.environ | own | {"PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(
        command, check=False, cwd=project, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_without_a_home_no_folder_is_made(tmp_path: Path) -> None:
    """Neither HOME nor an entry in the list of users: "~" is then not a folder but unknown."""
    env = {name: value for name, value in os.environ.items() if name not in CACHE_VARIABLES}
    command = [sys.executable, "-c", HOMELESS]
    done = subprocess.run(
        command, check=False, cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "there is no home folder; set XDG_CACHE_HOME or NUMBA_CACHE_DIR" in done.stdout
    assert not list(tmp_path.iterdir())


def test_a_change_reaches_callers_and_leaves_the_rest_cached(project: Path, tmp_path: Path) -> None:
    """Equal sources elsewhere share the code; that of old sources does not count."""
    assert run(project) == ["24", "1", "False", "False", "0"]
    cached = [path.read_bytes() for path in (project / "cache").rglob("*.nbc")]
    assert not [code for code in cached if b"--- LINE" in code]  # how lines were typed, as text
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(project / "mavlink_defs", elsewhere / "mavlink_defs")
    (elsewhere / "cache").symlink_to(project / "cache")
    # `scaled` alone is called by compiled code, two by Python
    assert run(elsewhere) == ["24", "1", "True", "True", "3"]
    inner = project / "mavlink_defs" / "inner.py"
    inner.write_text(f'"""It says what it does."""\n\n# and why\n{inner.read_text()}')
    assert run(project) == ["24", "1", "True", "True", "3"]  # in other lines, but the same
    (project / "mavlink_defs" / "constant.py").write_text("FACTOR = 3\n")
    assert run(project) == ["36", "2", "True", "False", "1"]


def test_python_calls_a_function_that_compiled_code_has_called(project: Path) -> None:
    """Compiled code calls a variant that Python cannot: a null pointer if they were mixed up."""
    calls = "from mavlink_defs.inner import scaled\nprint(both(3), scaled(3, 2), scaled(3, 2.0))"
    env = os.environ | {"NUMBA_CACHE_DIR": str(project / "cache"), "NUMBA_DISABLE_JIT": "0"}
    for _ in range(2):  # the second time from the cache
        command = [sys.executable, "-c", RUN + calls]
        done = subprocess.run(command, check=True, cwd=project, env=env, capture_output=True)
        assert done.stdout.split()[-3:] == [b"24", b"18", b"18.0"]


def test_a_function_is_linked_from_the_cache_into_a_changed_caller(project: Path) -> None:
    """Its messages, too, for which it needs the objects of Python that belong to it."""
    inner, outer = (project / "mavlink_defs" / name for name in ("inner.py", "outer.py"))
    inner.write_text(
        inner.read_text().replace("    return", "    print('power', power)\n    return")
    )
    printed = ["power", "1", "power", "2", "24", "1"]
    assert run(project)[:6] == printed
    outer.write_text(outer.read_text().replace("scaled(x, 2)", "scaled(x, 3)"))
    changed = ["power", "1", "power", "3", "60", "1", "True"]
    assert run(project) == [*changed, "False", "2"]
    assert run(project) == [*changed, "True", "3"]


def test_code_for_the_type_of_a_renamed_module_is_compiled_again(project: Path) -> None:
    """The index of a function names the modules of its arguments' types."""
    env = os.environ | {"NUMBA_CACHE_DIR": str(project / "cache"), "NUMBA_DISABLE_JIT": "0"}
    for module in ("pair", "couple"):
        (project / "mavlink_defs" / f"{module}.py").write_text(
            "from typing import NamedTuple\nclass Pair(NamedTuple):\n    left: int\n"
        )
        code = (
            f"from mavlink_defs.{module} import Pair\nfrom mavlink_defs.alone import alone\n"
            "print(alone(Pair(3)).left)"
        )
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, check=True, cwd=project, env=env, capture_output=True)
        assert done.stdout == b"3\n"
        (project / "mavlink_defs" / f"{module}.py").unlink()


def test_a_function_of_a_notebook_stands_in_no_file(tmp_path: Path) -> None:
    code = "from mavlink_defs.runtime.jit import compiled\nprint(compiled(lambda x: x + 1)(2))"
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, check=True, env=env, capture_output=True)
    assert done.stdout == b"3\n"


def test_compiled_code_has_linear_algebra(tmp_path: Path) -> None:
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    script = tmp_path / "algebra.py"
    script.write_text(ALGEBRA)
    command = [sys.executable, str(script)]
    done = subprocess.run(command, check=False, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "[7.0, 12.0, 18.0, 31.0]\n"


def test_numba_is_used_by_its_public_names() -> None:
    """So that a new version of numba is no reason for a new version of this."""
    sources = [path for path in (ROOT / "mavlink_defs").rglob("*.py") if path.name != "dialect.py"]
    users = [path for path in sources if re.search(r"\b(numba|llvmlite)\b", path.read_text())]
    private = re.compile(r"\b(?!self\b|cls\b|os\b)\w+\._[a-z]\w*|sys\.modules")
    assert {path.name for path in users} >= {"ahead_of_time.py", "code_cache.py", "compiler.py"}
    assert {path.name: private.findall(path.read_text()) for path in users} == {
        path.name: [] for path in users
    }


def test_who_asks_what_is_cached_imports_no_compiler(tmp_path: Path) -> None:
    code = """
import sys
from mavlink_defs.runtime.cache_folder import mark_warm
from mavlink_defs.runtime.jit import cold_parts
mark_warm("plant")
print(cold_parts(["plant"]), "numba" in sys.modules)
print(cold_parts(["plant", "relay"]), "numba" in sys.modules)
"""
    env = {key: text for key, text in os.environ.items() if key not in CACHE_VARIABLES}
    env |= {"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, check=False, env=env, capture_output=True, text=True)
    assert done.stdout == "[] False\n['relay'] True\n", done.stderr
