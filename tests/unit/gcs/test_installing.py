"""What docs, templates and messages say to install can be installed, and hides nothing."""

import importlib.metadata
import re
import shlex
import tomllib
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from typer.testing import CliRunner

from gcs.commands.cli import app
from gcs.console.errors import BadInput

ROOT = Path(__file__).parents[3]
EXTRAS = set(
    tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
)
ROOMS = ("gcs", "ftc_lab", "sitl_plant", "ftc_autopilot")
TEXTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *(ROOT / "docs").rglob("*.md"),
    *(path for path in (ROOT / "gcs" / "project").rglob("*") if path.is_file()),
    *(path for room in ROOMS for path in (ROOT / room).rglob("*.py")),
]
PIP = re.compile(r"pip install ((?:'[^'\n]*'|\"[^\"\n]*\"|[^\s`'\"#&;,\\]+|[ ])+)")
OF_PATH = re.compile(r"(?P<path>\.[^\[]*|FOLDER)(\[(?P<extras>[\w,]+)\])?")


def installed_by(text: str) -> list[str]:
    """Every word after ``pip install`` in a text, but options and what code fills in."""
    lines = [shlex.split(found) for found in PIP.findall(text)]
    return [word for line in lines for word in line if not word.startswith(("-", "{"))]


def test_what_texts_say_to_install_can_be_installed() -> None:
    found = {path: installed_by(path.read_text(errors="ignore")) for path in TEXTS}
    assert sum(map(len, found.values())) >= 15
    for path, words in found.items():
        for word in words:
            where = f"{path}: {word}"
            if (local := OF_PATH.fullmatch(word)) is not None:
                project = "gcs/project" in str(path)
                extras = set((local["extras"] or "").split(",")) - {""}
                assert extras <= ({"test"} if project else EXTRAS), where
                continue
            needed = Requirement(word.replace("SOURCE", "https://example.org/ftc.git"))
            if canonicalize_name(needed.name) == "ftc-sitl":
                assert needed.url is not None, where
                assert needed.extras <= EXTRAS, where


def test_the_page_has_every_extra() -> None:
    rows = re.findall(r"^\| `(\w+)` \|", (ROOT / "docs/how-to/install.md").read_text(), re.M)
    assert set(rows) == EXTRAS


def test_the_versions_are_shown_where_pymavlink_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    own = importlib.metadata.version

    def version(name: str) -> str:
        if name == "pymavlink":
            raise PackageNotFoundError(name)
        return own(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    done = CliRunner().invoke(app, ["--version"])
    assert done.exit_code == 0
    assert "\npymavlink is not installed\nnumba " in done.stdout


def new(*arguments: str) -> str:
    done = CliRunner().invoke(app, ["new", *arguments])
    if isinstance(done.exception, BadInput):
        return str(done.exception)
    assert done.exit_code == 0, done.exception
    return done.stdout


@pytest.mark.parametrize(
    "name",
    ["numpy", "gcs", "ftc-sitl", "ftc_autopilot", "Rich", "json", "PyYAML", "typing-extensions"],
)
def test_a_name_that_is_installed_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = new("--project", name, "--source", "https://example.org/a.whl")
    assert re.fullmatch(rf"--project is '{name}', and \S+ is installed here: .*", text)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("noted", "source"),
    [
        ('{"url": "file:///a/b.whl", "archive_info": {}}', "file:///a/b.whl"),
        ('{"url": "file:///clone", "dir_info": {"editable": true}}', "file:///clone"),
        (
            '{"url": "https://example.org/f.git", "vcs_info": {"vcs": "git", "commit_id": "1f"}}',
            "git+https://example.org/f.git@1f",
        ),
        (None, None),
    ],
)
def test_a_project_installs_from_where_this_one_is_from(
    noted: str | None, source: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    own = distribution("ftc-sitl")

    def read_text(self: Distribution, name: str) -> Any:
        return noted if name == "direct_url.json" else None

    monkeypatch.setattr(type(own), "read_text", read_text)
    said = new("--project", "my-law")
    if source is None:
        assert said == "this ftc-sitl does not say where it was installed from"
        assert not list(tmp_path.iterdir())
        return
    workflow = (tmp_path / "my-law/.github/workflows/test.yml").read_text()
    assert f"- run: pip install 'ftc-sitl[lab] @ {source}'\n" in workflow
    assert ("which other machines do not have" in said) == source.startswith("file:")
    left = [
        p for p in (tmp_path / "my-law").rglob("*") if p.is_file() and "SOURCE" in p.read_text()
    ]
    assert not left


def test_a_source_is_a_url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for wrong in ("ftc-sitl", "a b://c", "https://x/'; rm -rf /"):
        assert "expected a URL" in new("--project", "my-law", "--source", wrong)
    assert not list(tmp_path.iterdir())
