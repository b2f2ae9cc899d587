"""`gcs baseline` as a user runs it, on the paper's scenario cut short."""

import json
from pathlib import Path

import pytest
from flying import SCENARIO_1, assert_one_message, run

pytestmark = pytest.mark.sitl


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    file = tmp_path / "short.yaml"
    file.write_text(f"extends: {SCENARIO_1}\nduration_s: 0.2\nfaults: []\n")
    return file


def test_baselines_are_found_and_written(scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ("--longest", "4", "--aircraft", "2", "--keep", "50", "--tolerance", "30")
    done = run("gcs", "baseline", scenario, *options, "--json", "--out", out)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found == json.loads((out / "baseline.json").read_text())
    assert found["every_period"] == 3 * 4 * 200
    assert [one["periods"] for one in found["uniform"]] == [[n] * 4 for n in (1, 2, 3, 4)]
    assert found["saved"]["every_period"] == 1.0 - found["transmissions"] / 2400
    assert found["robustness"]["drawn"] == 2
    assert "| every 1 ms | 2400 |" in (out / "baseline.md").read_text()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--longest", "300"), "expected from 1 ms, the control period, to 200 ms, the flight"),
        (("--against", "trigger.period_s=1,2"), "--against trigger.period_s has 2 values"),
        (("--aircraft", "2", "--campaign", "nothing"), "no bundled scenario of that name"),
    ],
)
def test_bad_input_is_refused_before_anything_is_flown(
    options: tuple[str, ...], reason: str, scenario: Path, tmp_path: Path
) -> None:
    done = run("gcs", "baseline", scenario, *options, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert reason in done.stderr.replace("\n", " ")
    assert not (tmp_path / "out").exists()
