"""One browser's dashboard: its process, and the messages of its page. Needs the extra `web`."""

import asyncio
import contextlib
import json
import os
import signal
from collections.abc import Mapping, Sequence
from typing import Any

from aiohttp import web
from textual_serve.app_service import AppService
from textual_serve.download_manager import DownloadManager

_MAX_SIZE = (500, 200)
"""Columns and rows of the largest view: more than a large screen has, and little memory."""
_CLOSING_S = 0.5
"""Time that a view has to end well [s]."""
_LOOK_S = 0.02
"""Period of looking whether it has ended [s]."""


def size_in(given: Mapping[str, Any]) -> tuple[int, int]:
    """Return columns and rows of a view within its bounds.

    Args:
        given: `width` and `height`, as a whole number or its text.

    Raises:
        ValueError: One is something else.
    """
    requested = [given["width"], given["height"]]
    if not all(type(each) is int or isinstance(each, str) for each in requested):
        raise ValueError("expected whole numbers")
    width, height = (
        min(max(int(each), 1), most) for each, most in zip(requested, _MAX_SIZE, strict=True)
    )
    return width, height


class View(AppService):
    """A process that draws for a browser, and ends with its page: by force if need be."""

    def __init__(
        self, command: Sequence[str], websocket: web.WebSocketResponse, downloads: DownloadManager
    ) -> None:
        """Start nothing yet.

        Args:
            command: Runs a Textual program.
            websocket: Of the page.
            downloads: Of the server.
        """

        async def close() -> None:
            await websocket.close()

        super().__init__(
            "",
            write_bytes=websocket.send_bytes,
            write_str=websocket.send_str,
            close=close,
            download_manager=downloads,
        )
        self._arguments = command

    async def _open_app_process(
        self, width: int = 80, height: int = 24
    ) -> asyncio.subprocess.Process:
        """Start the process, in a group of its own."""
        self._process = process = await asyncio.create_subprocess_exec(
            *self._arguments,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            env=self._build_environment(width, height),
            start_new_session=True,
        )
        self._stdin = process.stdin
        return process

    async def run(self) -> None:
        """Pass on what it draws; the page closes when it ends."""
        try:
            await super().run()
        finally:
            await self.remote_close()

    async def take(self, text: str) -> None:
        """Do what a message of the page says.

        Raises:
            ValueError: It is no such message.
        """
        try:
            match json.loads(text):
                case ["stdin", str(typed)]:
                    await self.send_bytes(typed.encode())
                case ["resize", {"width": int(), "height": int()} as size]:
                    await self.set_terminal_size(*size_in(size))
                case ["ping", str(sent)]:
                    await self.remote_write_str(json.dumps(["pong", sent]))
                case ["focus"]:
                    await self.focus()
                case ["blur"]:
                    await self.blur()
                case _:
                    raise ValueError(text)
        except RecursionError as problem:  # of a list in a list in a list ...
            raise ValueError(str(problem)) from None

    async def stop(self) -> None:
        """End the process and whatever it has started; return when it is gone."""
        process = self._process
        if process is None:
            return
        await self._download_manager.cancel_app_downloads(self.app_service_id)
        try:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_CLOSING_S):
                    await self.send_meta({"type": "quit"})
                    await self._gone(process)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            await self._gone(process)

    @staticmethod
    async def _gone(process: asyncio.subprocess.Process) -> None:
        """Wait for the end of a process, whether or not its output has been read."""
        while process.returncode is None:
            await asyncio.sleep(_LOOK_S)
