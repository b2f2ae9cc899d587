"""``sitl-plant`` and ``ftc-autopilot`` from outside: what they refuse, and how."""

import socket
from pathlib import Path
from typing import Any

import pytest
import yaml
from flying import assert_one_message, free_links, run, scenario_tree

from gcs.scenario.model import Scenario
from mavlink_defs.config.files import dump

pytestmark = pytest.mark.sitl

PROGRAMS = ("sitl-plant", "ftc-autopilot")


def config_tree(program: str, folder: Path) -> dict[str, Any]:
    scenario = Scenario.model_validate(scenario_tree(links=free_links()))
    plant = program == "sitl-plant"
    dump(scenario.plant_config() if plant else scenario.autopilot_config(2), folder / "good.yaml")
    tree: dict[str, Any] = yaml.safe_load((folder / "good.yaml").read_text())
    return tree


def refused(program: str, *arguments: str | Path) -> str:
    done = run(program, *arguments)
    assert done.returncode == 2, done.stderr
    assert_one_message(done.stderr)
    return done.stderr


@pytest.mark.parametrize("program", PROGRAMS)
def test_missing_config(tmp_path: Path, program: str) -> None:
    missing = tmp_path / "no.yaml"
    assert str(missing) in refused(program, missing)


@pytest.mark.parametrize("program", PROGRAMS)
def test_no_arguments_and_unknown_option(tmp_path: Path, program: str) -> None:
    assert "required: config" in refused(program).lower()
    assert "--sped" in refused(program, tmp_path / "no.yaml", "--sped")


@pytest.mark.parametrize("program", PROGRAMS)
def test_help(program: str) -> None:
    done = run(program, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert program in done.stdout


@pytest.mark.parametrize("program", PROGRAMS)
def test_all_problems_are_named_at_once(tmp_path: Path, program: str) -> None:
    tree = config_tree(program, tmp_path)
    tree["step_us"] = 0
    tree["colour"] = "red"
    bad = tmp_path / "bad.yaml"
    bad.write_text(yaml.safe_dump(tree))
    message = refused(program, bad)
    for key in (str(bad), "step_us", "colour"):
        assert key in message


@pytest.mark.parametrize(
    ("program", "key"), [(PROGRAMS[0], "bind"), (PROGRAMS[1], "formation_bind")]
)
def test_port_in_use(tmp_path: Path, program: str, key: str) -> None:
    tree = config_tree(program, tmp_path)
    config = tmp_path / "config.yaml"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        tree[key] = f"127.0.0.1:{sock.getsockname()[1]}"
        config.write_text(yaml.safe_dump(tree))
        message = refused(program, config)
    assert str(tree[key].split(":")[1]) in message
    assert key in message


def test_recording_needs_an_end(tmp_path: Path) -> None:
    tree = config_tree("sitl-plant", tmp_path)
    tree["duration_s"] = None
    config = tmp_path / "config.yaml"
    config.write_text(yaml.safe_dump(tree))
    message = refused("sitl-plant", config, "--record", tmp_path / "plant.npz")
    assert "duration_s" in message
    assert not (tmp_path / "plant.npz").exists()


@pytest.mark.parametrize(
    ("option", "reason"),
    [("--record", "1 --record for 2 CONFIGs"), ("--checkpoint", "--checkpoint is for one UAV")],
)
def test_several_autopilots_in_a_process(tmp_path: Path, option: str, reason: str) -> None:
    files = tmp_path / "uav1.yaml", tmp_path / "uav2.yaml"
    assert reason in refused("ftc-autopilot", *files, option, tmp_path / "there")
    assert not (tmp_path / "there").exists()
