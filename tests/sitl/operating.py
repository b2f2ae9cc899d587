"""Somebody at the dashboard of a running fleet, driven by Textual's pilot."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from typing import Any

from flying import TIMEOUT_S
from station import Up
from textual.pilot import Pilot
from textual.widgets import Input, Select
from waiting import answer

from gcs.station.client import Client
from gcs.station.patience import Patience
from gcs.station.vehicle_state import VehicleState
from gcs.tui.app import Dashboard
from gcs.tui.fleet_table import FleetTable
from gcs.tui.view import LiveSource
from mavlink_defs.endpoint import parse_connection
from mavlink_defs.services.machine import SystemId

OWN = SystemId(255, 77)
PATIENT = Patience(silence_s=TIMEOUT_S / 4, answer_s=TIMEOUT_S / 2)
"""A busy machine may hold a vehicle up for long."""


class Operator:
    """Somebody at the dashboard."""

    def __init__(self, app: Dashboard, pilot: Pilot[None]) -> None:
        self.app, self.pilot = app, pilot

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)
        await self.pilot.pause()

    async def answer(self, *keys: str) -> None:
        await answer(self.pilot, *keys)

    async def sees(self, condition: Callable[[], Any], what: str) -> None:
        end = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < end, f"not seen: {what}\n{self.log}\n{self.doing}"
            await self.pilot.pause(0.05)

    async def sees_event(self, *parts: str) -> None:
        def there() -> bool:
            return any(all(part in line for part in parts) for line in self.log.splitlines())

        await self.sees(there, " ".join(parts))

    async def write(self, field: str, text: str) -> None:
        self.app.query_one(f"#{field}", Input).value = text
        await self.pilot.pause()

    async def choose(self, field: str, value: Any) -> None:
        self.app.query_one(f"#{field}", Select).value = value
        await self.pilot.pause()

    def state(self, system: int) -> VehicleState:
        return self.app.view.source.fleet.vehicles[system]

    def row(self, system: int) -> str:
        table = self.app.query_one(FleetTable)
        (row,) = [row for row in table.rows if row.key == system]
        return " ".join(text for text, _ in row.cells)

    @property
    def doing(self) -> str:
        app = self.app
        return f"going on: {app.operations.going_on}; {app.screen}, focus {app.focused}"

    @property
    def log(self) -> str:
        entries = self.app.view.source.event_log.entries
        return "\n".join(f"{e.system} {e.kind} {e.text}" for e in entries)


@contextlib.asynccontextmanager
async def operator(
    fleet: Up, size: tuple[int, int] = (120, 40), uavs: int = 3
) -> AsyncIterator[Operator]:
    """A dashboard that has heard every vehicle, and knows its faults and its mission."""
    live = LiveSource(fleet.hub, time.time() - time.monotonic(), OWN)
    connection = parse_connection(fleet.hub)
    async with Client(
        connection,
        on_notification=live.receive,
        inquire=True,
        private=True,
        own=OWN,
        patience=PATIENT,
    ) as client:
        live.attach(client)
        app = Dashboard(live)
        async with app.run_test(size=size) as pilot:
            someone = Operator(app, pilot)
            states = client.fleet.vehicles
            await someone.sees(lambda: len(app.query_one(FleetTable).rows) == uavs, "fleet")
            await someone.sees(lambda: all(s.mission for s in states.values()), "missions")
            await someone.sees(lambda: all(s.faults is not None for s in states.values()), "faults")
            yield someone


def drive(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


async def make_fly(someone: Operator) -> None:
    """Start the missions and arm, unless somebody did."""
    if someone.state(1).armed:
        return
    await someone.press("1", "asterisk", "s")
    for system in (1, 2, 3):
        await someone.sees_event(f"{system} action", "start mission: accepted")
    await someone.press("a")
    await someone.answer("enter")
    await someone.sees(lambda: all("ARMED" in someone.row(i) for i in (1, 2, 3)), "ARMED")
    await someone.sees_event("3 action", "arm: accepted")
    await someone.press("asterisk")
