"""The package as pip installs it: wheel and sdist are built, and the wheel flies anywhere.

The flights run without the compiler, so that none of them waits for it.
"""

import shutil
import subprocess
import sys
import tomllib
import zipfile
from email.parser import HeaderParser
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba
import pytest
from flying import assert_one_message, environment, summary_of

from ftc_lab.reproduce import FILES

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).parents[2]
TIMEOUT_S = 600.0
NOT_SOURCES = shutil.ignore_patterns(
    ".git", ".venv", ".*_cache", ".hypothesis", "__pycache__", "build", "dist"
)


def not_sources(folder: str, names: list[str]) -> set[str]:
    """Return what a copy leaves out: results of builds and, at the top, of flights."""
    results = {"runs"} & set(names) if Path(folder) == ROOT else set()
    return NOT_SOURCES(folder, names) | results


def build(source: Path, dist: Path, *targets: str) -> None:
    """Run the build backend with what is installed here, as ``--no-build-isolation`` does."""
    command: list[str | Path] = [sys.executable, "-m", "hatchling", "build", "-d", dist]
    for target in targets:
        command += ["-t", target]
    done = subprocess.run(
        command, cwd=source, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def content(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as file:
        return {name: file.read(name) for name in file.namelist()}


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Wheel and sdist, built from a copy: a build writes the dialect that other tests read."""
    source, dist = tmp_path_factory.mktemp("source") / "copy", tmp_path_factory.mktemp("dist")
    shutil.copytree(ROOT, source, ignore=not_sources)
    (source / "mavlink_defs" / "dialect.py").unlink()
    build(source, dist, "sdist", "wheel")
    return dist


@pytest.fixture(scope="module")
def wheel(dist: Path) -> Path:
    (wheel,) = dist.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the programs of a virtual environment that holds the wheel."""
    return installed(wheel, tmp_path_factory.mktemp("installed"))


def installed(wheel: Path, folder: Path) -> Path:
    """Make a virtual environment that holds the wheel; return the folder of its programs."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    install(folder / "bin", wheel)
    # this environment gives the dependencies; its own .pth files, and with them the
    # project itself, are not read on the way
    (packages,) = folder.glob("lib/python*/site-packages")
    dependencies = (path for path in sys.path if path.endswith("-packages"))
    (packages / "dependencies.pth").write_text("\n".join(dependencies))
    return folder / "bin"


def install(programs: Path, *what: str | Path) -> None:
    """Install a wheel or a project in a virtual environment, without looking for others."""
    pip: tuple[str | Path, ...] = ("pip", "--python", programs / "python", "install", "--quiet")
    options = ("--disable-pip-version-check", "--no-compile", "--no-index", "--no-deps")
    command = [sys.executable, "-m", *pip, *options, *what]
    subprocess.run(command, check=True, timeout=TIMEOUT_S)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An empty folder to start commands from."""
    empty = tmp_path / "empty"
    empty.mkdir()
    return empty


def run(
    programs: Path, folder: Path, *command: str | Path, **changes: str
) -> subprocess.CompletedProcess[str]:
    program, *arguments = command
    return subprocess.run(
        [programs / program, *arguments],
        cwd=folder,
        env=environment(**{"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": "", **changes}),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )


def run_well(programs: Path, folder: Path, *command: str | Path, **changes: str) -> str:
    done = run(programs, folder, *command, **changes)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_says_what_it_is_and_has_what_it_needs(wheel: Path) -> None:
    files = content(wheel)
    project: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (name,) = [name for name in files if name.endswith(".dist-info/METADATA")]
    metadata = HeaderParser().parsestr(files[name].decode())
    assert metadata["Version"] == project["version"] == version("ftc-sitl")
    assert metadata["License-Expression"] == "BSD-3-Clause"
    assert metadata.get_all("License-File") == ["LICENSE"]
    assert "ftc-sitl authors" in metadata["Author"]
    for package in ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "ftc_lab"):
        sources = {
            path.relative_to(ROOT).as_posix()
            for path in (ROOT / package).rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        }
        assert {name for name in files if name.startswith(f"{package}/")} >= sources
        assert f"{package}/py.typed" in files
    for folder in ("scenarios", "aircraft"):
        start = f"gcs/bundled_{folder}/"
        bundled = {
            name.removeprefix(start): files[name] for name in files if name.startswith(start)
        }
        assert bundled == {
            path.relative_to(ROOT / folder).as_posix(): path.read_bytes()
            for path in (ROOT / folder).rglob("*.yaml")
        }


def test_the_sdist_builds_the_same_wheel(dist: Path, wheel: Path, tmp_path: Path) -> None:
    (sdist,) = dist.glob("*.tar.gz")
    subprocess.run(["tar", "-xf", sdist, "-C", tmp_path], check=True)
    (source,) = tmp_path.iterdir()
    for name in ("LICENSE", "README.md", "Makefile", "requirements.txt", "tests/conftest.py"):
        assert (source / name).is_file()
    assert not (source / "mavlink_defs" / "dialect.py").exists()
    build(source, tmp_path / "dist", "wheel")
    (again,) = (tmp_path / "dist").iterdir()
    assert content(again) == content(wheel)


def test_it_runs_from_where_it_was_installed(programs: Path, folder: Path) -> None:
    code = "import gcs, mavlink_defs; print(gcs.__file__, mavlink_defs.__file__)"
    found = run_well(programs, folder, "python", "-c", code).split()
    assert all(Path(path).is_relative_to(programs.parent) for path in found)


def test_versions(programs: Path, folder: Path) -> None:
    assert run_well(programs, folder, "gcs", "--version").splitlines() == [
        f"ftc-sitl {version('ftc-sitl')}",
        f"Python {sys.version.split()[0]}",
        f"pymavlink {version('pymavlink')}",
        f"numba {numba.__version__}",
    ]


def test_bundled_scenarios_are_listed_one_per_line(programs: Path, folder: Path) -> None:
    rows = run_well(programs, folder, "gcs", "scenarios").splitlines()
    scenarios = ROOT / "scenarios"
    whole, additions = (
        sorted(str(path.relative_to(scenarios).with_suffix("")) for path in scenarios.glob(pattern))
        for pattern in ("*/*.yaml", "*.yaml")
    )
    assert [row.split()[0] for row in rows] == whole + additions
    assert all(len(row.split()) > 3 for row in rows)


def test_a_new_scenario_flies_over_udp(programs: Path, folder: Path) -> None:
    run_well(programs, folder, "gcs", "new", "my.yaml")
    (folder / "short.yaml").write_text("extends: my.yaml\nduration_s: 0.05\n")
    run_well(programs, folder, "gcs", "fly", "short.yaml", "--free-ports", "--out", "run")
    summary = summary_of(folder / "run")
    assert summary["completed"] is True
    assert summary["scenario"] == "my"
    run_well(programs, folder, "gcs", "profile", "check", "my.yaml")


def test_a_new_scenario_never_overwrites(programs: Path, folder: Path) -> None:
    (folder / "my.yaml").write_text("mine")
    done = run(programs, folder, "gcs", "new", "my.yaml")
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert "my.yaml already exists" in done.stderr
    assert (folder / "my.yaml").read_text() == "mine"
    done = run(programs, folder, "gcs", "new", "my.yaml/my.yaml")
    assert done.returncode == 2
    assert "my.yaml is a file" in done.stderr


def test_a_bundled_scenario_flies_by_its_name(programs: Path, folder: Path) -> None:
    values = ("--set", "duration_s=0.02", "--quiet", "--out", "swept")
    run_well(programs, folder, "gcs", "sweep", "paper/scenario1", *values)
    assert len((folder / "swept" / "table.csv").read_text().splitlines()) == 1 + 3  # one row a UAV
    done = run(programs, folder, "gcs", "fly", "paper/scenario11")
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert "did you mean paper/scenario1 " in done.stderr


def test_the_papers_scenarios_come_along(programs: Path, folder: Path) -> None:
    code = "import inspect; from ftc_lab.commands.reproduce import reproduce as r; "
    code += "print(inspect.signature(r).parameters['scenarios'].default)"
    paper = Path(run_well(programs, folder, "python", "-c", code).strip())
    assert paper.is_relative_to(programs.parent)
    assert {f"{file}.yaml" for file in FILES} <= {path.name for path in paper.iterdir()}


def test_all_that_is_no_code_comes_along(programs: Path, folder: Path) -> None:
    """Templates and styles of reports, among others."""
    code = "import gcs; print(gcs.__path__[0])"
    installed = Path(run_well(programs, folder, "python", "-c", code).strip()).parent
    for package in ("gcs", "ftc_autopilot", "sitl_plant", "mavlink_defs", "ftc_lab"):
        files = [
            path.relative_to(ROOT)
            for path in (ROOT / package).rglob("*")
            if path.is_file() and path.suffix not in {".py", ".pyc"}
        ]
        assert not [file for file in files if not (installed / file).is_file()]


def test_an_installation_shares_the_compiled_code_of_equal_sources(
    programs: Path, folder: Path
) -> None:
    cache = "from mavlink_defs.runtime.jit import cold_parts; "
    cache += "from mavlink_defs.runtime.cache_folder import mark_warm"
    code = f"{cache}; print(cold_parts(['plant'])); mark_warm('plant')"
    changes = {"NUMBA_DISABLE_JIT": "0", "NUMBA_CACHE_DIR": str(folder / "cache")}
    assert run_well(programs, folder, "python", "-c", code, **changes) == "['plant']\n"
    here = subprocess.run(
        [sys.executable, "-c", code], env=environment(**changes), check=True, capture_output=True
    )
    assert here.stdout == b"[]\n"


def test_a_new_project_is_installed_beside_it_with_its_law_scenarios_and_aircraft(
    wheel: Path, tmp_path_factory: pytest.TempPathFactory, folder: Path
) -> None:
    programs = installed(wheel, tmp_path_factory.mktemp("with-project"))
    run_well(programs, folder, "gcs", "new", "--project", "my-law")
    aircraft = folder / "my-law" / "my_law" / "scenarios" / "aircraft"
    aircraft.mkdir()
    shutil.copy(ROOT / "aircraft" / "paper.yaml", aircraft / "mine.yaml")
    install(programs, "--no-build-isolation", folder / "my-law")
    shutil.rmtree(folder / "my-law" / "my_law")  # the installed one is meant
    assert "my-law 0.1.0" in run_well(programs, folder, "gcs", "laws", COLUMNS="200")
    assert "my_law/mine" in run_well(programs, folder, "gcs", "aircraft", COLUMNS="200")
    named = run_well(programs, folder, "gcs", "scenarios")
    assert "my_law/first" in named
    assert "mine" not in named
    (folder / "s.yaml").write_text(
        "extends: my_law/first\nduration_s: 0.05\naircraft: my_law/mine\n"
    )
    run_well(programs, folder, "gcs", "fly", "s.yaml", "--free-ports", "--out", "run")
    assert summary_of(folder / "run")["completed"] is True
