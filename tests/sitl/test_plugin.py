"""The pytest plugin as others use it: docs/tutorial/test.md in a project of its own."""

import re
import signal
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from flying import TIMEOUT_S, environment, processes_of, wait_until

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).parents[2]
REGISTERED = any(e.value == "gcs.pytest_plugin" for e in entry_points(group="pytest11"))

WRONG = """
import pytest

pytestmark = pytest.mark.ftc_scenario("my.yaml", mode="in_process")

def test_sent(ftc_flight):
    assert ftc_flight.uav(2).rudder.sent <= 3

def test_error(ftc_flight):
    ftc_flight.uav(2).assert_error_below(airspeed_m_s=0.1, after_s=4.0)

def test_dwell(ftc_flight):
    ftc_flight.uav(2).aileron.assert_dwell(min_s=0.5)

def test_completed(ftc_launch):
    fleet = ftc_launch("my.yaml")
    fleet.begin()
    fleet.run_until(0.2)
    fleet.end().assert_completed()

def test_pauses_change_nothing(ftc_launch, ftc_fly):
    fault = {"actuator": "rudder", "effectiveness": 0.5, "bias_deg": 1.0}
    fleet = ftc_launch("my.yaml", duration_s=1.5, faults=[])
    fleet.begin()
    assert fleet.time_s == 0.0
    fleet.run_until(0.7)
    fleet.uav(2).set_fault(**fault)
    fleet.run_for(0.1)
    assert fleet.time_s == 0.8
    stepwise = fleet.run_to_end()
    faults = [{"uav": 2, "start_s": 0.7, **fault}]
    at_once = ftc_fly("my.yaml", duration_s=1.5, faults=faults, mode="in_process")
    assert (stepwise.recording.states == at_once.recording.states).all()
    assert stepwise.uav(2).rudder.sent == at_once.uav(2).rudder.sent > 0

@pytest.mark.ftc_scenario("my.yaml", duration_s=-1)
def test_scenario(ftc_fleet):
    pass
"""

BUNDLED = """
import pytest

@pytest.mark.ftc_scenario("paper/scenario1", mode="in_process", duration_s=0.05)
def test_by_name(ftc_flight):
    ftc_flight.assert_completed()

@pytest.mark.ftc_scenario("paper/scenario7")
def test_unknown(ftc_flight):
    pass
"""

FOR_EVER = """
import time

def test_it(ftc_launch):
    ftc_launch("my.yaml")
    open("up", "w").close()
    time.sleep(300)
"""


def block_of(document: str, language: str) -> str:
    text = (ROOT / "docs" / document).read_text()
    found = re.search(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[1]


def documented_message() -> str:
    text = (ROOT / "docs" / "tutorial" / "test.md").read_text()
    found = re.search(r"^    AssertionError: .*?\n\n", text, re.MULTILINE | re.DOTALL)
    assert found is not None
    return " ".join(found[0].split())


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "pytest.ini").write_text("[pytest]\nfilterwarnings = error\n")
    (tmp_path / "my.yaml").write_text(block_of("reference/scenario.md", "yaml"))
    return tmp_path


def start(project: Path, *options: str) -> subprocess.Popen[str]:
    plugin = [] if REGISTERED else ["-p", "gcs.pytest_plugin"]
    basetemp = f"--basetemp={project / 'temp'}"
    return subprocess.Popen(
        [sys.executable, "-m", "pytest", "--strict-markers", *plugin, basetemp, *options],
        cwd=project,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment(PYTHONPATH=str(ROOT)),
    )


def run(project: Path, *options: str) -> tuple[int, str]:
    popen = start(project, *options)
    output, _ = popen.communicate(timeout=TIMEOUT_S)
    assert processes_of(project / "temp") == {}
    return popen.returncode, output


def test_the_documented_example_passes(project: Path) -> None:
    (project / "test_my.py").write_text(block_of("tutorial/test.md", "python"))
    status, output = run(project)
    assert status == 0, output
    assert "4 passed" in output


def test_a_wrong_expectation_says_what_came_instead_and_where(project: Path) -> None:
    (project / "test_wrong.py").write_text(WRONG)
    status, output = run(project)
    assert status == 1
    assert "4 failed, 1 passed, 1 error" in output, output
    number = r"[\d.e-]+"
    for line in (
        rf"assert {number} <= 3\n.*where {number} = <rudder of UAV 2: {number} sent>\.sent",
        re.escape(documented_message()),
        rf"UAV 2 aileron: expected transmissions at least 500 ms apart, got {number} ms between ",
        r"expected a flight of 6 s, got 0\.200 s: it was stopped",
        r"<fleet of 'two UAVs' at 0\.200 s>, files in ",
        r"changes: duration_s: expected \(0, 86400\] s, got -1\n(?!\nDuring)",
    ):
        assert re.search(line, output), f"{line}\n{output}"


def test_bundled_scenarios_have_names(project: Path) -> None:
    (project / "test_bundled.py").write_text(BUNDLED)
    status, output = run(project)
    assert status == 1
    assert "1 passed, 1 error" in output, output
    assert "paper/scenario7: no such file, and no bundled scenario of that name" in output


def test_nothing_is_left_of_an_interrupted_test(project: Path) -> None:
    (project / "test_for_ever.py").write_text(FOR_EVER)
    popen = start(project)
    try:
        wait_until(lambda: (project / "up").exists() or popen.poll() is not None, "fleet is up")
        assert len(processes_of(project / "temp")) == 3
        popen.send_signal(signal.SIGINT)
        output, _ = popen.communicate(timeout=TIMEOUT_S)
    finally:
        popen.kill()
        popen.wait()
    assert "KeyboardInterrupt" in output
    assert processes_of(project / "temp") == {}
