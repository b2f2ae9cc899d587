"""What users of an earlier state have still works: scenario, run folder, campaign, project."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from flying import run

from gcs.scenario.model import load_scenario
from mavlink_defs.config.renamed import RenamedWarning

pytestmark = pytest.mark.sitl

KEPT = Path(__file__).parents[1] / "data" / "kept"
SHORT = ("--in-process", "--no-figures", "--quiet", "--json")


def warned_of(text: str) -> list[str]:
    """The warnings that a command printed: each once, whoever reads the scenario how often."""
    lines = [line for line in text.splitlines() if "warning" in line.lower()]
    assert all(re.fullmatch(r"warning: \w+ is [\w.]+ now; .+", line) for line in lines), lines
    assert len(set(lines)) == len(lines)
    return lines


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    return shutil.copytree(KEPT, tmp_path / "kept")


def test_a_scenario_flies_as_it_flew(kept: Path) -> None:
    """Its keys may have other names now; what they set has not changed."""
    done = run("gcs", "fly", kept / "scenario.yaml", *SHORT, "--out", kept / "now")
    assert done.returncode == 0, done.stderr
    assert len(warned_of(done.stderr)) == 5
    before, now = (json.loads((kept / f / "summary.json").read_text()) for f in ("run", "now"))
    for now_uav, before_uav in zip(now["uavs"], before["uavs"], strict=True):
        assert {key: now_uav[key] for key in before_uav} == before_uav
    with pytest.warns(RenamedWarning):
        flown = load_scenario(kept / "run" / "scenario.yaml")
    assert flown == load_scenario(kept / "now" / "scenario.yaml")


@pytest.mark.parametrize(
    "command",
    [
        ("runs", "list", "."),
        ("runs", "html", "."),
        ("compare", "run", "run"),
        ("export", "run", "--to", "csv"),
        ("fly", "run/scenario.yaml", *SHORT, "--out", "again"),
        ("compare", "campaign", "campaign"),
        ("fly", "--campaign", "campaign", "--row", "1", *SHORT, "--out", "row"),
        ("campaign", "campaign.yaml", "--jobs", "1", "--quiet", "--out", "fresh"),
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_a_command_reads_what_it_wrote(command: tuple[str, ...], kept: Path) -> None:
    done = run("gcs", *command, cwd=kept)
    assert done.returncode == 0, done.stderr
    warned_of(done.stderr)


def test_a_project_flies(kept: Path) -> None:
    project, site = kept / "kept-law", kept / "site"
    described = tomllib.loads((project / "pyproject.toml").read_text())["project"]
    facts = site / "kept_law-0.1.0.dist-info"
    facts.mkdir(parents=True)
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: kept-law\nVersion: 0.1.0\n")
    groups = (
        "\n".join([f"[{group}]", *(f"{name} = {value}" for name, value in points.items())])
        for group, points in described["entry-points"].items()
    )
    (facts / "entry_points.txt").write_text("\n\n".join(groups) + "\n")
    path = os.pathsep.join([str(site), str(project), str(KEPT.parents[2])])
    flights = (
        ("kept_law/first", "--set", "duration_s=0.2"),
        ("kept_law/first", "--set", "duration_s=0.2", "--set", "trigger.mode=every_nth"),
        ("missions/hexagon", "--set", "duration_s=0.2", "--set", "guidance.kind=gentle"),
    )
    for k, flight in enumerate(flights):
        done = subprocess.run(
            [sys.executable, "-m", "gcs", "fly", *flight, *SHORT, "--out", str(kept / str(k))],
            env=os.environ | {"PYTHONPATH": path},
            cwd=kept,
            capture_output=True,
            text=True,
            timeout=500,
            check=False,
        )
        assert done.returncode == 0, done.stderr
