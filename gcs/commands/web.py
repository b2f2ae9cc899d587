"""``gcs web``: the dashboard in a browser."""

import asyncio
import os
import resource
import sys
from functools import partial
from typing import Annotated

import typer

from gcs.commands.listening import listen as listen_at
from gcs.commands.listening import listening_address
from gcs.commands.options import SIGNING_KEY_VARIABLE, ConnectOption, ThemeOption
from gcs.console.extras import WEB_PACKAGES, load_package
from gcs.console.lines import print_line
from gcs.console.stopping import die_with
from gcs.fleet.hub import MAX_STATIONS
from gcs.station.connection import choose_connection

_MEMORY = 1 << 30
"""Most memory that a dashboard may take [bytes]."""


def web(
    connect: ConnectOption = None,
    theme: ThemeOption = "dark",
    listen: Annotated[str, typer.Option(metavar="HOST:PORT")] = "127.0.0.1:8000",
    control: Annotated[bool, typer.Option("--control")] = False,
    views: Annotated[int, typer.Option(min=1, max=MAX_STATIONS, metavar="NUMBER")] = 8,
    view: Annotated[int | None, typer.Option("--view", hidden=True)] = None,
) -> None:
    """Serve the dashboard to browsers until Ctrl-C.

    It is read-only unless --control is given. Every browser gets a dashboard of its own, a process
    of this machine.

    Args:
        listen: Address that browsers open.
        control: Let browsers command vehicles, not only look.
        views: Most dashboards open at a time: each is a process of about 200 MB.

    Examples:
        - gcs web                         (then open http://127.0.0.1:8000)
        - gcs web --control --connect udpout:127.0.0.1:14600

    Needs the extra `web`.

    Ends with its terminal, and with the process that has started it; not with nohup.

    Exit status: 0 stopped by Ctrl-C, SIGTERM or SIGHUP, 2 bad input.
    """
    if view is not None:  # a process that the server has started
        die_with(view)
        resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY, _MEMORY))
        from gcs.commands.dashboard import served_dashboard

        served_dashboard(connect, theme, control)
        return
    for package in WEB_PACKAGES:
        load_package(package, "gcs web", "web")
    connection = choose_connection(connect, os.environ.get(SIGNING_KEY_VARIABLE) or None)
    address = listening_address("--listen", listen)
    from gcs.commands.web_server import serve

    command = [sys.executable, "-m", "gcs", "web", "--view", str(os.getpid()), "--theme", theme]
    command += ["--connect", str(connection), *(["--control"] if control else [])]
    with listen_at("--listen", address) as listening:
        url = f"http://{address.host}:{listening.getsockname()[1]}"
        access = "browsers can command vehicles" if control else "read-only"
        lines = f"dashboard of {connection} at {url} ({access})\n  Ctrl-C stops it"
        asyncio.run(serve(command, address.host, listening, views, partial(print_line, lines)))
    print_line("stopped")
