"""docs/how-to/your-aircraft.md, its commands run as they stand there, from top to bottom."""

import json
import re
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest
from flying import BIN, TIMEOUT_S, environment

pytestmark = [
    pytest.mark.sitl,
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("jsbsim") is None, reason="jsbsim is missing: pip install jsbsim"),
]

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "your-aircraft.md").read_text()


def commands_of(section: str) -> list[str]:
    text = PAGE.split(f"## {section}\n")[1].split("\n## ")[0]
    return re.findall(r"^    (.+)$", text, re.MULTILINE)


def run(command: str, folder: Path) -> str:
    """Run a command of the page; flights in process, since ports of others may be in use."""
    env = environment()
    env["PATH"] = f"{BIN}:{env['PATH']}"
    in_process = re.sub("^gcs fly ", "gcs fly --in-process ", command)
    done = subprocess.run(
        ["bash", "-c", in_process],
        cwd=folder,
        env=env,
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    assert "Traceback" not in done.stderr
    return done.stdout


def test_from_an_xml_file_to_a_surviving_formation_in_ten_commands(tmp_path: Path) -> None:
    install, *commands = commands_of("In ten commands")
    assert install.startswith("pip install ")
    assert len(commands) == 9
    said = [run(command, tmp_path) for command in commands]
    copied, identified, shown, flown, designed, healthy, weak, stuck, again = said
    assert copied == designed == ""
    assert "nothing speaks against it" in identified
    assert "dutch roll" in shown
    assert "Largest error after 1 s" in flown
    assert "diagnosed" not in healthy + weak
    assert re.findall(r"UAV (\d) diagnosed its (\w+) as lost", stuck) == [("1", "aileron")]
    (delay_ms,) = re.findall(r"([\d.]+) ms after the fault's start", stuck)
    assert float(delay_ms) <= 300.0
    assert "stay at their nominal values" in again
    summary = json.loads((tmp_path / "runs" / "healthy" / "summary.json").read_text())
    assert summary["completed"]
    assert summary["saving"] > 0.999
    (found,) = (tmp_path / "runs").glob("*aileron*/summary.json")
    errors = json.loads(found.read_text())["uavs"][0]["max_error"]
    assert errors["roll"] < 6.0


def test_the_other_commands_of_the_page(tmp_path: Path) -> None:
    sections = re.findall(r"^## (.+)$", PAGE, re.MULTILINE)[1:]
    commands = [command for section in sections for command in commands_of(section)]
    assert len(commands) == 7
    for command in commands:
        if "path/to" not in command:
            run(command, tmp_path)
