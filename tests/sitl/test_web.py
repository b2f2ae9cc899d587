"""The dashboard in a browser: a headless Chromium that presses keys, and the processes behind."""

import asyncio
import contextlib
import io
import signal
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from aiohttp import ClientSession, WSServerHandshakeError
from browser import Page, browser, until
from flying import TIMEOUT_S, scenario_tree, wait_until
from needs import needs
from PIL import Image
from station import BAD_INPUT, Up, failed, up

pytestmark = pytest.mark.sitl

VIEW = "web --view"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    folder = tmp_path_factory.mktemp("fleet")
    with up(folder, tree=scenario_tree(faults=[])) as fleet:
        yield fleet


@contextlib.contextmanager
def serving(fleet: Up, *options: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A `gcs web`: its address and process, which a test ends, or else is killed."""
    popen = fleet.begin("web", "--listen", f"127.0.0.1:{free_port()}", *options)
    try:
        assert popen.stdout is not None
        line = popen.stdout.readline()
        assert line.startswith(f"dashboard of {fleet.hub} at http://127.0.0.1:"), (
            popen.communicate()
        )
        assert ("(read-only)" in line) == ("--control" not in options)
        yield line.split(" at ")[1].split()[0], popen
    finally:
        popen.kill()
        popen.communicate()


@pytest.fixture
def url(fleet: Up, request: pytest.FixtureRequest) -> Iterator[str]:
    """Address of a `gcs web`, with options from the test's parameter; Ctrl-C ends it well."""
    with serving(fleet, *getattr(request, "param", ())) as (address, popen):
        yield address
        popen.send_signal(signal.SIGINT)
        stdout, stderr = popen.communicate(timeout=TIMEOUT_S)
        assert (popen.returncode, stderr) == (0, "")
        assert stdout.endswith("stopped\n")
        wait_until(lambda: not views_of(fleet), "no dashboard is left")


def free_port() -> int:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


def views_of(fleet: Up) -> set[int]:
    """Process ids of the dashboards of browsers."""
    listed = subprocess.run(
        ["ps", "-eww", "-o", "pid,args"], capture_output=True, text=True, check=True
    )
    lines = [line for line in listed.stdout.splitlines() if VIEW in line and fleet.hub in line]
    return {int(line.split()[0]) for line in lines}


def differing(before: bytes, after: bytes) -> float:
    """Return the share of differing pixels of two pictures."""
    first, second = (
        np.asarray(Image.open(io.BytesIO(png)).convert("L")) for png in (before, after)
    )
    return float(np.mean(first != second))


def states(fleet: Up) -> list[tuple[bool, str]]:
    return [(each["armed"], each["mode"]) for each in fleet.gcs_json("status")["vehicles"]]


@needs("chromium")
def test_a_key_changes_what_a_browser_shows(url: str, tmp_path: Path) -> None:
    async def look() -> tuple[bytes, bytes]:
        async with browser(tmp_path) as page:
            await page.open(url)
            await page.shows("Fleet", "3 UAVs", "LOITER", "read-only")
            await asyncio.sleep(1.0)  # the terminal fades in
            before = await page.screenshot()
            await page.press("6")
            await page.shows("notice", "holds profile of 3 segments")
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


def test_pages_of_other_sites_are_refused(url: str) -> None:
    async def statuses() -> list[int]:
        headers: list[dict[str, str]] = [
            {},
            {"Origin": url},
            {"Origin": "http://example.com"},
            {"Host": "example.com"},
            {"Host": "example.com", "Origin": "http://example.com"},
        ]
        async with ClientSession() as session:
            return [(await session.get(url, headers=each)).status for each in headers]

    assert asyncio.run(statuses()) == [200, 200, 403, 403, 403]


def test_a_view_ends_with_its_server(fleet: Up) -> None:
    async def look(url: str, popen: subprocess.Popen[str]) -> None:
        async with ClientSession() as session, session.ws_connect(f"{url}/ws") as connection:
            await connection.receive()
            assert len(views_of(fleet)) == 1
            popen.kill()

    with serving(fleet) as (url, popen):
        asyncio.run(look(url, popen))
    wait_until(lambda: not views_of(fleet), "no dashboard is left")


def test_one_browser_too_many_is_refused_until_another_has_gone(fleet: Up) -> None:
    async def page_of(session: ClientSession, url: str) -> tuple[int, str]:
        async with session.get(url) as answer:
            return answer.status, await answer.text()

    async def look(url: str) -> None:
        async with ClientSession() as session:
            first = await session.ws_connect(f"{url}/ws")
            async with session.ws_connect(f"{url}/ws") as second:
                for connection in (first, second):
                    await connection.receive(TIMEOUT_S)
                status, text = await page_of(session, url)
                assert status == 503
                assert text.startswith("2 dashboards are open, as many as this server has: close")
                assert "--views" in text
                with pytest.raises(WSServerHandshakeError) as refused:
                    await session.ws_connect(f"{url}/ws")
                assert refused.value.status == 503
                assert len(views_of(fleet)) == 2
                await first.close()
                async with asyncio.timeout(TIMEOUT_S):
                    while (await page_of(session, url))[0] != 200:
                        await asyncio.sleep(0.05)
                async with session.ws_connect(f"{url}/ws") as third:
                    await third.receive(TIMEOUT_S)
                assert not second.closed

    with serving(fleet, "--views", "2") as (url, _):
        asyncio.run(look(url))


def test_a_port_in_use_is_one_message(fleet: Up, url: str) -> None:
    address = url.removeprefix("http://")
    text = failed(fleet.gcs("web", "--listen", address), BAD_INPUT)
    port = address.rpartition(":")[2]
    assert f"--listen: port {port} of 127.0.0.1 is in use" in text
    text = failed(fleet.gcs("web", "--listen", "nowhere"), BAD_INPUT)
    assert "--listen: expected host:port" in text


async def press_to_arm(page: Page, question: str | None) -> None:
    """Press what arms all, and confirms it once a question is shown, if one is expected."""
    for key in ("*", "s", "a"):
        await page.press(key)
        await asyncio.sleep(0.3)
    if question is not None:
        await page.shows(question)
    await page.press("\r")
    await asyncio.sleep(0.3)


async def press_everything_else(page: Page) -> None:
    """Press each other key that commands vehicles, or confirms or fills in a form that does."""
    for key in ("m", "\r", "r", "C", "\r"):
        await page.press(key)
        await asyncio.sleep(0.3)
    for panel in "345":
        for key in (panel, "n", "u", "d", "w", "g", "f", "\r", "\r", "\x13"):
            await page.press(key)
            await asyncio.sleep(0.1)
        await page.press("\x1b")


@needs("chromium")
@pytest.mark.parametrize("url", [(), ("--control",)], ids=["read_only", "control"], indirect=True)
def test_keys_command_vehicles_only_with_control(
    url: str, fleet: Up, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    control = "control" in request.node.name.rpartition("[")[2]

    async def work() -> None:
        async with browser(tmp_path) as page:
            await page.open(url)
            await page.shows("Fleet", "3 UAVs", "LOITER")
            await asyncio.sleep(1.0)
            await press_to_arm(page, "begins for all" if control else None)
            if control:
                await until(lambda: all(armed for armed, _ in states(fleet)))
            else:
                await press_everything_else(page)

    before = states(fleet)
    assert not any(armed for armed, _ in before)
    asyncio.run(work())
    if not control:
        assert states(fleet) == before
        listed = fleet.gcs_json("fault", "list")
        assert not any(vehicle["faults"] for vehicle in listed)
