"""Names and paths of users are shown as they are, whatever they hold."""

from pathlib import Path

import pytest
import yaml
from flying import assert_one_message, fly, run, scenario_tree

pytestmark = pytest.mark.sitl

WILD = ["t [/x] y", "řídící ✈ [bold red]x[/]", "a :smile: b", r"x $\frac{ y$"]


@pytest.mark.parametrize("text", WILD)
def test_a_flight(tmp_path: Path, text: str) -> None:
    tree = scenario_tree(duration_s=0.05, name=text)
    tree["uavs"][1]["name"] = f"second {text}"
    folder = tmp_path / text.replace("/", "")
    folder.mkdir()
    scenario = folder / "scenario.yaml"
    scenario.write_text(yaml.safe_dump(tree))
    done = fly(scenario, "--in-process", "--out", folder / "[run")
    assert done.returncode == 0, done.stderr
    assert f"2 second {text}" in done.stdout
    assert f"results in {folder / '[run'}" in done.stdout


def test_a_sweep_and_a_profile(tmp_path: Path) -> None:
    scenario = tmp_path / "of[bold]us[.yaml"
    scenario.write_text(yaml.safe_dump(scenario_tree(duration_s=0.05)))
    other = tmp_path / r"$\frac{$.yaml"
    other.write_text(yaml.safe_dump(scenario_tree(duration_s=0.05)))
    folder = tmp_path / "out[ing] [b]"
    done = run("gcs", "sweep", scenario, other, "--out", folder)
    assert done.returncode == 0, done.stderr
    assert str(folder) in done.stdout
    assert scenario.stem in done.stdout
    done = run("gcs", "profile", "check", scenario)
    assert done.returncode == 0, done.stderr
    assert str(scenario) in done.stdout


@pytest.mark.parametrize("arguments", [["fly", "no[/x].yaml"], ["fly", "--sped=[/x]", "[/y]"]])
def test_what_cannot_be_used(arguments: list[str]) -> None:
    done = run("gcs", *arguments)
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert "[/x]" in done.stderr or "--sped" in done.stderr
