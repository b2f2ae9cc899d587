"""`gcs web`'s server with small programs in place of the dashboard: what it gives, and ends."""

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType, WSServerHandshakeError
from browser import browser, until
from flying import TIMEOUT_S, wait_until
from hypothesis import given
from hypothesis import strategies as st
from needs import needs
from test_stopping import processes_marked
from test_web import free_port

from gcs.commands.web_view import size_in

pytestmark = pytest.mark.sitl

SERVER = """
import asyncio, sys
from gcs.commands.listening import listen
from gcs.commands.web_server import serve
from mavlink_defs.endpoint import UdpAddress
host, port, most, program = sys.argv[1:]
listening = listen("--listen", UdpAddress("127.0.0.1", int(port)))
command = [sys.executable, "-SE", "-c", program]
asyncio.run(serve(command, host, listening, int(most), lambda: print("ready", flush=True)))
"""
ECHO = r"""
import os
def draw(text):
    os.write(1, b"D" + len(text).to_bytes(4, "big") + text)
os.write(1, b"__GANGLION__\n")
draw(f'{{"width": {os.environ["COLUMNS"]}, "height": {os.environ["ROWS"]}}}'.encode())
while (head := os.read(0, 5)):
    text = os.read(0, int.from_bytes(head[1:], "big"))
    if b"quit" in text:
        break
    draw(text)
"""
STUBBORN = r"""
import os, signal, time
for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
os.fork()  # one of the same group
time.sleep(1000)
"""


@contextmanager
def server(
    mark: Path, program: str, most: int = 8, host: str = "127.0.0.1"
) -> Iterator[tuple[str, "subprocess.Popen[str]"]]:
    port = free_port()
    popen = subprocess.Popen(
        [sys.executable, "-c", SERVER, host, str(port), str(most), program],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"MARK": str(mark)},
    )
    try:
        assert popen.stdout is not None
        assert popen.stdout.readline() == "ready\n"
        yield f"http://127.0.0.1:{port}", popen
    finally:
        popen.terminate()
        popen.communicate()
        for pid in processes_marked(str(mark)):
            os.kill(pid, signal.SIGKILL)


def views_of(mark: Path, popen: "subprocess.Popen[str]") -> int:
    return len(set(processes_marked(str(mark))) - {popen.pid})


async def opened(session: ClientSession, url: str) -> "ClientWebSocketResponse[bool]":
    """Open a view as soon as it has a place: a moment after the processes of another are gone."""
    async with asyncio.timeout(TIMEOUT_S):
        while True:
            try:
                return await session.ws_connect(f"{url}/ws")
            except WSServerHandshakeError as refusal:
                if refusal.status != 503:
                    raise


def is_bounded(size: dict[str, Any]) -> bool:
    width, height = int(size["width"]), int(size["height"])
    return 1 <= width <= 500 and 1 <= height <= 200


@given(st.dictionaries(st.sampled_from(["width", "height"]), st.integers(), min_size=2))
def test_every_whole_number_gives_a_bounded_size(given_: dict[str, int]) -> None:
    as_text = {key: str(value) for key, value in given_.items()}
    assert size_in(given_) == size_in(as_text)
    width, height = size_in(given_)
    assert is_bounded({"width": width, "height": height})
    if is_bounded(given_):
        assert (width, height) == (given_["width"], given_["height"])


@pytest.mark.parametrize("wrong", [True, None, 80.0, "80.0", "", "1e3", [80], {}])
def test_what_is_no_whole_number_is_no_size(wrong: Any) -> None:
    with pytest.raises(ValueError, match=r"."):
        size_in({"width": wrong, "height": 24})


def test_sizes_are_bounded_where_they_come_in(tmp_path: Path) -> None:
    async def look(url: str) -> None:
        async with ClientSession() as session:
            for query, asked in {"": (80, 24), "?width=20000&height=20000": (500, 200)}.items():
                async with session.ws_connect(f"{url}/ws{query}") as page:
                    drawn = json.loads((await page.receive(TIMEOUT_S)).data)
                    assert (drawn["width"], drawn["height"]) == asked
                    for number in (-1, 0, 10**9, 10**300):
                        await page.send_json(["resize", {"width": number, "height": number}])
                        assert is_bounded(json.loads((await page.receive(TIMEOUT_S)).data))
            for query in ("?width=1e3", "?height=", "?width=80.0&height=24"):
                async with session.get(f"{url}/ws{query}") as answer:
                    assert answer.status == 400
                    assert "expected whole numbers" in await answer.text()

    with server(tmp_path, ECHO) as (url, popen):
        asyncio.run(look(url))
        wait_until(lambda: not views_of(tmp_path, popen), "no view is left")


def test_a_message_of_no_page_ends_the_view(tmp_path: Path) -> None:
    sizes = [{"width": 80.5, "height": 24}, {"width": "80", "height": 24}, {"width": True}, None]
    texts = ["x", "{}", "[]", '["stdin"]', '["stdin", 5]', '["stdin", "\\ud800"]', "[" * 100_000]
    texts += [json.dumps(["resize", size]) for size in sizes]

    async def look(url: str) -> None:
        async with ClientSession() as session:
            for text in texts:
                async with session.ws_connect(f"{url}/ws") as page:
                    await page.receive(TIMEOUT_S)
                    await page.send_str(text)
                    assert (await page.receive(TIMEOUT_S)).type is WSMsgType.CLOSE, text[:50]
                    assert page.close_code == 1008

    with server(tmp_path, ECHO, most=len(texts)) as (url, popen):
        asyncio.run(look(url))
        wait_until(lambda: not views_of(tmp_path, popen), "no view is left")


def test_a_page_closes_when_its_process_ends(tmp_path: Path) -> None:
    async def look(url: str) -> None:
        async with ClientSession() as session, session.ws_connect(f"{url}/ws") as page:
            assert (await page.receive(TIMEOUT_S)).type is WSMsgType.CLOSE

    with server(tmp_path, "") as (url, _):
        asyncio.run(look(url))


@pytest.mark.parametrize("flooded", [False, True], ids=["quiet", "flooded"])
def test_views_that_would_not_end_are_counted_and_ended_by_force(
    flooded: bool, tmp_path: Path
) -> None:
    """With all that they have started; also one that does not read what its page sends."""

    async def look(url: str, popen: "subprocess.Popen[str]") -> None:
        async with ClientSession() as session:
            for _ in range(3):
                pages = [await opened(session, url) for _ in range(2)]
                async with session.get(f"{url}/ws") as answer:
                    assert answer.status == 503
                await until(lambda: views_of(tmp_path, popen) == 4)
                if flooded:
                    for page in pages:
                        await page.send_json(["stdin", "x" * 1_000_000])
                for page in pages:
                    page._response.close()  # without a word, as a browser that was killed
                async with asyncio.timeout(TIMEOUT_S):
                    while True:
                        assert views_of(tmp_path, popen) <= 4
                        async with session.get(url) as answer:
                            if answer.status == 200 and not views_of(tmp_path, popen):
                                break

    with server(tmp_path, STUBBORN, most=2) as (url, popen):
        asyncio.run(look(url, popen))


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0", "station.example"])
def test_names_are_accepted_by_the_letter(host: str, tmp_path: Path) -> None:
    """Those that only a look-up makes this machine's are what DNS rebinding sends."""
    ours = ["127.0.0.1", "127.0.0.2", "localhost", "LOCALHOST", "[::1]"]
    ours += {"station.example": ["station.example"], "0.0.0.0": ["192.0.2.7"]}.get(host, [])
    others = ["127.1", "2130706433", "0x7f.1", "rebind.example", "localhost.example", "[::1", ""]
    others += ["localhost."] + ["192.0.2.7"] * (host != "0.0.0.0")

    async def statuses(url: str) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        port = url.rpartition(":")[2]
        async with ClientSession() as session:
            for name in (*ours, *others):
                named = {"Host": f"{name}:{port}"}
                for headers in (named, {**named, "Origin": f"http://{name}:{port}"}):
                    async with session.get(url, headers=headers) as answer:
                        found.setdefault(name, []).append(answer.status)
                strange = {**named, "Origin": "http://rebind.other"}
                async with session.get(url, headers=strange) as answer:
                    assert answer.status == 403
        return found

    with server(tmp_path, ECHO, host=host) as (url, _):
        found = asyncio.run(statuses(url))
    assert found == {name: [200, 200] for name in ours} | {name: [403, 403] for name in others}


@needs("chromium")
def test_a_page_says_that_its_dashboard_starts(tmp_path: Path) -> None:
    shown = "document.elementFromPoint(innerWidth / 2, innerHeight / 2).innerText"

    async def look(url: str) -> None:
        async with browser(tmp_path) as page:
            await page.open(url)
            async with asyncio.timeout(TIMEOUT_S):
                while not await page.evaluate("!!document.querySelector('.xterm canvas')"):
                    await asyncio.sleep(0.05)
            assert "starting" in await page.evaluate(shown)

    with server(tmp_path, STUBBORN) as (url, _):
        asyncio.run(look(url))
