"""Whatever lies in the folder that a command is started from, the installed packages fly."""

from pathlib import Path

import pytest
from flying import environment, run, summary_of, write_scenario

pytestmark = pytest.mark.sitl


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with packages of our names, and of what we import, as clones and scripts have."""
    for name in ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "numpy"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise ImportError('not the installed one')")
    (tmp_path / "yaml.py").write_text("raise ImportError('not the installed one')")
    return tmp_path


@pytest.mark.parametrize("how", ["--in-process", "--free-ports"])
def test_a_flight(folder: Path, how: str) -> None:
    scenario = write_scenario(folder, duration_s=0.05)
    options = ("--quiet", how, "--out", "run")
    done = run("gcs", "fly", scenario, *options, cwd=folder, env=environment())
    assert done.returncode == 0, done.stderr
    assert summary_of(folder / "run")["completed"] is True


def test_a_sweep(folder: Path) -> None:
    scenario = write_scenario(folder, duration_s=0.05)
    values = ("--set", "trigger.b1=0.01,0.02", "--jobs", "2")
    done = run("gcs", "sweep", scenario, *values, "--quiet", "--out", "run", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "run" / "table.csv").exists()
