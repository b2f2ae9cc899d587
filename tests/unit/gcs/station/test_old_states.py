"""An autopilot that acts on old states, in `gcs status` and at the dashboard."""

from typing import Any

import pytest
from rich.console import Console
from tui_bench import Station, at_screen, live, sent

from gcs.station.status import fleet_table, vehicle_status
from gcs.tui.fleet_table import FleetTable
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse

FOUR = [0] * 4


def station_that_hears(oldest_state_us: int) -> Station:
    station = Station(1)
    events = dialect.MAVLink_ftc_events_message(
        5000, 5000, FOUR, FOUR, 0, FOUR, 0, oldest_state_us=oldest_state_us
    )
    station.fleet.receive(sent(parse(FramePacker(1, 1).pack(events)), 1), station.time_s)
    return station


@pytest.mark.parametrize(
    ("oldest_state_us", "text"),
    [(0, "up"), (1000, "up"), (100_000, "up"), (101_000, "old 0.1 s"), (2**32 - 1, "old 4295.0 s")],
)
def test_a_state_older_than_a_tenth_of_a_second_is_shown_in_place_of_the_link(
    oldest_state_us: int, text: str
) -> None:
    station = station_that_hears(oldest_state_us)
    states = list(station.fleet.vehicles.values())
    console = Console(width=80)
    with console.capture() as shown:
        console.print(fleet_table(states, station.now()))
    assert f" {text} " in shown.get()
    link = vehicle_status(states[0], station.now())["link"]
    assert link["oldest_state_s"] == oldest_state_us / 1e6


def test_an_age_that_was_not_reported_is_unknown() -> None:
    station = Station(1)
    assert vehicle_status(station.fleet.vehicles[1], 0.0)["link"]["oldest_state_s"] is None


@pytest.mark.parametrize(
    ("oldest_state_us", "expected"),
    [(100_000, "● 0.0 s"), (430_000, "old 0.4s"), (2**32 - 1, "old")],
)
def test_the_dashboard_shows_it(oldest_state_us: int, expected: str) -> None:
    async def work(app: Any, _: Any) -> None:
        row = app.query_one(FleetTable).rows[0]
        assert expected in [text for text, _ in row.cells]

    at_screen(live(station_that_hears(oldest_state_us)), work)
