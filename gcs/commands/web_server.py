"""The server of ``gcs web``: a page, and a process of the dashboard for each browser that opens it.

Needs the extra `web`.

textual-serve runs these processes and brings the terminal that browsers show. Its own page fetches
a font from elsewhere and knows one address only; ours, `gcs/tui/web_page.html`, does neither.
"""

import asyncio
import contextlib
import logging
import shlex
import socket
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

from aiohttp import web
from aiohttp.typedefs import Handler
from textual_serve import server as textual_server

from gcs.stopping import stop_signals
from mavlink_defs.endpoint import EndpointError, UdpAddress, is_loopback

_CLOSING_S = 2.0
"""Time that browsers have to close their connections when the server ends [s]."""


async def serve(
    command: list[str],
    address: UdpAddress,
    listening: socket.socket,
    most: int,
    on_ready: Callable[[], None],
) -> None:
    """Serve a Textual program to browsers until a signal ends it; its processes end before.

    Args:
        command: Runs the program once.
        address: What the browsers open, to tell pages of others from ours.
        listening: A bound socket.
        most: How many browsers at a time; a further one gets a text that says so.
        on_ready: Called when browsers can connect.
    """
    logging.getLogger("textual-serve").addHandler(logging.NullHandler())
    server = textual_server.Server("exec " + shlex.join(command))
    page = files("gcs.tui").joinpath("web_page.html").read_text(encoding="utf-8")
    only_local = is_loopback(address)
    open_views: set[asyncio.Task[Any]] = set()

    def check_room() -> None:
        if len(open_views) >= most:
            text = (
                f"{most} dashboards are open, as many as this server has: close one and load this "
                "page again, or start gcs web with a larger --views"
            )
            raise web.HTTPServiceUnavailable(text=text)

    async def index(_: web.Request) -> web.Response:
        check_room()
        return web.Response(text=page, content_type="text/html")

    async def view(request: web.Request) -> web.StreamResponse:
        check_room()
        task = asyncio.current_task()
        assert task is not None
        open_views.add(task)
        try:
            return await server.handle_websocket(request)
        finally:
            open_views.discard(task)

    @web.middleware
    async def ours_alone(request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse what a page of another site asks a browser of this machine to open."""
        origin = request.headers.get("Origin")
        foreign = origin is not None and origin.partition("://")[2] != request.host
        if foreign or (only_local and not _is_local(request.host)):
            raise web.HTTPForbidden(text="this dashboard is not for pages of other sites")
        return await handler(request)

    app = web.Application(middlewares=[ours_alone])
    static = Path(textual_server.__file__).parent / "static"
    app.add_routes(
        [
            web.get("/", index),
            web.get("/ws", view),
            web.get("/download/{key}", server.handle_download),
            web.static("/static", static),
        ]
    )
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=_CLOSING_S)
    await runner.setup()
    try:
        await web.SockSite(runner, listening).start()
        on_ready()
        await _stopped()
    finally:
        for task in open_views:  # each ends its process
            task.cancel()
        if open_views:
            await asyncio.wait(open_views, timeout=_CLOSING_S)
        await runner.cleanup()


async def _stopped() -> None:
    """Wait for one of the signals that end a command."""
    stopped, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in stop_signals():
        loop.add_signal_handler(number, stopped.set)
    await stopped.wait()


def _is_local(host: str) -> bool:
    """Return whether a Host header names this machine: other names are of other sites."""
    name = host.rpartition(":")[0] if ":" in host else host
    with contextlib.suppress(EndpointError):
        return name == "localhost" or is_loopback(UdpAddress(name, 0))
    return False
