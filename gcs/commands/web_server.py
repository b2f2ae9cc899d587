"""The server of ``gcs web``: a page, and a process of the dashboard for each browser that opens it.

Needs the extra `web`.

textual-serve brings the terminal that browsers show. Its own page fetches a font from elsewhere and
knows one address only; ours, `gcs/tui/web_page.html`, does neither.
"""

import asyncio
import contextlib
import ipaddress
import logging
import socket
from collections.abc import AsyncIterator, Callable, Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path
from urllib.parse import urlsplit

from aiohttp import WSCloseCode, WSMsgType, web
from aiohttp.typedefs import Handler
from textual_serve import server as textual_server

from gcs.commands.web_view import View, size_in
from gcs.console.stopping import end_with_session

_CLOSING_S = 0.5
"""Time that browsers have to close their connections when the server ends [s]."""
_EVERY_INTERFACE = "0.0.0.0"


async def serve(
    command: Sequence[str],
    host: str,
    listening: socket.socket,
    most: int,
    on_ready: Callable[[], None],
) -> None:
    """Serve a Textual program to browsers until the session ends; its processes end before.

    Args:
        command: Runs the program once.
        host: Where browsers find it, as the user named it: others' pages are refused.
        listening: A bound socket.
        most: How many of these processes at a time; a further browser gets a text that says so.
        on_ready: Called when browsers can connect.
    """
    logging.getLogger("textual-serve").addHandler(logging.NullHandler())
    site = _Site(command, host, most)
    runner = web.AppRunner(
        site.app(), access_log=None, shutdown_timeout=_CLOSING_S, handler_cancellation=True
    )
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    end_with_session(partial(loop.call_soon_threadsafe, stopped.set))
    await runner.setup()
    try:
        await web.SockSite(runner, listening).start()
        on_ready()
        await stopped.wait()
    finally:
        await site.close()
        await runner.cleanup()


class _Site:
    """What browsers get: the page, views of it, and files; arguments as of `serve`."""

    def __init__(self, command: Sequence[str], host: str, most: int) -> None:
        self._command, self._host, self._most = command, host, most
        self._textual = textual_server.Server("")
        self._page = files("gcs.tui").joinpath("web_page.html").read_text(encoding="utf-8")
        self._open: set[asyncio.Task[None]] = set()

    def app(self) -> web.Application:
        """Return what answers requests."""
        app = web.Application(middlewares=[self._ours_alone])
        static = Path(textual_server.__file__).parent / "static"
        app.add_routes(
            [
                web.get("/", self._index),
                web.get("/ws", self._view),
                web.get("/download/{key}", self._textual.handle_download),
                web.static("/static", static),
            ]
        )
        return app

    async def close(self) -> None:
        """End the views, and with each its process."""
        for task in self._open:
            task.cancel()
        if self._open:
            await asyncio.wait(self._open)

    def _check_room(self) -> None:
        if len(self._open) >= self._most:
            text = (
                f"{self._most} dashboards are open, as many as this server has: close one and load "
                "this page again, or start gcs web with a larger --views"
            )
            raise web.HTTPServiceUnavailable(text=text)

    @contextlib.asynccontextmanager
    async def _room(self) -> AsyncIterator[None]:
        """Hold the place of a view, until its process is gone."""
        self._check_room()
        task = asyncio.current_task()
        assert task is not None
        self._open.add(task)
        try:
            yield
        finally:
            self._open.discard(task)

    async def _index(self, _: web.Request) -> web.Response:
        self._check_room()
        return web.Response(text=self._page, content_type="text/html")

    async def _view(self, request: web.Request) -> web.StreamResponse:
        try:
            width, height = size_in({"width": "80", "height": "24", **request.query})
        except ValueError:
            raise web.HTTPBadRequest(text="width and height: expected whole numbers") from None
        websocket = web.WebSocketResponse(heartbeat=15)
        async with self._room():
            await websocket.prepare(request)
            one = View(self._command, websocket, self._textual.download_manager)
            try:
                await one.start(width, height)
                async for message in websocket:
                    await one.take(message.data if message.type is WSMsgType.TEXT else "")
            except ValueError:
                await websocket.close(code=WSCloseCode.POLICY_VIOLATION)
            finally:
                await one.stop()
        return websocket

    @web.middleware
    async def _ours_alone(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse what a page of another site asks a browser of this machine to open."""
        named = request.headers.get("Host", "")
        origin = request.headers.get("Origin")
        foreign = origin is not None and origin.partition("://")[2] != named
        if foreign or not _is_ours(named, self._host):
            text = (
                "this dashboard is not for pages of other sites: open it at the address that "
                "gcs web prints, or name another one by --listen"
            )
            raise web.HTTPForbidden(text=text)
        return await handler(request)


def _is_ours(named: str, host: str) -> bool:
    """Return whether a Host header names this server.

    By the letter: whom a name belongs to says who owns it, and so may a page that attacks us.

    Args:
        named: The header.
        host: Where it listens.
    """
    try:
        name = urlsplit(f"//{named}").hostname or ""
        if name in {"localhost", host.lower()}:
            return True
        address = ipaddress.ip_address(name)
    except ValueError:
        return False
    return address.is_loopback or host == _EVERY_INTERFACE
