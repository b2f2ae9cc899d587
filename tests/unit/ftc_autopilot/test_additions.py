"""What the architecture's table says one has to change to add something is enough.

Each addition is made in a copy of the packages that hold it, and flown there as plain Python.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
LAWS = "ftc_autopilot/control/laws"
FLIGHT = """
from pathlib import Path
from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import scenario_of, scenario_tree
path = Path("scenarios/{scenario}.yaml").resolve()
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


def fly(copy: Path, tree: str, scenario: str = "paper/scenario1") -> str:
    """Fly 20 ms of a scenario with other keys, and return how it ended."""
    script = FLIGHT.format(tree=f"{{'duration_s': 0.02, {tree}}}", scenario=scenario)
    env = os.environ | {"PYTHONPATH": str(copy), "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=copy, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


LAW = """
from typing import Literal

import numpy as np

from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command, Step
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled


class Proportional(LawParameters):
    kind: Literal["proportional"] = "proportional"
    attitude_gain: float = quantity("", gt=0.0, default=2.0, doc="Deflection per error.")


@compiled
def proportional_law(now: Step, gains: np.void) -> Command:
    e, omega, k = now.errors.e, now.motion.omega, gains["attitude_gain"]
    delta = (k * e[0] + 0.5 * omega[0], k * e[1] + 0.5 * omega[1], k * e[2] + 0.5 * omega[2])
    return Command(delta, 900.0 - 300.0 * now.errors.V_tilde, ALL)
"""


def test_a_law_of_ours_is_one_file_and_its_registration(copy: Path) -> None:
    (copy / LAWS / "proportional.py").write_text(LAW)
    replaced(
        copy / LAWS / "__init__.py",
        (
            "from ftc_autopilot.control.laws.proposed import",
            "from ftc_autopilot.control.laws.proportional import Proportional, proportional_law\n"
            "from ftc_autopilot.control.laws.proposed import",
        ),
        (
            '    | Annotated[Tube, Tag("tube")]',
            '    | Annotated[Proportional, Tag("proportional")]\n'
            '    | Annotated[Tube, Tag("tube")]',
        ),
        (
            "    if law == _PID:",
            '    if law == KINDS.index("proportional"):\n'
            '        return proportional_law(now, parameters["proportional"])\n'
            "    if law == _PID:",
        ),
    )
    own = fly(copy, "'controller': {'kind': 'proportional', 'attitude_gain': 3.0}")
    assert own.startswith("None")
    assert own != fly(copy, "'controller': {'kind': 'pid'}")


def test_another_aerodynamic_model_is_two_files(copy: Path) -> None:
    """Drag that grows with the square of the lift, by a coefficient of its own."""
    before = fly(copy, "")
    config = copy / "sitl_plant" / "airframe" / "config.py"
    drag = '    cD0: float = quantity("", ge=0.0)\n'
    induced = '    cD_induced: float = quantity("", "Drag by lift squared.", 0.05)\n'
    assert drag in config.read_text()
    config.write_text(config.read_text().replace(drag, drag + induced))
    model = copy / "sitl_plant" / "airframe" / "aerodynamics.py"
    force = "    F = scale(qS"
    assert force in model.read_text()
    more = '    C_D = C_D + aircraft["cD_induced"] * C_L * C_L\n'
    model.write_text(model.read_text().replace(force, more + force))
    after = fly(copy, "")
    assert after.startswith("None")
    assert after != before


def replaced(path: Path, *changes: tuple[str, str]) -> None:
    """Replace texts of a file that must be there."""
    text = path.read_text()
    for before, after in changes:
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    path.write_text(text)


TRIGGER = """
from typing import ClassVar, Literal

import numpy as np

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from mavlink_defs.config.quantity import whole
from mavlink_defs.runtime.jit import compiled


class EveryNth(TriggerParameters):
    STATE: ClassVar[np.dtype] = np.dtype([("steps", "i8")])
    mode: Literal["every_nth"] = "every_nth"
    nth: int = whole("", ge=1, default=7, doc="Steps between two messages.")


@compiled
def every_nth(now: Candidates, parameters: np.void, state: np.void) -> int:
    state["steps"] += 1
    return 15 if state["steps"] % parameters["nth"] == 1 else 0
"""


def test_a_trigger_is_one_file_and_its_registration(copy: Path) -> None:
    triggers = copy / "ftc_autopilot" / "control" / "triggers"
    (triggers / "every_nth.py").write_text(TRIGGER)
    replaced(
        triggers / "__init__.py",
        (
            "from ftc_autopilot.control.triggers.periodic import",
            "from ftc_autopilot.control.triggers.every_nth import EveryNth, every_nth\n"
            "from ftc_autopilot.control.triggers.periodic import",
        ),
        (
            "    Discriminator(_mode),",
            "    Discriminator(_mode),",
        ),
        (
            '    | Annotated[Scaled, Tag("scaled")]',
            '    | Annotated[EveryNth, Tag("every_nth")]\n    | Annotated[Scaled, Tag("scaled")]',
        ),
        (
            "    return static.per_channel(now)",
            '    if mode == MODES.index("every_nth"):\n'
            '        return every_nth(now, parameters["every_nth"], states["every_nth"])\n'
            "    return static.per_channel(now)",
        ),
    )
    often, seldom = (fly(copy, f"'trigger': {{'mode': 'every_nth', 'nth': {n}}}") for n in (3, 10))
    assert often.startswith("None")
    assert often != seldom


GUIDANCE = """
from typing import Literal

from ftc_autopilot.guidance.laws.path_following import PathFollowing, path_law
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled


class Gentle(PathFollowing):
    kind: Literal["gentle"] = "gentle"
    faster_m_s: float = quantity("m/s", default=5.0, doc="Added to the airspeed.")


@compiled
def gentle_law(now, path, aircraft, limits, gains, state):
    airspeed, roll, pitch, yaw = path_law(now, path, aircraft, limits, gains, state)
    return airspeed + gains["faster_m_s"], roll, pitch, yaw
"""


def test_a_guidance_law_is_one_file_and_its_registration(copy: Path) -> None:
    laws = copy / "ftc_autopilot" / "guidance" / "laws"
    (laws / "gentle.py").write_text(GUIDANCE)
    replaced(
        laws / "__init__.py",
        (
            "from ftc_autopilot.guidance.laws.path_following import (",
            "from ftc_autopilot.guidance.laws.gentle import Gentle, gentle_law\n"
            "from ftc_autopilot.guidance.laws.path_following import (",
        ),
        (
            '    Annotated[PathFollowing, Tag("path")]',
            '    Annotated[PathFollowing, Tag("path")] | Annotated[Gentle, Tag("gentle")]',
        ),
        ('{"path": PathFollowing}', '{"path": PathFollowing, "gentle": Gentle}'),
        (
            '    limits = parameters["common"]\n',
            '    limits = parameters["common"]\n'
            '    if parameters["law"] == KINDS.index("gentle"):\n'
            '        own, memory = parameters["gentle"], state["gentle"]\n'
            "        return gentle_law(now, path, aircraft, limits, own, memory)\n",
        ),
    )
    flights = {
        own: fly(copy, f"'duration_s': 0.1, 'guidance': {{{own}}}", "missions/race_track")
        for own in ("'kind': 'gentle'", "'kind': 'gentle', 'faster_m_s': 0.0", "'kind': 'path'")
    }
    gentle, same, path = flights.values()
    assert path.startswith("None")
    assert same == path != gentle
