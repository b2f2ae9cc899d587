"""What the architecture's table says one has to change to add something is enough.

Each addition is made in a copy of the packages that hold it, and flown there as plain Python.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[5]
LAWS = "ftc_autopilot/control/laws"
FLIGHT = """
from pathlib import Path
from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import scenario_of, scenario_tree
path = Path("scenarios/paper/scenario1.yaml").resolve()
flown = fly_in_process(scenario_of(path, scenario_tree(path) | {tree}))
print(flown.loss, flown.states[-1, 0, 3:6].tolist())
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the model and the autopilot, beside links to all else."""
    for name in ("ftc_autopilot", "sitl_plant"):
        shutil.copytree(ROOT / name, tmp_path / name)
    for name in ("mavlink_defs", "gcs", "scenarios"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def fly(copy: Path, tree: str) -> str:
    """Fly 20 ms of scenario 1 with other keys, and return how it ended."""
    script = FLIGHT.format(tree=f"{{'duration_s': 0.02, {tree}}}")
    env = os.environ | {"PYTHONPATH": str(copy), "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=copy, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def patched(text: str, diff: str) -> str:
    """A text with the added lines of a diff without line numbers behind the lines before them."""
    lines, at = text.splitlines(), 0
    for line in diff.splitlines():
        if line.startswith("+"):
            lines.insert(at, line[1:])
            at += 1
        elif line != "@@":
            at = lines.index(line[1:], at) + 1
    return "\n".join(lines) + "\n"


def test_a_law_is_one_file_and_its_registration(copy: Path) -> None:
    """The law of the tutorial, word for word."""
    page = (ROOT / "docs" / "tutorial" / "law.md").read_text()
    (law,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (diff,) = re.findall(r"```diff\n(.*?)```", page, re.DOTALL)
    (copy / LAWS / "proportional.py").write_text(law)
    registry = copy / LAWS / "__init__.py"
    registry.write_text(patched(registry.read_text(), diff))
    own = fly(copy, "'controller': {'kind': 'proportional', 'attitude_gain': 3.0}")
    assert own.startswith("None")
    assert own != fly(copy, "'controller': {'kind': 'pid'}")


def test_another_aerodynamic_model_is_two_files(copy: Path) -> None:
    """Drag that grows with the square of the lift, by a coefficient of its own."""
    before = fly(copy, "")
    config = copy / "sitl_plant" / "config.py"
    drag = '    cD0: float = quantity("", ge=0.0, doc="Drag.")\n'
    induced = '    cD_induced: float = quantity("", default=0.05, doc="Drag by lift squared.")\n'
    assert drag in config.read_text()
    config.write_text(config.read_text().replace(drag, drag + induced))
    model = copy / "sitl_plant" / "aerodynamics.py"
    force = "    F = scale(qS"
    assert force in model.read_text()
    more = '    C_D = C_D + aircraft["cD_induced"] * C_L * C_L\n'
    model.write_text(model.read_text().replace(force, more + force))
    after = fly(copy, "")
    assert after.startswith("None")
    assert after != before
