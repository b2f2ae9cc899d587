"""What is to be known of a flight before it begins is the same on every face."""

import json
import math
import warnings
from pathlib import Path
from typing import Any

import pytest
from own_laws import write_law
from typer.testing import CliRunner

from gcs import BadInput, campaign, fly, fly_many
from gcs.commands.cli import app
from gcs.commands.common import FleetOptions, changed_scenario, option
from gcs.commands.common import prepared as on_command_line
from gcs.fleet.preparation import How, prepare
from gcs.fleet.remarks import WARNING, WarningRemark, remarks_of
from gcs.testing.fixtures import prepared

HEXAGON, PAPER = "missions/hexagon", "paper/scenario1"
BY_SENSORS = {"navigation": "estimated"}


def remarks(name: str, settings: list[str]) -> list[str]:
    return remarks_of(changed_scenario(Path(name), None, settings))


def test_uavs_on_one_path_are_named() -> None:
    (text,) = remarks(HEXAGON, ["formation=null"])
    assert text.startswith("warning: UAVs 1, 2, 3 fly one path, and nothing keeps them apart")


@pytest.mark.parametrize(("name", "settings"), [(HEXAGON, []), (PAPER, ["formation=null"])])
def test_slots_or_a_profile_bring_no_warning(name: str, settings: list[str]) -> None:
    assert remarks(name, settings) == []


@pytest.mark.parametrize("sensor", ["magnetometer", "pitot"])
def test_a_sensor_that_is_not_fitted_is_named(sensor: str) -> None:
    key = f"sensors.navigation.{sensor}.fitted"
    (text,) = remarks(PAPER, ["navigation=estimated", f"{key}=false"])
    assert text.startswith(f"warning: {key} is false:")
    assert remarks(PAPER, ["navigation=estimated"]) == []


CASES: list[tuple[str, dict[str, Any], str]] = [
    (HEXAGON, {"formation": None}, "UAVs 1, 2, 3 fly one path"),
    (PAPER, {**BY_SENSORS, "sensors.navigation.pitot.fitted": False}, "pitot.fitted is false"),
    ("airframes/skywalker_x8", {"controller.kind": "surviving"}, "heading is held by bank"),
    (PAPER, {"controller": {"kind": "FOLDER/mine.py:Mine"}}, "Mine is plain Python"),
    (PAPER, {}, "recording the trajectory needs up to"),
]
"""Scenario, changes, and part of a remark that they bring."""


@pytest.mark.parametrize(("name", "changes", "part"), CASES, ids=[part for *_, part in CASES])
def test_the_command_line_python_and_fixtures_remark_the_same(
    name: str,
    changes: dict[str, Any],
    part: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gcs.fleet.preparation._LARGE", 0.0 if not changes else 1e12)
    write_law(tmp_path, "plain")
    changes = json.loads(json.dumps(changes).replace("FOLDER", str(tmp_path)))
    changes = {"duration_s": 0.05, "faults": [], **changes}
    settings = [f"--set={key}={json.dumps(value)}" for key, value in changes.items()]
    arguments = ["fly", name, "--in-process", "--record=full", "--no-figures", *settings]
    done = CliRunner().invoke(app, [*arguments, "--out", "run"])
    assert done.exit_code == 0, done.output
    said = [text for text in done.stderr.splitlines() if not text.startswith("runs ")]

    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        flight = fly(name, changes, record="full")
        many = fly_many([(name, changes)], jobs=1, progress=False)
        tested = prepared(Path(name), changes, None, "in_process")
    assert [part in text for text in said] == [True], said
    assert list(flight.remarks) == said
    if changes.keys() - {"duration_s", "faults"}:  # else they are of the recording
        assert many[0].remarks == tested.remarks == flight.remarks
    texts = [
        text.removeprefix(WARNING) for text in flight.remarks if isinstance(text, WarningRemark)
    ]
    assert [str(one.message) for one in warned] == 3 * texts
    assert {one.filename for one in warned} <= {__file__}


def test_a_flight_over_udp_has_remarks_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcs.fleet.preparation._MANY", 0)
    changes = {"links.host": "0.0.0.0"}
    python = prepare(PAPER, How(free_ports=True), values=changes).remarks
    options = FleetOptions(settings=["links.host=0.0.0.0"], free_ports=True)
    command = on_command_line(Path(PAPER), options, "up").remarks
    names = [text.rsplit(" ", 2)[1] for text in (python[0], command[0])]
    assert names == ["autopilot_processes", "--autopilot-processes"]
    assert python[1:] == command[1:]
    (exposed,) = python[1:]
    assert exposed.startswith("warning: 0.0.0.0 can be reached from other machines; sign")


@pytest.mark.parametrize(
    ("how", "named"),
    [
        *(
            ({"speed": speed}, f"speed is {speed:g}, expected a factor above 0")
            for speed in (0.0, -1.0, math.nan, math.inf)
        ),
        ({"speed": 1.0, "autopilot_processes": 2}, "autopilot_processes is 2"),
        ({"restart": True, "autopilot_processes": 2}, "autopilot_processes is 2"),
        ({"over_udp": False, "autopilot_processes": 2}, "autopilot_processes is 2"),
        ({"over_udp": False, "speed": 1.0}, "speed is of processes"),
        ({"over_udp": False, "restart": True}, "restart is of processes"),
    ],
)
def test_what_does_not_go_together_is_refused_once_for_all(how: dict[str, Any], named: str) -> None:
    """By the names of the face: ``--autopilot-processes`` is `autopilot_processes` in Python."""
    for spell, expected in ((str, named), (option, option(named.split(maxsplit=1)[0]))):
        with pytest.raises(BadInput) as refused:
            prepare(PAPER, How(free_ports=True, named=spell, **how))
        assert str(refused.value).startswith(expected)


def test_a_campaign_has_workers_here_or_elsewhere(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="jobs starts workers here; scheduler has its own"):
        campaign("campaigns/uncertainty", jobs=2, scheduler="tcp://host:1", out=tmp_path / "out")
    arguments = ["campaign", "campaigns/uncertainty", "--jobs=2", "--scheduler=tcp://host:1"]
    refused = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "out")])
    assert str(refused.exception) == "--jobs starts workers here; --scheduler has its own"
    assert not (tmp_path / "out").exists()
