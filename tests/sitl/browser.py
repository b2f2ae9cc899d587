"""A headless Chromium that tests open a page in, driven by the Chrome DevTools protocol."""

import asyncio
import base64
import contextlib
import re
import shutil
import signal
import subprocess
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType
from flying import TIMEOUT_S, environment

_ESCAPES = re.compile(rb"\x1b(\[[0-9;?<>=]*[ -/]*[@-~]|\][^\x07\x1b]*(\x07|\x1b\\)|[()].|.)")


class Page:
    """A page in a browser.

    Attributes:
        received: What has come over its WebSockets, as text without escape sequences; cell by cell
            only what has changed on the terminal.
        failures: Addresses that could not be loaded.
        requests: Addresses that were asked for.
    """

    def __init__(self, connection: ClientWebSocketResponse) -> None:
        self.received = ""
        self.requests: list[str] = []
        self.failures: list[str] = []
        self._connection, self._number = connection, 0
        self._answers: dict[int, asyncio.Future[Any]] = {}

    async def listen(self) -> None:
        """Take in answers and events until the browser ends."""
        async for message in self._connection:
            if message.type != WSMsgType.TEXT:
                continue
            content = message.json()
            if "id" in content:
                self._answers.pop(content["id"]).set_result(content)
            elif content["method"] == "Network.webSocketFrameReceived":
                self._take(content["params"]["response"])
            elif content["method"] == "Network.requestWillBeSent":
                self.requests.append(content["params"]["request"]["url"])
            elif content["method"] == "Network.loadingFailed":
                self.failures.append(content["params"]["errorText"])

    def _take(self, frame: dict[str, Any]) -> None:
        binary = frame["opcode"] == 2
        data = base64.b64decode(frame["payloadData"]) if binary else frame["payloadData"].encode()
        self.received += _ESCAPES.sub(b" ", data).decode(errors="replace")

    async def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol and return its result."""
        self._number += 1
        answer = self._answers[self._number] = asyncio.get_running_loop().create_future()
        request = {"id": self._number, "method": method, "params": parameters}
        await self._connection.send_json(request)
        async with asyncio.timeout(TIMEOUT_S):
            content = await answer
        assert "error" not in content, content
        return content["result"]

    async def open(self, url: str) -> None:
        for domain in ("Page", "Network"):
            await self.call(f"{domain}.enable")
        await self.call("Page.navigate", url=url)

    async def press(self, key: str) -> None:
        """Press a key that is a character."""
        await self.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=key)
        await self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    async def evaluate(self, expression: str) -> Any:
        """Return the value of an expression in JavaScript, on the page."""
        result = await self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        return result["result"].get("value")

    async def screenshot(self) -> bytes:
        """Return what is drawn, as PNG."""
        return base64.b64decode((await self.call("Page.captureScreenshot"))["data"])

    async def shows(self, *texts: str) -> None:
        """Wait until all these have been received; then forget what was."""
        await until(lambda: all(text in self.received for text in texts), lambda: self.received)
        self.received = ""


async def until(condition: Callable[[], bool], what: Callable[[], str] = lambda: "") -> None:
    """Wait for a condition."""
    try:
        async with asyncio.timeout(TIMEOUT_S):
            while not condition():
                await asyncio.sleep(0.05)
    except TimeoutError:
        raise AssertionError(f"waited in vain: {what()}") from None


@contextlib.asynccontextmanager
async def browser(folder: Path, width: int = 1100, height: int = 640) -> AsyncIterator[Page]:
    """Run a browser with an empty page; its profile is in a folder."""
    program = shutil.which("chromium")
    assert program is not None
    profile = folder / "chromium"
    options = [
        *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"),
        *("--no-first-run", "--disable-background-networking", "--disable-sync"),
        *("--remote-debugging-port=0", f"--window-size={width},{height}"),
        f"--user-data-dir={profile}",
    ]
    popen = subprocess.Popen(
        [program, *options, "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment(),
        start_new_session=True,
    )
    try:
        active = profile / "DevToolsActivePort"
        await until(lambda: active.exists() and "\n" in active.read_text(), lambda: str(active))
        port = active.read_text().split()[0]
        async with ClientSession() as session:
            async with session.get(f"http://127.0.0.1:{port}/json/list") as answer:
                targets = await answer.json()
            url = next(t["webSocketDebuggerUrl"] for t in targets if t["type"] == "page")
            async with session.ws_connect(url, max_msg_size=0) as connection:
                page = Page(connection)
                listening = asyncio.create_task(page.listen())
                try:
                    yield page
                finally:
                    listening.cancel()
    finally:
        popen.send_signal(signal.SIGTERM)
        try:
            await asyncio.to_thread(popen.wait, TIMEOUT_S)
        finally:
            popen.kill()
