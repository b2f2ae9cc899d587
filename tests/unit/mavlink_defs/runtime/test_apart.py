"""What is compiled apart: made when it is first called, in flight at the latest."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ftc_autopilot.config import parts_of
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.surviving import Surviving
from gcs.fleet import warm_up
from gcs.fleet.precompile import PARTS
from gcs.scenario.model import load_scenario

CODE = """
import signal, sys, time
from typing import NamedTuple
import numpy as np
from mavlink_defs.runtime import parts as apart_module
from mavlink_defs.runtime.jit import apart, load
from mavlink_defs.runtime.jit import compiled

INNER = np.dtype([("gain", "f8"), ("row", "f8", (3,))])
OUTER = np.dtype([("count", "i8"), ("inner", INNER), ("many", INNER, (2,))])

class Held(NamedTuple):
    many: np.ndarray

class Pair(NamedTuple):
    first: float
    both: tuple[float, float]
    number: int

made = []

def noted(part, _resolve=apart_module.Part.resolve):
    made.append(part._function.__name__)
    _resolve(part)

apart_module.Part.resolve = noted

@apart(inner=INNER, many=np.zeros(1, INNER))
def scaled(pair: Pair, inner: np.void, many: np.ndarray, flag: bool, n: int) -> Pair:
    inner["row"][1] = pair.both[1]
    total = inner["gain"] * pair.first * n
    for k in range(len(many)):
        total += many[k]["gain"]
    return Pair(total if flag else 0.0, (pair.both[1], pair.both[0]), pair.number + n)

@apart(held=Held(np.zeros(1, INNER)))
def summed(held: Held) -> float:
    return held.many[0]["gain"] + held.many[1]["gain"]

@apart(inner=INNER)
def unused(inner: np.void) -> None:
    inner["gain"] = 7.0

@compiled
def outer(record: np.void, rows: np.ndarray, which: int) -> float:
    if which == 3:
        unused(record["inner"])
    pair = Pair(2.0, (3.0, 5.0), record["count"])
    once = scaled(pair, record["inner"], record["many"], True, 2)
    twice = scaled(once, record["inner"], rows, flag=which > 0, n=3)
    return twice.first + twice.both[0] + twice.number + summed(Held(record["many"]))

LONGER = np.dtype([("own", "f8"), *((name, INNER[name]) for name in INNER.names)])

@compiled
def of_another(record: np.void, rows: np.ndarray) -> float:
    return scaled(Pair(2.0, (3.0, 5.0), 1), record, rows, True, 2).first
"""
CALLS = """
record, rows = np.zeros(1, OUTER)[0], np.zeros(3, INNER)
record["count"], record["inner"]["gain"], record["many"]["gain"], rows["gain"] = 1, 1.5, 0.25, 4.0
print(outer(record, rows, 1), record["inner"]["row"].tolist(), *dict.fromkeys(made))
"""
EXPECTED = f"{3.0 * 1.5 * 6.5 + 12.0 + 3.0 + 6.0 + 0.5} [0.0, 3.0, 0.0] scaled summed"


def run(folder: Path, code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    file = folder / "parts.py"
    if not file.exists():
        file.write_text(CODE)
    given = {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": ":".join(["", *sys.path])}
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(folder)!r})\n{code}"]
    return subprocess.run(
        command, env=given | environment, cwd=folder, capture_output=True, text=True, check=False
    )


def test_what_is_called_is_made_and_cached_and_what_is_not_is_not(tmp_path: Path) -> None:
    cached = "[*__import__('pathlib').Path('cache').rglob('*.nbc')]"
    for _ in range(2):  # by the compiler, then from the cache
        done = run(tmp_path, f"from parts import *\n{CALLS}\nprint(len({cached}))")
        assert done.stdout.splitlines() == [EXPECTED, "3"], done.stderr


def test_a_record_of_another_that_has_more_is_compiled_with_its_caller(tmp_path: Path) -> None:
    code = """
from parts import *
record, rows = np.zeros(1, LONGER)[0], np.zeros(3, INNER)
record["gain"] = 1.5
print(of_another(record, rows), *made)
"""
    for _ in range(2):
        assert run(tmp_path, code).stdout.strip() == "6.0"


def test_plain_python_calls_it_too(tmp_path: Path) -> None:
    done = run(tmp_path, f"from parts import *\n{CALLS}", NUMBA_DISABLE_JIT="1")
    assert done.stdout.strip() == EXPECTED.removesuffix(" scaled summed"), done.stderr


def test_ctrl_c_while_it_is_made_in_flight_is_kept_for_later(tmp_path: Path) -> None:
    code = f"""
from parts import *
from parts import noted
def interrupted(part):
    if not part._address.value and made == []:
        made.append("interrupted")
        raise KeyboardInterrupt
    noted(part)
apart_module.Part.resolve = interrupted
try:
    {CALLS.strip().replace(chr(10), chr(10) + "    ")}
    time.sleep(30.0)
except KeyboardInterrupt:
    print("afterwards")
"""
    done = run(tmp_path, code)
    assert done.stdout.splitlines() == [
        EXPECTED.replace("scaled", "interrupted scaled"),
        "afterwards",
    ], done.stderr


def test_what_cannot_be_made_in_flight_ends_the_process_with_its_error(tmp_path: Path) -> None:
    code = f"""
from parts import *
def failing(part):
    raise OSError("no more files")
apart_module.Part.resolve = failing
{CALLS}
"""
    done = run(tmp_path, code)
    assert done.returncode == 1
    assert not done.stdout
    assert "no more files" in done.stderr


FLIGHTS = {
    '"paper/scenario1"': "proposed",
    '"paper/scenario1", ["tube"]': "tube",
    '"paper/scenario1", ["estimated"]': "proposed",
    '"missions/ten", ["turbulent"]': "surviving",
}
FLIGHT = """
from mavlink_defs.runtime import parts as apart
late = []
def in_flight(part, _resolve=apart.Part._resolve_in_flight):
    late.append(part._function.__name__)
    _resolve(part)
apart.Part._resolve_in_flight = in_flight
from gcs.fleet.in_process import fly_in_process
from gcs.fleet import warm_up
from gcs.fleet.precompile import PARTS
from gcs.scenario.model import load_scenario
from gcs.fleet.warm_up import parts_of
from gcs.scenario.changes import with_changes
scenario = with_changes({}).model_copy(update={{"duration_s": 0.1}})
parts = parts_of(scenario, in_process=True)
for part in parts:
    PARTS[part]()
fly_in_process(scenario)
print(late, *(part for part in parts if part.startswith("law")))
"""


@pytest.mark.slow
@pytest.mark.parametrize("flight", FLIGHTS)
def test_a_flight_makes_nothing_that_was_not_ready(flight: str) -> None:
    command = [sys.executable, "-c", FLIGHT.format(flight)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1:] == [f"[] law {FLIGHTS[flight]}"], done.stderr


def test_a_law_that_extends_ours_needs_ours() -> None:
    class Mine(Surviving):
        """One of another project."""

    parts = parts_of(Mine(), "true_state", on_path=False)
    assert parts == ["controller", "law surviving"]


def test_every_law_is_a_part() -> None:
    """A law that is found nowhere would be compiled in flight."""
    for kind in LAWS:
        part: Any = PARTS[f"law {kind}"]
        assert [one.__name__ for one in part.args] == [f"{kind}_law"]


def test_a_standing_fleet_waits_for_what_stations_may_give_it_and_for_no_other_law() -> None:
    parts = warm_up.parts_of(load_scenario("paper/scenario1"), in_process=False, standing=True)
    assert {"guidance", "signing", "law proposed"} <= set(parts)
    assert not {"law surviving", "law tube", "estimator", "in process"} & set(parts)
