"""Bad input that commands refuse before they talk to any vehicle, and their help."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gcs.command_list import OWN, command_of, registered
from gcs.commands import cli
from gcs.commands.cli import app, whole_command
from gcs.console.errors import BadInput
from mavlink_defs.config.models import ConfigError
from mavlink_defs.framing.signing import make_key

SCENARIO_1 = str(Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml")
NOWHERE = ("--connect", "udpout:127.0.0.1:1")
SLOT = ("formation", "slot", *NOWHERE, "1", "2", "3")
GYRO = ("fault", "sensor", "set", "gyro", *NOWHERE)
RUDDER = ("fault", "set", "rudder", "--effectiveness", "0.5", *NOWHERE)


def test_a_command_that_has_gone_says_what_does_it_now() -> None:
    problem = CliRunner().invoke(app, ["ardupilot", "paper/scenario1", "--uav", "1"]).exception
    assert isinstance(problem, BadInput)
    assert problem.hint == "use gcs fly SCENARIO --set autopilot.kind=ardupilot"


def complaint(*arguments: str) -> str:
    """Return the message about bad input, ours or typer's, with exit status 2."""
    result = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, arguments)
    assert result.stdout == ""
    if isinstance(result.exception, BadInput | ConfigError):
        return str(result.exception)
    assert result.exit_code == 2, result.exception
    return result.stderr


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("fault", "set", "rudder", *NOWHERE), "--effectiveness"),
        (("fault", "set", "rudder", "--effectiveness", "1.5", *NOWHERE), "--effectiveness"),
        (("fault", "set", "throttle", "--bias-deg", "1", *NOWHERE), "--bias-n"),
        (("fault", "set", "rudder", "--bias-deg", "nan", *NOWHERE), "--bias-deg"),
        (("fault", "set", "flaps", *NOWHERE), "flaps"),
        ((*RUDDER, "--stuck-deg", "1"), "--stuck-deg"),
        ((*RUDDER, "--frequency-hz", "501"), "--frequency-hz"),
        ((*RUDDER, "--start-s", "-1"), "--start-s"),
        ((*RUDDER, "--start-s", "3", "--end-s", "2"), "--end-s"),
        ((*RUDDER, "--end-s", "2", "--for-s", "2"), "--for-s"),
        ((*RUDDER, "--for-s", "0"), "--for-s"),
        (("fault", "clear", "--actuator", "flaps", *NOWHERE), "flaps"),
        (("fault", "set", *NOWHERE), "ACTUATOR"),
        ((*RUDDER, "--fade-s", "3"), "No such option: --fade-s"),
        ((*GYRO, "--effectiveness", "0.5"), "No such option: --effectiveness"),
        ((*GYRO, "--bias-pa", "1"), "did you mean '--bias-deg-s'?"),
        ((*GYRO, "--delayed-s", "2"), "--delayed-s: expected [0, 1] s, got 2"),
        ((*GYRO, "--failure", "broken"), "broken"),
        ((*GYRO, "--failure", "off", "--axis", "x"), "--axis: expected none"),
        ((*GYRO, "--failure", "off", "--for-s", "0"), "--for-s"),
        (GYRO, "expected a '--failure' or a value"),
        (("fault", "sensor", "clear", "pitot", *NOWHERE), "pitot"),
        (("status", "--uav", "x"), "--uav"),
        (("status", "--uav", "0"), "--uav"),
        (("status", "--uav", ""), "--uav"),
        (("arm", "--connect", "tcp:1.2.3.4:5"), "--connect"),
        (("arm", "--timeout", "0"), "--timeout"),
        (("arm", "--tomeout", "1"), "--tomeout"),
        (("mode", "hover"), "hover"),
        (("param", "set", "B1", "lots"), "VALUE"),
        (("up", SCENARIO_1, "--speed", "0"), "--speed"),
        (("up", SCENARIO_1, "--speed", "2", "--lockstep"), "--lockstep"),
        (("up", SCENARIO_1, "--hub-port", "14550"), "--hub-port"),
        (("up", SCENARIO_1, "--hub-port", "70000"), "--hub-port"),
        (("up", "none.yaml"), "none.yaml"),
        (("fly", SCENARIO_1, "--with", "none"), "none: no such file"),
        (("fly", SCENARIO_1, "--set", "seed"), "expected KEY=VALUE"),
        (("fly", SCENARIO_1, "--set", "seed=1,2"), "--set seed has 2 values, expected one"),
        (("fly", SCENARIO_1, "--set", "faults[9].uav=1"), "--set faults[9].uav: expected a list"),
        (("fly", SCENARIO_1, "--set", "servos.rudder.lag=1"), "did you mean 'lag_s'?"),
        (("fly", SCENARIO_1, "--set", "servos.rudder.lag_s=-1"), "expected [0, 10] s, got -1"),
        (("trim", SCENARIO_1, "--airspeed", "5"), "expected [20, 80] m/s"),
        (("trim", "airframes/mixed", "--uav", "7"), "--uav is 7, expected one of"),
        (("trim", SCENARIO_1, "--roll", "90"), "--roll"),
        (("profile", "check", "none.yaml"), "none.yaml"),
        (("profile", "check", "missions/hexagon"), "has a mission, no profile; see gcs mission"),
        (("mission", "show", "none.plan"), "none.plan"),
        (("mission", "show", "paper/scenario1"), "a profile, not a path; see gcs profile"),
        (("fly", "my.plan"), "my.plan: no such file"),
        (("formation", "slot", "1", "2", *NOWHERE), "three distances AHEAD RIGHT UP [m]"),
        (("formation", "slot", "1", "2", "3", *NOWHERE), "one UAV, as two cannot have one slot"),
        (
            (*SLOT, "--uav", "1,2"),
            "expected --uav with one UAV, as two cannot have one slot, got 1, 2",
        ),
        ((*SLOT[:-1], "nan", "--uav", "1"), "up: expected a finite number, got 'nan'"),
        (("mission", "upload", "none.yaml", *NOWHERE), "none.yaml"),
        (("mission", "download", "--out", "held.txt", *NOWHERE), ".plan nor .waypoints"),
    ],
)
def test_bad_input_names_what_is_wrong(arguments: tuple[str, ...], named: str) -> None:
    assert named in complaint(*arguments)


@pytest.mark.parametrize("command", ["check", "upload"])
def test_bad_profile_files(tmp_path: Path, command: str) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("profile: [{start_s: 1, airspeed_m_s: 40}]\n")
    said = complaint("profile", command, str(bad))
    assert str(bad) in said
    assert "profile[0]" in said


@pytest.mark.parametrize("command", [("fly",), ("mission", "show", "--fleet")])
def test_a_mission_is_no_scenario(tmp_path: Path, command: tuple[str, ...]) -> None:
    (tmp_path / "my.plan").write_text("{}")
    fly = [*command, str(tmp_path / "my.plan")]
    fly += [] if command == ("fly",) else ["missions/hexagon"]
    assert "a mission, not a scenario; see gcs mission" in complaint(*fly)


def test_a_mission_without_items_is_not_flown(tmp_path: Path) -> None:
    (tmp_path / "my.waypoints").write_text("QGC WPL 110\n0 1 0 16 0 0 0 0 -35.3 149.1 584 1\n")
    said = complaint("mission", "fly", str(tmp_path / "my.waypoints"), *NOWHERE)
    assert "has no item to fly" in said


def test_a_wrong_scheduler_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = complaint("campaign", "campaigns/uncertainty", "--scheduler", "cluster")
    assert "expected tcp://HOST:PORT" in text
    assert not list(tmp_path.iterdir())


def test_a_passphrase_is_not_asked_for_in_vain(tmp_path: Path) -> None:
    make_key(tmp_path / "key")
    text = complaint("key", str(tmp_path / "key"), "--passphrase")
    assert "key exists already; only --replace overwrites a key" in text
    result = CliRunner().invoke(app, ["key", str(tmp_path / "new"), "--passphrase"], input="")
    assert str(result.exception) == "no passphrase was given"
    assert not (tmp_path / "new").exists()


def help_of(*command: str) -> str:
    shown = subprocess.run(
        [sys.executable, "-c", "from gcs.commands.cli import main; main()", *command, "--help"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "COLUMNS": "120", "NO_COLOR": "1"},
    )
    return shown.stdout


def test_help_names_values_and_none_of_flags() -> None:
    assert "Without a command: the operator's dashboard." in help_of()
    text = help_of("formation", "slot")
    assert "[AHEAD] [RIGHT] [UP]" in text
    assert "--planned" in text
    assert "<bool>" not in text


def commands(group: Any) -> Iterator[Any]:
    for command in group.commands.values():
        yield from commands(command) if hasattr(command, "commands") else [command]


def test_every_help_has_examples_and_exit_status() -> None:
    found = list(commands(whole_command()))
    assert len(found) >= 16
    for command in found:
        assert "Examples:" in command.epilog, command.name
        assert "Exit status:" in command.epilog, command.name


def test_the_help_of_gcs_has_the_first_line_of_each_command() -> None:
    lines = {name: command.line for name, command in OWN.items()}
    lines |= {name: command_of(point).line for name, point in registered().items()}
    for name, command in whole_command().commands.items():
        first = " ".join(command.help.partition("\n\n")[0].split())
        assert lines[name] == first


def test_a_key_of_one_command_is_not_left_to_others(tmp_path: Path) -> None:
    assert "signing key" in complaint("status", "--signing-key", str(tmp_path / "no"), *NOWHERE)
    assert "FTC_SITL_SIGNING_KEY" not in os.environ


def exposed_scenario(folder: Path) -> str:
    path = folder / "exposed.yaml"
    path.write_text(f"extends: {SCENARIO_1}\nlinks: {{host: 0.0.0.0}}\n")
    return str(path)


def test_a_fleet_that_others_can_reach_wants_a_key(tmp_path: Path) -> None:
    text = complaint("up", exposed_scenario(tmp_path), "--free-ports")
    assert "links.host is 0.0.0.0" in text
    assert "links.signing_key" in text


@pytest.mark.parametrize("kind", ["--insecure", "--signing-key"])
def test_a_fleet_that_others_can_reach_may_start(tmp_path: Path, kind: str) -> None:
    """Bad input that is found later shows that the check was passed."""
    make_key(tmp_path / "key")
    allowed = (kind,) if kind == "--insecure" else (kind, str(tmp_path / "key"))
    text = complaint("up", exposed_scenario(tmp_path), "--hub-port", "14550", *allowed)
    assert "--hub-port" in text


def test_trim_prints_steady_flights_as_tables_and_as_json() -> None:
    options = [
        "trim",
        SCENARIO_1,
        "--airspeed",
        "50",
        "--set",
        "uncertainty.coefficients={cn0: 1.4}",
    ]
    shown = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, options)
    assert "level flight that turns" in shown.stdout
    trims = json.loads(CliRunner().invoke(app, [*options, "--json"]).stdout)
    assert {trim["stuck"] for trim in trims} == {"aileron", "elevator", "rudder", "throttle"}
    lowest = min(trim["position"] for trim in trims if trim["stuck"] == "aileron")
    assert lowest > 1.0  # 1.4 times the yawing moment: the true aircraft needs more rudder
    assert not any(trim["beyond"] for trim in trims)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("arm", "--timeout", "soon"), "--timeout: expected a number, got 'soon'"),
        (("arm", "--timeout", "0"), "--timeout: expected at least 0.1, got '0'"),
        (("fly", "x", "--row", "1.5"), "--row: expected a whole number, got '1.5'"),
        (("trim", "x", "--roll", "99"), "--roll: expected at most 80"),
        (("param", "set", "NAME", "x"), "VALUE: expected a number, got 'x'"),
        (("fly", "x", "--record", "all"), "--record: 'all' is not one of 'full', 'light'"),
    ],
)
def test_a_wrong_value_is_named_with_what_is_expected(
    arguments: tuple[str, ...],
    reason: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["gcs", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(f"error: {reason}")
