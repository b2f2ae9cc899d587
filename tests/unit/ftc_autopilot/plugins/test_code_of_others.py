"""Code of others that exits, forks or raises what is no Exception: one line names it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from own_laws import PLAIN

from gcs.console.errors import BadInput, python_errors
from gcs.fleet.in_process import fly_and_summarise
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.runtime.foreign import ForeignCode

RAISED = {
    "import sys; sys.exit(0)": "SystemExit",
    "raise GeneratorExit": "GeneratorExit",
    "raise type('Own', (BaseException,), {})('gone')": "Own: gone",
    "raise type('Own', (KeyboardInterrupt,), {})": "Own",
    "raise StopIteration": "StopIteration",
    "raise ZeroDivisionError('zero')": "ZeroDivisionError: zero",
}
METHODS = {
    "derive": "self, aircraft, record",
    "misfits": "self, aircraft",
    "with_servos": "self, servos",
    "record": "cls",
    "model_post_init": "self, context",
}


def flown(folder: Path, law: str) -> None:
    (folder / "mine.py").write_text(law)
    with python_errors():
        tree = scenario_tree("paper/scenario1") | {"duration_s": 0.01, "faults": []}
        scenario = scenario_of(folder / "s.yaml", tree | {"controller": {"kind": "mine.py:Mine"}})
        assert isinstance(scenario, Scenario)
        summary = fly_and_summarise(scenario)
        if summary.loss is not None:
            raise BadInput(summary.loss)


@pytest.mark.parametrize("statement", RAISED)
def test_what_an_import_raises_is_named(tmp_path: Path, statement: str) -> None:
    with pytest.raises(BadInput) as caught:
        flown(tmp_path, f"\n{statement}\n")
    text = str(caught.value)
    assert f"{tmp_path}/mine.py:2: {RAISED[statement]}" in text
    assert text.endswith("raised when it was imported")
    assert "\n" not in text


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("statement", [*RAISED][:3])
def test_what_a_method_raises_is_named(tmp_path: Path, statement: str, method: str) -> None:
    decorator = "    @classmethod\n" if method == "record" else ""
    body = f"{decorator}    def {method}({METHODS[method]}):\n        {statement}\n"
    with pytest.raises(BadInput, match=rf"mine.py:\d+: {RAISED[statement]}"):
        flown(tmp_path, f"{PLAIN}\n{body}")


@pytest.mark.parametrize("statement", [*RAISED][:3])
def test_what_a_step_raises_is_named(tmp_path: Path, statement: str) -> None:
    law = PLAIN.replace("        return law(", f"        {statement}\n        return law(")
    with pytest.raises(BadInput, match=rf"law mine.py:Mine failed .*: {RAISED[statement]}"):
        flown(tmp_path, law)


def test_ctrl_c_passes() -> None:
    with pytest.raises(KeyboardInterrupt), ForeignCode(lambda _: ValueError()):
        raise KeyboardInterrupt


FORKING = {
    "import": "import os\nos.fork()\n",
    "step": PLAIN.replace("return law(", "__import__('os').fork(); return law("),
}


@pytest.mark.parametrize("place", FORKING)
def test_a_child_of_a_plug_in_runs_nothing_of_ours(tmp_path: Path, place: str) -> None:
    """Its parent alone prints; a fork at import is refused by name."""
    (tmp_path / "mine.py").write_text(FORKING[place])
    program = (
        "import os, sys\n"
        "sys.path[:0] = sys.argv[1:3]\n"
        "from pathlib import Path\n"
        "from test_code_of_others import flown\n"
        "folder = Path(sys.argv[3])\n"
        "try:\n"
        "    flown(folder, (folder / 'mine.py').read_text())\n"
        "except Exception as problem:\n"
        "    print(problem)\n"
        "print('end', flush=True)\n"
    )
    here = Path(__file__)
    folders = (here.parent, here.parents[3] / "helpers", tmp_path)
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program, *map(str, folders)],
        capture_output=True,
        text=True,
        timeout=600,
        check=True,
        env=os.environ | {"PYTHONPATH": str(here.parents[4])},
    )
    assert done.stdout.count("end\n") == 1
    refused = "mine.py: OSError: it forks" in done.stdout
    assert refused == (place == "import"), done.stdout
