"""The worked example of docs/tutorial/law.md, done as it says, in a copy of the project."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs" / "tutorial" / "law.md").read_text()


def block(language: str) -> str:
    [text] = re.findall(rf"```{language}\n(.*?)```", DOCUMENT, re.DOTALL)
    return str(text)


def apply(diff: str, text: str) -> str:
    """Insert the added lines of each hunk behind the line before them."""
    for hunk in diff.split("@@\n"):
        lines = hunk.splitlines()
        before = next(line[1:] for line in lines if line.startswith(" "))
        added = [line[1:] for line in lines if line.startswith("+")]
        assert text.count(f"{before}\n") == 1, before
        text = text.replace(f"{before}\n", "\n".join([before, *added]) + "\n")
    return text


@pytest.mark.sitl
def test_a_law_is_one_file_and_one_registration(tmp_path: Path) -> None:
    for package in ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "scenarios"):
        shutil.copytree(ROOT / package, tmp_path / package)
    laws = tmp_path / "ftc_autopilot" / "control" / "laws"
    (laws / "proportional.py").write_text(block("python"))
    registry = laws / "__init__.py"
    registry.write_text(apply(block("diff"), registry.read_text()))
    scenario = tmp_path / "my.yaml"
    scenario.write_text(block("yaml") + "duration_s: 0.8\nfaults: []\n")

    run = "from gcs.cli import main; main()"
    arguments = ["fly", str(scenario), "--in-process", "--json", "--out", str(tmp_path / "run")]
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", run, *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        cwd=tmp_path,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["completed"]
    events = summary["uavs"][0]["channels"]["elevator"]["events"]
    assert 1 < events < 100  # the law moves the elevator, and the trigger holds it in between
