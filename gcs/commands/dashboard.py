"""``gcs`` alone: the operator's dashboard."""

import asyncio
import os
import sys
import time
import traceback
from functools import partial
from typing import TYPE_CHECKING

from gcs.commands.options import SIGNING_KEY_VARIABLE
from gcs.commands.station import run_interruptible
from gcs.console.errors import BadInput
from gcs.console.stopping import end_with_session
from gcs.station.client import Client
from gcs.station.connection import choose_connection, own_identity

if TYPE_CHECKING:
    from gcs.tui.app import Dashboard


def has_terminal() -> bool:
    """Return whether there is a terminal to show the dashboard on."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def dashboard(connect: str | None, theme: str) -> None:
    """Show the vehicles at a connection until the operator leaves.

    Raises:
        BadInput: There is no terminal.
    """
    _check_terminal()
    _show(connect, theme)


def served_dashboard(connect: str | None, theme: str, control: bool) -> None:
    """Show the same to a browser, by the server of ``gcs web`` that has started this process.

    Args:
        connect: Connection to the vehicles.
        theme: Colours.
        control: Whether vehicles may be commanded: without it nothing here reaches them.
    """
    read_only = "" if control else "read-only"
    _show(connect, theme, read_only=read_only)


def _show(connect: str | None, theme: str, *, read_only: str = "") -> None:
    signing_key = os.environ.get(SIGNING_KEY_VARIABLE) or None
    connection = choose_connection(connect, signing_key)
    from gcs.tui.app import Dashboard
    from gcs.tui.view import LiveSource

    async def work() -> None:
        own = own_identity()
        title = f"{connection} · {read_only}" if read_only else str(connection)
        live = LiveSource(title, time.time() - time.monotonic(), own, read_only=read_only)
        async with Client(
            connection,
            on_notification=live.receive,
            inquire=True,
            private=True,
            own=own,
            signing_key=signing_key,
        ) as client:
            live.attach(client)
            await _run(Dashboard(live, theme))

    run_interruptible(work())


def _check_terminal() -> None:
    if not has_terminal():
        raise BadInput("the dashboard needs a terminal", "scripts use `gcs status` and the like")


async def run_dashboard(app: "Dashboard") -> None:
    """Run the app in a terminal.

    Raises:
        BadInput: There is none.
        Exception: A defect of the dashboard.
    """
    _check_terminal()
    await _run(app)


async def _run(app: "Dashboard") -> None:
    loop = asyncio.get_running_loop()
    end_with_session(partial(loop.call_soon_threadsafe, app.exit))  # the terminal as it was found
    await app.run_async()
    from gcs.console.lines import print_line

    for text, error in app.failures.items():
        print_line(f"warning: {text}", stderr=True)
        if os.environ.get("FTC_SITL_DEBUG"):
            traceback.print_exception(error)
    if app.defect is not None:
        raise app.defect
