"""Imports go one way, as [tool.importlinter] says; the core runs without the extra `lab`."""

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

from gcs.console.extras import DESIGN_PACKAGES, LAB_PACKAGES, TOOLS_PACKAGES

ROOT = Path(__file__).parent.parent
WITHOUT = """
import sys
from importlib.machinery import PathFinder

class Without(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if any(f"{name}.".startswith(f"{absent}.") for absent in {absent!r}):
            return None
        return super().find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = Without
"""
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
IN_TURN = """
import json, sys
from gcs.__main__ import main

for command in json.loads(sys.argv[1]):
    sys.argv = ["gcs", *command]
    try:
        main()
        status = 0
    except SystemExit as end:
        status = end.code or 0
    print(f"{status} from {command}", file=sys.stderr, flush=True)
"""
"""Commands in one interpreter: importing takes longer than most of them."""


def test_imports_go_one_way() -> None:
    config = str(ROOT / "pyproject.toml")
    assert lint_imports(config_filename=config) == EXIT_STATUS_SUCCESS


def run_without(
    absent: Iterable[str], folder: Path, *arguments: str
) -> subprocess.CompletedProcess[str]:
    """Run Python where modules are missing, in it and in every process that it starts."""
    site = folder / "site"
    site.mkdir(exist_ok=True)
    (site / "sitecustomize.py").write_text(WITHOUT.replace("{absent!r}", repr(tuple(absent))))
    path = os.pathsep.join([str(site), str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.mark.sitl
def test_the_core_runs_without_the_lab(tmp_path: Path) -> None:
    absent = (*LAB_PACKAGES, *DESIGN_PACKAGES, *TOOLS_PACKAGES, "dask", "ftc_lab", "lxml", "mcap")
    short = ("paper/scenario1", "--set", "duration_s=0.05", "--quiet")
    commands = (
        ("--help",),
        ("scenarios",),
        ("fly", *short, "--out", "wire", "--free-ports"),
        ("fly", *short, "--out", "process", "--in-process", "--record", "full"),
        ("export", "process", "--to", "csv"),
        ("new", "my.yaml"),
        ("mission", "show", "missions/race_track"),
        ("config", "paper/scenario1", "--out", "hosts"),
    )
    nobody = ("--timeout", "0.1", "--connect", "udpin:127.0.0.1:0")
    unheard = (("status", *nobody), ("fault", "list", *nobody))
    done = run_without(absent, tmp_path, "-c", IN_TURN, json.dumps([*commands, *unheard]))
    assert done.returncode == 0, done.stderr
    ends = re.findall(r"^(\d+) from (.*)$", done.stderr, re.MULTILINE)
    assert [command for _, command in ends] == [str([*c]) for c in (*commands, *unheard)]
    assert {status for status, _ in ends[: len(commands)]} == {"0"}, done.stderr
    assert "70" not in {status for status, _ in ends}, done.stderr
    said_last = done.stderr.partition(f"from {[*commands[-1]]}\n")[2]
    assert said_last
    assert "lab" not in said_last


@pytest.mark.sitl
def test_commands_of_the_lab_run_without_the_packages_of_its_campaigns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    short = ("paper/scenario1", "--set", "duration_s=0.05", "--quiet", "--no-figures")
    commands = (
        ("fly", *short, "--out", "one", "--in-process"),
        ("compare", "one", "one"),
        ("runs", "list", "."),
        ("aircraft",),
        ("aircraft", "aerosonde"),
        ("trim", "paper/scenario1", "--airspeed", "50"),
        ("design", "aerosonde", "--law", "tube"),
        ("identify", "own:aerosonde", "--cruise", "24"),
    )
    absent = (*LAB_PACKAGES, "dask")
    done = run_without(absent, tmp_path, "-c", IN_TURN, json.dumps(commands))
    assert re.findall(r"^(\d+) from ", done.stderr, re.MULTILINE) == ["0"] * 8, done.stderr
    marked = run_without((*absent, "aiohttp"), tmp_path, "-m", "gcs", "--help").stdout
    lines = re.findall(r"^ *│? *([\w-]+) .*Needs the extra", marked, re.MULTILINE)
    lab = ["baseline", "campaign", "estimate", "replay-fault", "reproduce", "sweep"]
    assert lines == ["web", *lab], marked


@pytest.mark.parametrize(
    ("package", "command", "extra"),
    [
        ("SALib", ("campaign", "campaigns/uncertainty"), "lab"),
        ("distributed", ("sweep", "paper/scenario1"), "lab"),
        ("jinja2", ("baseline", "paper/scenario1"), "lab"),
        ("scipy", ("trim", "paper/scenario1"), "lab"),
        ("pymavlink", ("wireshark",), "tools"),
        ("aiohttp", ("web",), "web"),
        ("textual_serve", ("web",), "web"),
        ("foxglove", ("up", "paper/scenario1", "--free-ports", "--foxglove"), "foxglove"),
    ],
)
def test_a_missing_package_is_one_line(
    package: str, command: tuple[str, ...], extra: str, tmp_path: Path
) -> None:
    done = run_without([package], tmp_path, "-m", "gcs", *command)
    assert done.returncode == 2
    first, hint = done.stderr.splitlines()
    assert first.startswith("error: gcs " if extra != "foxglove" else "error: --foxglove needs ")
    assert package in first
    found = re.fullmatch(rf"hint: pip install (.*) \(the extra `{extra}`\)", hint)
    assert found is not None
    declared = PROJECT["optional-dependencies"][extra]
    assert [name.lower() for name in shlex.split(found[1])] == [name.lower() for name in declared]


def test_other_peoples_programs_need_pymavlink(tmp_path: Path) -> None:
    program = "mavlink_defs.runtime.run_with_dialect"
    done = run_without(TOOLS_PACKAGES, tmp_path, "-m", program, "mavlogdump.py")
    assert done.returncode == 2
    first, hint = done.stderr.splitlines()
    assert "ftc-mavlink needs pymavlink" in first
    (pinned,) = PROJECT["optional-dependencies"]["tools"]
    assert hint.endswith(f"hint: pip install {pinned} (the extra `tools`)")


def test_the_packages_match_the_extra() -> None:
    names = {re.split(r"[>\[=]", name)[0] for name in PROJECT["optional-dependencies"]["lab"]}
    assert names - {"markdown-it-py", "numba"} == {
        name.replace("distributed", "dask") for name in (*LAB_PACKAGES, *DESIGN_PACKAGES)
    }


def test_what_is_declared_and_extra_as_well_is_the_same() -> None:
    """What the installed package brings for commands that `make fly` does without."""
    core = PROJECT["dependencies"]
    extras = {extra: set(names) for extra, names in PROJECT["optional-dependencies"].items()}
    both = {extra: names & {*core} for extra, names in extras.items() if names & {*core}}
    assert both == {"lab": {"scipy>=1.15"}, "tools": {"pymavlink==2.4.50"}}
