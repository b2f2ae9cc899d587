"""Files of any kind and size: each door refuses at once what it cannot read."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from ftc_lab.campaigns.mark import mark_of
from ftc_lab.campaigns.until import noted_conditions
from gcs.console.errors import BadInput
from gcs.results.run_folder import read_summary
from gcs.results.store import batches
from gcs.scenario.model import load_scenario
from gcs.scenario.profile_file import load_profile
from gcs.station.param_file import read_param_file
from mavlink_defs.config.files import read
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.user_files import MAX_FILE
from mavlink_defs.framing.signing import SigningError, read_key
from mavlink_defs.mission_files import read_mission_file

DOORS = (read, load_scenario, load_profile, read_mission_file)


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as sock:
        folder = os.getcwd()
        os.chdir(path.parent)  # the name of a socket is short
        try:
            sock.bind(path.name)
        finally:
            os.chdir(folder)


def make_hole(path: Path) -> None:
    path.touch()
    os.truncate(path, 1 << 40)


MADE: dict[str, tuple[Callable[[Path], object], str]] = {
    "device": (lambda path: path.symlink_to("/dev/zero"), "expected a file, got a device"),
    "pipe": (os.mkfifo, "expected a file, got a pipe"),
    "folder": (Path.mkdir, "expected a file, got a folder"),
    "socket": (make_socket, "expected a file, got a socket"),
    "comment": (lambda path: path.write_text("#" * (MAX_FILE + 1)), "expected at most 1 MB"),
    "faults": (
        lambda path: path.write_text("faults:\n" + "- {uav: 1}\n" * 200_000),
        "expected at most 1 MB",
    ),
    "hole": (make_hole, "expected at most 1 MB"),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("kind", MADE)
def test_what_is_no_small_file_is_refused(
    tmp_path: Path, door: Callable[[Path], object], kind: str
) -> None:
    make, expected = MADE[kind]
    path = tmp_path / "file.yaml"
    make(path)
    with pytest.raises(ConfigError) as caught:
        door(path)
    assert expected in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_file_that_is_extended_is_read_through_the_same_door(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "top.yaml").write_text("extends: pipe\n")
    with pytest.raises(ConfigError, match="expected a file, got a pipe"):
        load_scenario(tmp_path / "top.yaml")


@pytest.mark.parametrize("text", ["secret:x:0:0:root\nsecret2:y:1\n", "- secret\n", "secret"])
def test_an_error_does_not_show_what_a_foreign_file_holds(tmp_path: Path, text: str) -> None:
    (tmp_path / "foreign").write_text(text)
    (tmp_path / "top.yaml").write_text("extends: foreign\n")
    with pytest.raises(ConfigError) as caught:
        load_scenario(tmp_path / "top.yaml")
    assert "secret" not in str(caught.value)


READERS: dict[str, Callable[[Path], object]] = {  # each with the file that it reads in a folder
    "request.yaml": mark_of,
    "until.json": noted_conditions,
    "summary.json": read_summary,
    "events.arrows": lambda folder: list(batches(folder / "events.arrows")),
    "link.key": lambda folder: read_key(folder / "link.key"),
    "values.parm": lambda folder: read_param_file(folder / "values.parm"),
}


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("kind", ["device", "pipe", "folder", "socket"])
def test_the_files_of_a_folder_are_no_pipes(tmp_path: Path, name: str, kind: str) -> None:
    make, expected = MADE[kind]
    make(tmp_path / name)
    with pytest.raises((ConfigError, BadInput, SigningError)) as caught:
        READERS[name](tmp_path)
    assert expected in str(caught.value)
