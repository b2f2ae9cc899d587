"""``gcs`` alone: the operator's dashboard."""

import asyncio
import os
import signal
import sys
import time
import traceback
from typing import TYPE_CHECKING

from gcs.commands.options import SIGNING_KEY_VARIABLE
from gcs.commands.station import run_interruptible
from gcs.errors import BadInput
from gcs.station.client import Client
from gcs.station.connection import choose_connection, own_identity

if TYPE_CHECKING:
    from gcs.tui.app import Dashboard


def has_terminal() -> bool:
    """Return whether there is a terminal to show the dashboard on."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def dashboard(connect: str | None, theme: str) -> None:
    """Show the vehicles at a connection until the operator leaves."""
    signing_key = os.environ.get(SIGNING_KEY_VARIABLE) or None
    connection = choose_connection(connect, signing_key)
    from gcs.tui.app import Dashboard
    from gcs.tui.view import LiveSource

    async def work() -> None:
        own = own_identity()
        live = LiveSource(str(connection), time.time() - time.monotonic(), own)
        async with Client(
            connection,
            on_notification=live.receive,
            inquire=True,
            private=True,
            own=own,
            signing_key=signing_key,
        ) as client:
            live.attach(client)
            await run_dashboard(Dashboard(live, theme))

    run_interruptible(work())


async def run_dashboard(app: "Dashboard") -> None:
    """Run the app.

    Raises:
        Exception: A defect of the dashboard.
    """
    if not has_terminal():
        raise BadInput("the dashboard needs a terminal", "scripts use `gcs status` and the like")
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGHUP):  # the terminal is left as it was found
        loop.add_signal_handler(number, app.exit)
    await app.run_async()
    from gcs.terminal import print_line

    for text, error in app.failures.items():
        print_line(f"warning: {text}", stderr=True)
        if os.environ.get("FTC_SITL_DEBUG"):
            traceback.print_exception(error)
    if app.defect is not None:
        raise app.defect
