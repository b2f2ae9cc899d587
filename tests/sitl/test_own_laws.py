"""Laws and triggers of a project and of files, over UDP, as tutorial and docs/how-to say."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from own_laws import COMPILER, TRIGGERS, C, build, write_law, write_trigger

from gcs.commands.new import PROJECT
from gcs.fleet.flight import fly_and_record
from gcs.scenario.model import load_scenario

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).parents[2]
TUTORIAL = (ROOT / "docs" / "tutorial" / "law.md").read_text()
C_LAWS = (ROOT / "docs" / "how-to" / "c-laws.md").read_text()
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


def run(
    *command: str, folder: Path, path: str = "", status: int = 0
) -> subprocess.CompletedProcess[str]:
    """Run a module of ours or of others in a folder; `path` comes before ours."""
    paths = os.pathsep.join(filter(None, [path, str(ROOT)]))
    done = subprocess.run(
        [sys.executable, "-m", *command],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": paths, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.returncode == status, done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    return done


def install(project: Path, site: Path) -> str:
    """Do what pip does for a project: metadata in a folder of the path; return that path."""
    described = tomllib.loads((project / "pyproject.toml").read_text())["project"]
    folder = site / "my_law-0.1.0.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: my-law\nVersion: 0.1.0\n")
    groups = (
        "\n".join([f"[{group}]", *(f"{name} = {value}" for name, value in points.items())])
        for group, points in described["entry-points"].items()
    )
    (folder / "entry_points.txt").write_text("\n\n".join(groups) + "\n")
    return os.pathsep.join([str(site), str(project)])


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A new project, and the path on which it is installed."""
    folder = tmp_path_factory.mktemp("project")
    run("gcs", "new", "--project", "my-law", folder=folder)
    return folder / "my-law", install(folder / "my-law", folder / "site")


def test_the_tests_of_a_new_project_pass(project: tuple[Path, str]) -> None:
    folder, path = project
    done = run("pytest", "-q", "-p", "no:cacheprovider", folder=folder, path=path)
    assert "4 passed" in done.stdout


def test_its_law_is_the_one_of_the_tutorial(project: tuple[Path, str]) -> None:
    folder, _ = project
    law, *_ = re.findall(r"```python\n(.*?)```", TUTORIAL, re.DOTALL)
    assert law == (folder / "my_law" / "law.py").read_text()
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*.*") if path.is_file()}
    for named in re.findall(r"^\| `([^`]+)` \|", TUTORIAL, re.MULTILINE):
        assert named in names
    texts = [name for name in names if not name.endswith(".pyc")]
    assert not any(re.search("PACKAGE|PROJECT", (folder / n).read_text()) for n in texts)


def test_gcs_lists_it_with_its_package(project: tuple[Path, str]) -> None:
    folder, path = project
    listed = json.loads(run("gcs", "laws", "--json", folder=folder, path=path).stdout)
    own = listed[-1]
    assert (own["name"], own["package"]) == ("my_law", "my-law 0.1.0")
    assert own["written"] == "compiled Python"
    shown = run("gcs", "laws", "show", "my_law", folder=folder, path=path).stdout
    assert re.search(r"limit_deg +│ 40.0 +│ \(0, 90\] deg +│ Largest deflection", shown)
    assert "my_law/first" in run("gcs", "scenarios", folder=folder, path=path).stdout


def test_a_campaign_of_it_is_not_continued_by_other_code(
    project: tuple[Path, str], tmp_path: Path
) -> None:
    folder, path = project
    short = (folder / "campaign.yaml").read_text() + "\nduration_s: 0.1\n"
    text = re.sub(r"\nduration_s.*", "", short).replace("draws: 20", "draws: 2")
    text = text.replace("  own: {}", "  own: {duration_s: 0.05}")
    text = text.replace("{kind: pid}}", "{kind: pid}, duration_s: 0.05}")
    (tmp_path / "campaign.yaml").write_text(text)
    command = ("gcs", "campaign", "campaign.yaml", "--jobs", "1", "--out", "out", "--quiet")
    run(*command, folder=tmp_path, path=path)
    run(*command, folder=tmp_path, path=path)
    law = folder / "my_law" / "law.py"
    before = law.read_text()
    try:
        law.write_text(before.replace("slow = -now", "slow = -1.5 * now"))
        done = run(*command, folder=tmp_path, path=path, status=2)
    finally:
        law.write_text(before)
    assert re.search(r"plugins\.my_law is '\w{16}', the folder has '\w{16}'", done.stderr)


def summary(folder: Path, scenario: str, *options: str) -> tuple[object, object]:
    """Fly, and return what was sent and how it was tracked."""
    done = run("gcs", "fly", scenario, "--json", "--record", "none", *options, folder=folder)
    flown = json.loads(done.stdout)
    assert flown["completed"]
    return [[uav["channels"], uav["iae"]] for uav in flown["uavs"]], flown["saving"]


@needs_compiler
def test_three_ways_of_writing_a_law_and_a_trigger_fly_the_same_over_udp(tmp_path: Path) -> None:
    flown = []
    for way in TRIGGERS:
        folder = tmp_path / way
        write_law(folder, way)
        write_trigger(folder / "t", way)
        (folder / "s.yaml").write_text(
            "extends: paper/scenario1\nduration_s: 0.6\nfaults: []\n"
            "controller: {kind: mine.py:Mine}\ntrigger: {mode: t/mine.py:Mine, b2_deg: 0.2}\n"
        )
        flown.append(summary(folder, "s.yaml", "--free-ports", "--out", "udp"))
        flown.append(summary(folder, "s.yaml", "--in-process", "--out", "here"))
    assert all(one == flown[0] for one in flown[1:])
    assert 0.0 < float(str(flown[0][1])) < 1.0


@needs_compiler
def test_the_law_in_c_of_the_documentation(tmp_path: Path) -> None:
    def block(language: str) -> str:
        (text,) = re.findall(rf"    ```{language}\n(.*?)    ```", C_LAWS, re.DOTALL)
        return re.sub("^    ", "", str(text), flags=re.MULTILINE)

    (tmp_path / "my_law.py").write_text(block("python"))
    folder = run("gcs", "laws", "header", "--folder", folder=tmp_path).stdout.strip()
    assert (Path(folder) / "ftc_law.h").is_file()
    structs = run("gcs", "laws", "header", "my_law.py:MyLaw", folder=tmp_path).stdout
    for struct in re.findall(r"struct \w+ \{.*?\};", structs, re.DOTALL):
        assert struct in block("c")
    build(tmp_path, block("c"), "my_law")
    options = ("--set", "controller.kind=my_law.py:MyLaw", "--set", "duration_s=0.5")
    summary(tmp_path, "paper/scenario1", "--free-ports", "--out", "out", *options)


def test_the_trigger_and_the_guidance_law_of_the_tutorial(tmp_path: Path) -> None:
    _, trigger, guidance = re.findall(r"```python\n(.*?)```", TUTORIAL, re.DOTALL)
    (tmp_path / "trigger.py").write_text(trigger)
    options = ("--set", "trigger.mode=trigger.py:EveryNth", "--set", "duration_s=0.5")
    sent, _ = summary(tmp_path, "paper/scenario1", "--in-process", "--out", "out", *options)
    assert isinstance(sent, list)
    assert 1 < sent[0][0]["elevator"]["events"] <= 1 + 500 // 7
    (tmp_path / "guidance.py").write_text(guidance)
    options = ("--set", "guidance.kind=guidance.py:Gentle", "--set", "duration_s=0.5")
    summary(tmp_path, "missions/race_track", "--free-ports", "--out", "mission", *options)


FAILING = """
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command


class Bad(LawParameters):
    @staticmethod
    def step(now, aircraft, gains, state):
        if now.t > 0.2:
            raise ValueError("too late")
        return Command((0.0, 0.0, 0.0), 900.0, ALL)
"""


@pytest.mark.parametrize("restart", ["never", "on-failure"])
def test_a_failing_law_ends_a_flight_over_udp_with_its_name(tmp_path: Path, restart: str) -> None:
    (tmp_path / "bad.py").write_text(FAILING)
    (tmp_path / "s.yaml").write_text(
        "extends: paper/scenario1\nduration_s: 1\nfaults: []\ncontroller: {kind: bad.py:Bad}\n"
    )
    done = run(
        *("gcs", "fly", "s.yaml", "--free-ports", "--out", "out", "--restart", restart),
        folder=tmp_path,
        status=1,
    )
    place = f"{tmp_path}/bad.py:10: ValueError: too late"
    assert f": the law bad.py:Bad failed at 0.201 s: {place}" in done.stderr
    assert "bad.py:Bad is plain Python: its step takes about ten times as long" in done.stderr
    assert place in json.loads((tmp_path / "out" / "summary.json").read_text())["loss"]


@needs_compiler
def test_a_library_that_crashes_is_named(tmp_path: Path) -> None:
    write_law(tmp_path, "library")
    crash = (
        "    if (in->t > 0.2) *(volatile int *)(intptr_t)s->integral = 1;\n    return 0;\n}\n\nFTC"
    )
    build(tmp_path, C.replace("    return 0;\n}\n\nFTC", crash))
    (tmp_path / "s.yaml").write_text(
        "extends: paper/scenario1\nduration_s: 1\ncontroller: {kind: mine.py:Mine}\n"
    )
    command = ("gcs", "fly", "s.yaml", "--free-ports", "--out", "out", "--quiet")
    done = run(*command, folder=tmp_path, status=1)
    assert "ended by signal 11; it flew the shared library mine.py:Mine" in done.stderr


def test_the_template_has_no_file_that_a_project_lacks() -> None:
    assert (PROJECT / "pyproject.toml").is_file()


COUNTING = """
import numpy as np

from ftc_autopilot.control.laws.pid import Pid, pid_law
from ftc_autopilot.control.step import ALL, Command
from mavlink_defs.runtime.jit import compiled


class Counting(Pid):
    kind: str = "counting"
    STATE = np.dtype([*Pid.STATE.descr, ("steps", "i8")])

    @staticmethod{decorator}
    def step(now, aircraft, gains, state):
        command = pid_law(now, aircraft, gains, state)
        state["steps"] += 1
        return Command(command.delta, 800.0 + 0.001 * state["steps"], ALL)
"""


@pytest.mark.parametrize("decorator", ["", "\n    @compiled"])
def test_a_law_goes_on_with_its_state_after_a_crash_of_its_process(
    tmp_path: Path, decorator: str
) -> None:
    (tmp_path / "law.py").write_text(COUNTING.format(decorator=decorator))
    (tmp_path / "s.yaml").write_text(
        "extends: paper/scenario1\nduration_s: 1.6\nfaults: []\n"
        "controller: {kind: law.py:Counting}\n"
    )
    scenario = load_scenario(tmp_path / "s.yaml")
    flight = fly_and_record(scenario, tmp_path, restart=True, crashes={1: [300]})
    assert flight.restarts == (1, 0, 0)
    steps = (flight.signals["demand"][:, 0, 3] - 800.0) / 0.001
    assert steps[299] == pytest.approx(300)
    assert steps[-1] > 500
    assert steps[-1] == pytest.approx(np.isfinite(steps).sum(), abs=2)
