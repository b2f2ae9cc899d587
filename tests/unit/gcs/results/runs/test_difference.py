"""Two flights compared: what differs, and nothing else."""

import json
import re
from pathlib import Path

import pytest
from run_folders import make_run
from typer.testing import CliRunner

from ftc_autopilot.control.laws import law_of
from gcs.commands.cli import app
from gcs.results.flight_mark import FLIGHT
from gcs.results.run_folder import SCENARIO
from mavlink_defs.config.files import read
from mavlink_defs.config.yaml_text import yaml_of


@pytest.fixture
def pair(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    return make_run(cache, tmp_path / "old"), make_run(cache, tmp_path / "new")


def compared(*options: str) -> str:
    done = CliRunner().invoke(app, ["compare", "old", "new", *options])
    assert done.exit_code == 0, done.exception
    return done.stdout


def rows(text: str, figure: str) -> list[list[str]]:
    return [line.partition(figure)[2].split() for line in text.splitlines() if figure in line]


def test_equal_flights_differ_in_nothing(pair: tuple[Path, Path]) -> None:
    text = compared()
    assert "their scenarios are the same" in text
    assert "by the same code" in text
    for figure in ("  messages  ", "IAE of roll [deg s]"):
        assert [row[2] for row in rows(text, figure)] == ["0"] * 3
    assert "diagnosis" not in text


def test_figures_diagnosis_and_keys_that_differ_are_shown(pair: tuple[Path, Path]) -> None:
    _, new = pair
    tree = json.loads((new / "summary.json").read_text())
    own = tree["uavs"][1]
    before = own["iae"]["roll"]
    own["iae"]["roll"] = 2 * before
    own["actuator_messages"] += 7
    own["diagnosis"] = [
        {"actuator": "rudder", "phase": "lost", "time_s": 0.03, "delay_s": 0.02, "stuck": 1.0}
    ]
    own["heading_lost_at_s"] = 0.04
    (new / "summary.json").write_text(json.dumps(tree))
    scenario = read(new / SCENARIO)
    scenario["trigger"]["b2_deg"] = 0.5
    scenario["faults"][0]["uav"] = 2
    (new / SCENARIO).write_text(yaml_of(scenario))
    text = compared()
    assert [row[2] for row in rows(text, "  messages  ")] == ["0", "+7", "0"]
    assert [row[3:] for row in rows(text, "IAE of roll [deg s]")] == [[], ["+100.0"], []]
    assert rows(text, "heading lost at [s]") == [["-", "40", "ms"]]
    assert "diagnosis of UAV 2, old: nothing declared" in text
    assert "diagnosis of UAV 2, new: rudder lost at 0.030 s, 20 ms after its cause" in text
    assert "trigger.b2_deg: 1.0 → 0.5" in text
    assert "faults[0].uav: 3 → 2" in text
    assert "2 of " in text
    assert "new: heading lost, 0.05 s: UAV 2" in text
    data = json.loads(compared("--json"))
    assert [uav["figures"]["messages"]["change"] for uav in data["uavs"]] == [0, 7, 0]
    assert data["uavs"][1]["figures"]["iae_roll"]["old"] == before
    assert data["uavs"][1]["figures"]["iae_roll"]["new"] == 2 * before
    assert data["uavs"][1]["figures"]["heading_lost_at_s"] == {
        "old": None,
        "new": 0.04,
        "change": None,
        "beaten_by": None,
    }
    assert data["uavs"][1]["diagnosis"] == {"old": [], "new": own["diagnosis"]}
    assert data["scenario"].keys() == {"trigger.b2_deg", "faults[0].uav"}
    assert (data["old"]["outcome"], data["new"]["outcome"]) == ("completed", "heading_lost")
    assert data["same_code"] is True


def test_a_flight_of_an_earlier_version_is_compared_by_its_figures(pair: tuple[Path, Path]) -> None:
    for name in (FLIGHT, SCENARIO):
        (pair[0] / name).unlink()
    text = compared()
    assert "old has no scenario.yaml" in text
    data = json.loads(compared("--json"))
    assert data["scenario"] is data["same_code"] is None
    assert "code" not in text


def refused(*arguments: str) -> str:
    done = CliRunner().invoke(app, ["compare", *arguments])
    assert done.exit_code != 0
    return str(done.exception)


def test_what_cannot_be_compared_is_refused(pair: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "nothing").mkdir()
    assert refused("old", "nothing") == "old is a flight, and nothing is none"
    assert refused("nothing", "new") == "new is a flight, and nothing is none"
    assert "test campaigns" in refused("old", "new", "--junit", "x.xml")
    assert not (tmp_path / "x.xml").exists()
    (pair[1] / "summary.json").unlink()
    assert "new has no summary.json" in refused("old", "new")


def with_law(run: Path, kind: str) -> None:
    """Make it a flight of another law, in all files that say so."""
    tree = read(run / SCENARIO)
    law = law_of(kind)(kind=kind)
    (run / SCENARIO).write_text(yaml_of({**tree, "controller": law.model_dump(mode="json")}))
    mark = read(run / FLIGHT)
    (run / FLIGHT).write_text(yaml_of({**mark, "law": kind, "settings": {"controller": kind}}))


def test_what_was_set_comes_first_and_defaults_of_one_law_are_counted(
    pair: tuple[Path, Path],
) -> None:
    old, new = pair
    with_law(old, "pid")
    with_law(new, "surviving")
    text = compared()
    lines = text.splitlines()
    assert lines[2] == "law: pid → surviving"
    assert lines[3] == "changes: controller=pid → controller=surviving"
    assert re.search(r"^  controller: of surviving only, at their defaults: \d+ keys", text, re.M)
    assert "controller.diagnosis" not in text
    assert "controller.kind: pid → surviving" in text
    assert "controller.diagnosis" in compared("--all")
    assert len(compared("--all").splitlines()) > len(lines) + 20


def test_a_folder_that_is_not_there_is_said_to_be_so(pair: tuple[Path, Path]) -> None:
    assert refused("old", "nosuch") == "nosuch does not exist"


def with_errors(run: Path, roll: float, saving: float, **changes: object) -> None:
    """Give the summary of a flight other figures of UAV 1."""
    tree = json.loads((run / "summary.json").read_text())
    tree["uavs"][0]["max_error"]["roll"] = roll
    tree["uavs"][0]["saving"] = saving
    (run / "summary.json").write_text(json.dumps({**tree, **changes}))


def beaten_by(figure: str) -> str | None:
    found: str | None = json.loads(compared("--json"))["uavs"][0]["figures"][figure]["beaten_by"]
    return found


def test_what_a_simpler_law_does_better_is_said(pair: tuple[Path, Path]) -> None:
    old, new = pair
    with_law(old, "tube")
    with_law(new, "pid")
    with_errors(old, 3.0, 0.98)
    with_errors(new, 2.0, 0.99)
    assert json.loads(compared("--json"))["same_flight"] is True
    assert (beaten_by("max_error_roll"), beaten_by("saving")) == ("pid", "pid")
    assert "*: a simpler law" in compared()
    assert re.search(r"\d\*", compared())  # in a pipe, too
    with_errors(new, 3.0, 0.97)  # saves less
    assert (beaten_by("max_error_roll"), beaten_by("saving")) == (None, None)
    assert "*" not in compared()


def test_a_law_that_was_lost_is_no_better_for_it(pair: tuple[Path, Path]) -> None:
    old, new = pair
    with_law(old, "tube")
    with_law(new, "pid")
    with_errors(old, 3.0, 0.98)
    with_errors(new, 0.1, 0.98, completed=False, loss="UAV 1 was lost")
    assert beaten_by("max_error_roll") is None
    with_errors(new, 5.0, 0.98, completed=True, loss=None)
    with_errors(old, 0.1, 0.98, completed=False, loss="UAV 1 was lost")
    assert beaten_by("max_error_roll") == "pid"
    mark = read(old / FLIGHT)
    (old / FLIGHT).write_text(yaml_of({**mark, "ended": "interrupted"}))
    assert beaten_by("max_error_roll") is None  # by Ctrl-C: nobody knows how it would have ended


def test_flights_of_different_scenarios_are_not_judged(pair: tuple[Path, Path]) -> None:
    old, new = pair
    with_law(old, "tube")
    with_law(new, "pid")
    with_errors(old, 3.0, 0.98)
    with_errors(new, 2.0, 0.98)
    (new / SCENARIO).write_text(yaml_of({**read(new / SCENARIO), "seed": 2}))
    assert json.loads(compared("--json"))["same_flight"] is False
    assert beaten_by("max_error_roll") is None
    assert "*" not in compared()
    assert "nothing is marked" in compared()
    (new / SCENARIO).unlink()
    assert json.loads(compared("--json"))["same_flight"] is None
    assert beaten_by("max_error_roll") is None
