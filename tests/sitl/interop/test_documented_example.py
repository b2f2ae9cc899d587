"""The program in docs/how-to/clients.md runs as it stands there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from standing import Standing

pytestmark = pytest.mark.sitl

DOCUMENT = Path(__file__).parents[3] / "docs" / "how-to" / "clients.md"


def test_the_mavsdk_program(fleet: Standing) -> None:
    [program] = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    assert program.count(":14550") == 1
    done = subprocess.run(
        [sys.executable, "-c", program.replace(":14550", f":{fleet.port}")],
        capture_output=True,
        text=True,
        timeout=600.0,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(r"^K1_ROLL 45\.0 LAMBDA1 0\.46", done.stdout, re.MULTILINE)
    assert "MissionProgress(current=2, total=3)" in done.stdout
