"""The dashboard in a browser: a headless Chromium that presses keys, and the processes behind."""

import asyncio
import io
import signal
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from aiohttp import ClientSession, WSServerHandshakeError
from browser import browser, until
from flying import TIMEOUT_S, processes_of, run, scenario_tree, wait_until
from needs import needs
from PIL import Image
from station import Up, failed, up

pytestmark = pytest.mark.sitl

VIEW = "web --view"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    folder = tmp_path_factory.mktemp("fleet")
    with up(folder, "--speed", "0.3", tree=scenario_tree(faults=[])) as fleet:
        yield fleet


@pytest.fixture
def url(fleet: Up, request: pytest.FixtureRequest) -> Iterator[str]:
    """Address of a `gcs web`, with options from the test's parameter; Ctrl-C ends it well."""
    options = getattr(request, "param", ())
    popen = fleet.begin("web", "--listen", f"127.0.0.1:{free_port()}", *options)
    try:
        assert popen.stdout is not None
        line = popen.stdout.readline()
        assert line.startswith(f"dashboard of {fleet.hub} at http://127.0.0.1:"), (
            popen.communicate()
        )
        assert ("(read-only)" in line) == ("--control" not in options)
        yield line.split(" at ")[1].split()[0]
        views = views_of(fleet)
        popen.send_signal(signal.SIGINT)
        stdout, stderr = popen.communicate(timeout=TIMEOUT_S)
        assert (popen.returncode, stderr) == (0, "")
        assert stdout.endswith("stopped\n")
        wait_until(lambda: not views_of(fleet), f"none of {views} is left")
    finally:
        popen.kill()
        popen.wait()


def free_port() -> int:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


def views_of(fleet: Up) -> set[int]:
    """Process ids of the dashboards of browsers."""
    listed = subprocess.run(["ps", "-eo", "pid,args"], capture_output=True, text=True, check=True)
    lines = [line for line in listed.stdout.splitlines() if VIEW in line and fleet.hub in line]
    return {int(line.split()[0]) for line in lines}


def differing(before: bytes, after: bytes) -> float:
    """Return the share of differing pixels of two pictures."""
    first, second = (
        np.asarray(Image.open(io.BytesIO(png)).convert("L")) for png in (before, after)
    )
    return float(np.mean(first != second))


def armed(fleet: Up) -> list[bool]:
    return [vehicle["armed"] for vehicle in fleet.gcs_json("status")["vehicles"]]


@needs("chromium")
def test_a_key_changes_what_a_browser_shows(url: str, tmp_path: Path) -> None:
    async def look() -> tuple[bytes, bytes]:
        async with browser(tmp_path) as page:
            await page.open(url)
            await page.shows("1 Fleet", "3 UAVs", "LOITER")
            await asyncio.sleep(1.0)  # the terminal fades in
            before = await page.screenshot()
            await page.press("6")
            await page.shows("Events", "severity")
            await asyncio.sleep(0.5)
            after = await page.screenshot()
            assert all(request.startswith(url) for request in page.requests), page.requests
            assert not page.failures
            return before, after

    before, after = asyncio.run(look())
    (tmp_path / "before.png").write_bytes(before)
    (tmp_path / "after.png").write_bytes(after)
    assert len(np.unique(np.asarray(Image.open(io.BytesIO(before)).convert("L")))) > 20
    assert differing(before, after) > 0.02
