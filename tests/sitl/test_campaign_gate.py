"""The nightly job of docs/how-to/campaigns-in-ci.md as it stands there, and an early end."""

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from campaign_flights import write_campaign
from flying import environment, run

from ftc_lab.campaigns.store import read_results

pytestmark = [pytest.mark.sitl, pytest.mark.slow]

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "campaigns-in-ci.md"
DRAWS = 7  # instead of 59: seven pairs can show "worse" at 99 %, since 2⁻⁷ < 1 %
CHANGE = "proposed: {controller: {reference_bandwidth_rad_s: 2.0}}"
"""A law that was changed for the worse in each draw: its reference filter is slower."""


def block(kind: str) -> str:
    [text] = re.findall(rf"```{kind}\n(.*?)```", PAGE.read_text(), re.DOTALL)
    return str(text)


def night(folder: Path, campaign: str) -> "subprocess.CompletedProcess[str]":
    """Run the job; its last commands are the gate and the change of the reference."""
    (folder / "nightly.yaml").write_text(campaign)
    return subprocess.run(
        ["sh", "nightly.sh"],
        cwd=folder,
        env=os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        timeout=600.0,
        check=False,
    )


def test_the_documented_nightly_job(tmp_path: Path) -> None:
    campaign, shorter = re.subn(r"draws: \d+", f"draws: {DRAWS}", block("yaml"))
    assert shorter == 1
    (tmp_path / "nightly.sh").write_text(block("sh"))
    first = night(tmp_path, campaign)
    assert first.returncode == 0, first.stderr
    assert (tmp_path / "runs/last-good/report.html").exists()

    reference = (tmp_path / "runs/last-good/request.yaml").read_bytes()
    worse = night(tmp_path, campaign.replace("proposed: {}", CHANGE))
    assert worse.returncode == 1, worse.stdout + worse.stderr
    assert "FAILED  proposed: worse iae_roll at 99 %" in worse.stdout
    assert f"the same {DRAWS} draws" in worse.stdout
    [suite] = ET.parse(tmp_path / "gate.xml").getroot()
    assert [case.find("failure") is None for case in suite.iter("testcase")] == [True, False, True]
    assert "**1 of 3 checks failed.**" in (tmp_path / "gate.md").read_text()
    assert (tmp_path / "runs/tonight/report.html").exists()  # for whoever looks into it
    assert (tmp_path / "runs/last-good/request.yaml").read_bytes() == reference


def test_a_campaign_ends_when_its_condition_is_decided(tmp_path: Path) -> None:
    path, out = write_campaign(tmp_path, draws=400, variants={"long": {}}), tmp_path / "out"
    command = ("campaign", path, "--out", out, "--until", "p(failure) < 0.5 at 90 %")
    done = run("gcs", *command, env=environment())
    assert done.returncode == 0, done.stderr
    assert "p(failure) < 0.5 at 90 %: shown for " in done.stdout
    flown = read_results(out, ["row"]).num_rows
    assert 0 < flown < 400
    assert "| shown |" in (out / "report.md").read_text()
    again = run("gcs", *command, env=environment())
    assert again.returncode == 0, again.stderr
    assert read_results(out, ["row"]).num_rows == flown
