"""A ground station without a link, and a log to be played, for tests of the dashboard."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from textual.pilot import Pilot

from gcs.station.fleet_state import FleetState
from gcs.tui.app import Dashboard
from gcs.tui.playback import Playback
from gcs.tui.view import LiveSource
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import read_frames
from mavlink_defs.services.machine import SystemId

LOG = Path(__file__).parents[1] / "data" / "dashboard" / "flight.tlog"
OWN = SystemId(255, 77)


def heartbeat(system: int, armed: bool = False) -> Any:
    flag = dialect.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    message = dialect.MAVLink_heartbeat_message(1, 3, flag | 1, 12, dialect.MAV_STATE_STANDBY, 3)
    return sent(message, system)


def sent(message: Any, system: int) -> Any:
    message.get_srcSystem = lambda: system
    message.get_srcComponent = lambda: 1
    return message


class Station:
    """A client without a link; its vehicles are set by the test."""

    def __init__(self, *systems: int) -> None:
        self.fleet, self.time_s = FleetState(), 100.0
        self.vehicles: dict[int, Any] = {}
        for system in systems:
            self.receive(system)

    def receive(self, system: int) -> None:
        self.fleet.receive(heartbeat(system), self.time_s)

    def now(self) -> float:
        return self.time_s

    def vehicle(self, system: int) -> Any:
        return self.vehicles[system]


def live(station: Station, read_only: str = "") -> LiveSource:
    source = LiveSource("test", 1.0e9, OWN, read_only=read_only)
    source.attach(station)
    return source


def playback(clock: Callable[[], float] = lambda: 0.0) -> Playback:
    return Playback("log", list(read_frames(LOG)), clock)


def at_screen(
    source: Any,
    work: Callable[[Dashboard, Pilot[None]], Any],
    size: tuple[int, int] = (100, 30),
    notices: bool = False,
) -> None:
    """Let work be done at the dashboard."""

    async def run() -> None:
        app = Dashboard(source)
        async with app.run_test(size=size, notifications=notices) as pilot:
            await pilot.pause()
            await work(app, pilot)

    asyncio.run(run())
