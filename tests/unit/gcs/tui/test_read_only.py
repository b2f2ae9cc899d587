"""A read-only dashboard has no way to a vehicle: no key, and no action that comes otherwise."""

import asyncio
from typing import Any

import pytest
from textual.pilot import Pilot
from tui_bench import OWN, Station, at_screen
from waiting import until

from gcs.tui.app import Dashboard
from gcs.tui.keys import ACTING
from gcs.tui.operations import Operations
from gcs.tui.requests import VehicleAction
from gcs.tui.view import FleetView, LiveSource


def source(read_only: str) -> LiveSource:
    live = LiveSource("test", 1.0e9, OWN, read_only=read_only)
    station = Station(1, 2)
    station.vehicles = {1: "vehicle 1", 2: "vehicle 2"}
    live.attach(station)
    return live


def action(reached: list[Any]) -> VehicleAction:
    async def act(vehicle: Any, _: str) -> None:
        reached.append(vehicle)

    return VehicleAction("act", (1, 2), act)


@pytest.mark.parametrize("read_only", ["read-only", ""])
def test_an_action_reaches_vehicles_unless_read_only(
    read_only: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    reached: list[Any] = []
    notices: list[str] = []
    monkeypatch.setattr(Dashboard, "notify", lambda _, text, **__: notices.append(text))

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        assert all(bool(app.check_action(name, ())) == (not read_only) for name in ACTING)
        app.post_message(action(reached))
        if read_only:
            await until(pilot, lambda: notices == ["read-only: nothing can be done"])
            assert not reached
        else:
            await until(pilot, lambda: reached == ["vehicle 1", "vehicle 2"])

    at_screen(source(read_only), work)


def test_operations_that_run_nevertheless_reach_no_vehicle() -> None:
    view = FleetView(source("read-only"))
    view.update()
    reached: list[Any] = []
    asyncio.run(Operations(view, lambda *_: None).carry_out(action(reached), ""))
    assert not reached
    assert [entry.severity for entry in view.source.event_log.entries] == [3, 3]
    with pytest.raises(KeyError):
        view.source.vehicle(1)
