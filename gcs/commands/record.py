"""``gcs record``: record the GCS link of a running fleet as a telemetry log."""

import asyncio
import math
from collections import Counter
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from gcs.commands.options import ConnectOption, JsonOption, SigningKeyOption, TimeoutOption
from gcs.commands.station import run_interruptible as run
from gcs.console.errors import BadInput, NoAnswer
from gcs.console.lines import print_json, print_line
from gcs.console.progress import working
from gcs.console.stopping import stop_signals
from gcs.console.terminal import console_of
from gcs.station.client import Client
from gcs.station.connection import choose_connection, own_identity
from mavlink_defs.capture.tlog import TlogWriter
from mavlink_defs.dialect import MAVLink_message

_REFRESH_S = 1.0


def record(
    file: Annotated[Path | None, typer.Argument(metavar="FILE")] = None,
    for_s: Annotated[float | None, typer.Option(min=0.0, metavar="S")] = None,
    connect: ConnectOption = None,
    timeout: TimeoutOption = 10.0,
    as_json: JsonOption = False,
    signing_key: SigningKeyOption = None,
) -> None:
    """Record every frame that vehicles send, until Ctrl-C.

    Each frame has its time. MAVProxy, QGroundControl and mavlogdump.py read these files.

    Args:
        file: New file; gcs-DATE-TIME.tlog by default.
        for_s: Stop after this time [s]; by default at Ctrl-C.

    Examples:
        - gcs record
        - gcs record flight.tlog --for-s 60
        - gcs record flight.tlog --json && mavlogdump.py flight.tlog --types STATUSTEXT

    Exit status: 0 recorded until Ctrl-C, SIGTERM, SIGHUP or the end of --for-s, 1 writing the file
    failed, 2 bad input, 4 no vehicle heard within --timeout.
    """
    now = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
    path = file or Path(f"gcs-{now}.tlog")
    if path.exists():
        raise BadInput(f"{path} already exists", "choose another file, or remove it")
    messages = run(_record(path, for_s, connect, timeout, signing_key))
    total = sum(messages.values())
    if as_json:
        print_json({"file": str(path), "messages": {str(k): n for k, n in messages.items()}})
    else:
        names = ", ".join(map(str, messages))
        print_line(f"{total} messages of UAV {names} in {path}")


async def _record(
    path: Path, for_s: float | None, connect: str | None, timeout_s: float, signing_key: str | None
) -> dict[int, int]:
    counts: Counter[int] = Counter()

    def count(message: MAVLink_message) -> None:
        counts[message.get_srcSystem()] += 1

    stop = asyncio.Event()
    for number in stop_signals():
        asyncio.get_running_loop().add_signal_handler(number, stop.set)
    connection = choose_connection(connect, signing_key)
    try:
        tlog = TlogWriter(path)
    except OSError as problem:
        raise BadInput(f"cannot write {path}: {problem.strerror}") from problem
    with tlog:
        async with Client(
            connection,
            tlog=tlog,
            on_message=count,
            private=True,
            own=own_identity(),
            signing_key=signing_key,
        ) as client:
            if await client.until(lambda: bool(counts) or stop.is_set(), timeout_s):
                end = math.inf if for_s is None else client.now() + for_s
                with working(console_of()) as work:
                    task = work.add(f"recording to {path}", unit="messages")
                    while not stop.is_set() and (left_s := end - client.now()) > 0.0:
                        await client.until(stop.is_set, min(left_s, _REFRESH_S))
                        task.show(counts.total())
    if not counts:
        path.unlink()
        raise NoAnswer(f"no vehicle heard within {timeout_s:g} s on {connection}")
    return dict(sorted(counts.items()))
