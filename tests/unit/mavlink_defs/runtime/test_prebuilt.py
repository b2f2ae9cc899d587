"""Machine code that was made before: what is taken from it, and what never reaches it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mavlink_defs.runtime.ahead_of_time import headers_beside
from mavlink_defs.runtime.prebuilt import kinds_of

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[4]
SHAPES = """
import numpy as np
from mavlink_defs.runtime.jit import compiled
PAIR = np.dtype([("a", "f8"), ("b", "i4", (3,))])
@compiled
def scaled(x, factor=2):
    return factor * x
@compiled
def total(values):
    sum_ = 0.0
    for k in range(len(values)):
        sum_ += values[k]
    return sum_
@compiled
def first(row):
    return row["a"] + row["b"][2]
@compiled
def swapped(pair):
    return pair[1][0], pair[0]
@compiled
def ratio(a, b):
    return a / b
"""
CALLS = """
import numpy as np
from mavlink_defs.shapes import PAIR, first, ratio, scaled, swapped, total
pairs = np.ones(2, PAIR)
def right():
    return [
        scaled(3), scaled(1.5), scaled(3, factor=3), total(np.ones(3)), total(np.ones(6)[::2]),
        first(pairs[1]), swapped((1, (2.0, 3))), ratio(1.0, 0.0),
    ]
"""
MAKE = """
import sys
from pathlib import Path
from mavlink_defs.runtime.ahead_of_time import Calls
calls = Calls()
with calls.listening():
    right()
print(calls.build(Path(sys.argv[1])))
"""
WITHOUT = "import sys\nsys.modules['numba'] = sys.modules['llvmlite'] = None\n"
WRONG = """
from mavlink_defs.runtime.jit import CompilerMissing
other = np.zeros(1, [("a", "f8"), ("b", "i4", (2,))])
read_only = np.zeros(2)
read_only.flags.writeable = False
values = [
    None, True, 1, 1.0, 1j, "text", b"bytes", [1.0], {}, object(), np.float32(1.0), np.int32(1),
    (), (1,), (1, 2), (1, (2, 3)), (1.0, (2.0, 3)), (1, (2.0, 3), 4), ((1, 2), 3),
    np.zeros(2, "f4"), np.zeros(2, "i8"), np.zeros((2, 2)), np.zeros(2, PAIR), np.zeros(()),
    np.asfortranarray(np.zeros((2, 2))), read_only, np.zeros(2, ">f8"), other, other[0],
    np.zeros(1, [("a", "f4"), ("b", "i4", (3,))])[0], np.datetime64(0, "s"), np.zeros(2, object),
]
given = refused = 0
for function in (scaled, total, first, swapped, ratio):
    for value in values:
        for arguments in ((value,), (value, value), (value, 1.0), (1.0, value)):
            try:
                function(*arguments)
            except (CompilerMissing, TypeError):
                refused += 1
            else:
                given += 1
print(given, refused)
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package with a compiled module more, and machine code of that."""
    folder = tmp_path_factory.mktemp("project")
    ignored = shutil.ignore_patterns("*.pyc.*", "machine_code*")
    shutil.copytree(ROOT / "mavlink_defs", folder / "mavlink_defs", ignore=ignored)
    (folder / "mavlink_defs" / "shapes.py").write_text(SHAPES)
    done = run(folder, CALLS + MAKE, str(folder / "mavlink_defs" / "runtime"))
    assert done.returncode == 0, done.stderr
    return folder


def run(project: Path, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join([str(project), os.environ.get("PYTHONPATH", "")])  # another numba's
    own = {"NUMBA_CACHE_DIR": str(project / "cache"), "NUMBA_DISABLE_JIT": "0"}
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=project,
        env=os.environ | own | {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )


def test_it_is_called_where_no_compiler_is(project: Path) -> None:
    done = run(project, f"{WITHOUT}{CALLS}print(right())\n")
    assert done.stdout == "[6, 3.0, 9, 3.0, 3.0, 2.0, (2.0, 1), inf]\n", done.stderr


def test_other_arguments_never_reach_it(project: Path) -> None:
    """Each process would end by a signal where one of them did."""
    done = run(project, WITHOUT + CALLS + WRONG)
    assert done.returncode == 0, (done.returncode, done.stderr)
    given, refused = map(int, done.stdout.split())
    assert refused > 500
    assert 0 < given < 20  # such as two numbers for `ratio`


def test_other_arguments_are_compiled_where_a_compiler_is(project: Path) -> None:
    done = run(project, f"{CALLS}print(right()[0], scaled(np.float32(1.5)))\n")
    assert done.stdout == "6 3.0\n", done.stderr


def test_an_edited_source_is_compiled_again(project: Path) -> None:
    source = project / "mavlink_defs" / "shapes.py"
    source.write_text(SHAPES.replace("factor * x", "factor * x + 1"))
    try:
        assert run(project, f"{CALLS}print(scaled(3))\n").stdout == "7\n"
        done = run(project, f"{WITHOUT}{CALLS}scaled(3)\n")
    finally:
        source.write_text(SHAPES)
    message = done.stderr.splitlines()[-1]
    assert str(source) in message
    assert "was changed since its machine code was made" in message
    assert "the compiler numba is not installed: pip install" in message


def test_without_the_compiler_plain_python_runs_as_ever(project: Path) -> None:
    plain = "import os\nos.environ['NUMBA_DISABLE_JIT'] = '1'\n"
    done = run(project, f"{plain}{WITHOUT}{CALLS}print(scaled(3), scaled('a'))\n")
    assert done.stdout == "6 aa\n", done.stderr


def test_kinds_say_what_compiled_code_takes_for_granted() -> None:
    record = np.zeros(2, [("a", "f8"), ("b", "i4")])
    values = [
        *(1, 1.0, True, None, "1", np.float32(1.0), np.int8(1)),
        *((), (1,), (1.0,), (1, 1), ((1,),)),
        *(np.zeros(3), np.zeros(3, "f4"), np.zeros((3, 3)), np.zeros((3, 3)).T, np.zeros(6)[::2]),
        *(record, record[0], np.zeros(2, [("a", "f8"), ("c", "i4")])),
        np.zeros(2, np.dtype([("a", "f8"), ("b", "i4")], align=True)),
    ]
    kinds = [kinds_of((value,)) for value in values]
    assert len(set(kinds)) == len(kinds)
    assert kinds_of((1, 1.0)) == kinds_of((np.int64(2), np.float64(3.0)))


def test_headers_of_a_platform_are_found_without_those_of_its_c_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of Debian's Python, whose pyconfig.h includes <x86_64-linux-gnu/python3.13/pyconfig.h>."""
    for folder, found in (("linux", ["linux"]), ("no-such-platform", []), (None, [])):
        monkeypatch.setattr("sysconfig.get_config_var", {"MULTIARCH": folder}.get)
        scratch = tmp_path / str(folder)
        scratch.mkdir()
        headers = headers_beside(scratch)
        assert [path.name for path in headers.iterdir()] == found
        for name in found:
            assert (headers / name / "types.h").is_file()
