"""Whatever arrives, and whatever a widget does, the operator's station goes on."""

import asyncio
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from plain_faults import actuator_fault
from textual.pilot import Pilot
from textual.widgets import TabbedContent
from tui_bench import OWN, Station, at_screen, live, playback, sent
from waiting import until

from fuzzing.frames import message_frame
from gcs.station.fleet_state import FleetState
from gcs.station.passive_observer import PassiveObserver
from gcs.tui.app import Dashboard
from gcs.tui.grid import Grid
from gcs.tui.guard import Guarded
from gcs.tui.keys import TABS
from gcs.tui.parameters import ParametersPanel
from gcs.tui.plots import Chart
from gcs.tui.status_bar import StatusBar
from mavlink_defs import dialect
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.fault import Fault
from mavlink_defs.framing.frames import parse
from mavlink_defs.services.param import Param

ROOT = Path(__file__).parents[4]


def texts(app: Dashboard) -> list[str]:
    return [entry.text for entry in app.view.source.event_log.entries if entry.kind == "station"]


def failing(app: Dashboard) -> list[str]:
    return [w.failure for w in app.screen.query("*") if isinstance(w, Guarded) and w.failure]


def screen(app: Dashboard) -> str:
    return re.sub(r"<[^>]*>", "", app.export_screenshot()).replace("&#160;", " ")


# a widget that fails


def broken(*_: object, **__: object) -> Any:
    raise ZeroDivisionError("on purpose,\nin two lines")


@pytest.mark.parametrize("tab", TABS)
def test_each_widget_that_cannot_draw_says_so_and_recovers(tab: str) -> None:
    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        app.action_tab(tab)
        await until(pilot, lambda: any(w.size for w in app.query_one(f"#{tab}").query(".panel")))
        there = [app.query_one(StatusBar), *app.query_one(f"#{tab}").query("*")]
        leaves = [w for w in there if isinstance(w, Guarded) and w.size and not w.children]
        for widget in leaves:
            drawn = "render_line" if isinstance(widget, Grid) else "render"
            widget.__dict__[drawn] = broken
            for _ in range(3):
                widget.refresh()
                app.refresh_view(force=True)
                await pilot.pause()
            name = (widget.name or widget.id or type(widget).__name__).replace("-", " ")
            failure = f"cannot draw the {name}: ZeroDivisionError: on purpose, in two lines"
            assert failing(app) == [failure]
            assert "cannot draw the"[: widget.size.width] in screen(app)
            assert [failure in text for text in texts(app)].count(True) == 1
            del widget.__dict__[drawn]
            widget.refresh()
            await until(pilot, lambda: not failing(app))
        assert len(texts(app)) == len(leaves) > 1

    at_screen(playback(), work, (200, 50))


@pytest.mark.parametrize("tab", TABS)
def test_each_panel_that_fails_leaves_the_station_running(tab: str) -> None:
    station = Station(1)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        app.action_tab(tab)
        await pilot.pause()
        panel: Any = app.panel
        panel.show_view = broken
        for _ in range(3):
            app.refresh_view(force=True)
        await until(pilot, lambda: "cannot draw the" in screen(app))
        assert len(texts(app)) == 1
        await pilot.press("2", "1")  # the others are there
        station.receive(2)
        app.refresh_view()
        await until(pilot, lambda: "2 UAVs" in str(app.query_one(StatusBar).render()))
        del panel.show_view
        app.action_tab(tab)
        app.refresh_view(force=True)
        await until(pilot, lambda: not failing(app))
        assert app.defect is None

    at_screen(live(station), work)


def test_a_failure_of_an_action_or_of_a_handler_ends_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station = Station(1)
    station.vehicles[1] = None  # nothing can be asked of it

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        monkeypatch.setattr(app, "action_select", broken)
        await pilot.press("right_square_bracket")
        await until(pilot, lambda: any("cannot do 'select(1)'" in text for text in texts(app)))
        await pilot.press("5")
        await until(pilot, lambda: "AttributeError" in app.view.source.event_log.entries[-1].text)
        monkeypatch.setattr(app.view, "update", broken)
        app.refresh_view()
        await until(pilot, lambda: any("cannot handle" in text for text in texts(app)))
        assert app.is_running

    at_screen(live(station), work)


def test_every_handler_is_guarded() -> None:
    for path in (ROOT / "gcs" / "tui").glob("*.py"):
        text = path.read_text()
        assert path.name == "guard.py" or "from textual import on" not in text, path
        for name in re.findall(r"(?<!@guarded\n)    def (on_[a-z]+)\(", text):
            assert name == "on_mount", (path, name)  # only starts timers


# whatever arrives


def _read_by_the_station() -> list[int]:
    """Return the ids of all messages that the station's or the dashboard's source names."""
    names = set()
    for folder in ("station", "tui"):
        for path in (ROOT / "gcs" / folder).glob("*.py"):
            text = path.read_text()
            names |= set(re.findall(r"MAVLINK_MSG_ID_([A-Z0-9_]+)", text))
            names |= {n.upper() for n in re.findall(r"MAVLink_([a-z0-9_]+)_message", text)}
    return sorted(getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in names)


READ = _read_by_the_station()
MISSION_ITEM = dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT
EXTREME = st.sampled_from([math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-45, 0.0, 1.0, -90.0])


def content(message_id: int, system: int, seed: int) -> Any:
    """Return a message of a vehicle that has come over the wire; its fields have any values."""
    random = Random(seed)
    while True:  # no texts or enums that the parser itself refuses
        frame = message_frame(random, message_id, (system, 1), OWN)
        if (message := parse(frame)) is not None:
            return message


SEEDS = st.integers(0, 2**32)
ARRIVALS = st.lists(
    st.tuples(
        st.sampled_from(READ), st.sampled_from([1, 2, 3]), SEEDS, st.sampled_from([0.0, 0.1, 3.0])
    ),
    max_size=25,
)
CODED = st.sampled_from([kind.code for kind in ACTUATOR_FAULTS.kinds])
FAULTS = st.lists(st.builds(actuator_fault, st.integers(0, 3), *[EXTREME] * 5, CODED), max_size=3)


@dataclass
class Screen:
    """A dashboard that stays open from one example to the next."""

    station: Station
    app: Dashboard
    pilot: Pilot[None]
    runner: asyncio.Runner

    def forget(self) -> None:
        """Begin with a fleet that nothing is known of."""
        self.station.fleet = FleetState()
        for system in (1, 2, 3):
            self.station.vehicles[system] = None
        self.app.failures.clear()
        self.app.view.source.event_log.clear()
        self.app.view.source.fault_history.forget()

    def show_all(self) -> list[str]:
        """Show every panel in turn; return what failed."""
        self.runner.run(self._show_all())
        return list(self.app.failures)

    async def _show_all(self) -> None:
        for tab in TABS:
            self.app.query_one(TabbedContent).active = tab
            await self.pilot.pause()
            self.app.refresh_view(force=True)
            for chart in self.app.query(Chart):
                if chart.size:
                    chart.attempt(chart.draw, self.app.view, 10.0, None)
            await self.pilot.pause()
            assert not [text for text in failing(self.app) if text]


@pytest.fixture(scope="module", params=[(80, 24), (200, 50)], ids=["80x24", "200x50"])
def open_screen(request: pytest.FixtureRequest) -> Iterator[Screen]:
    station = Station()
    app = Dashboard(live(station))
    with asyncio.Runner() as runner:
        test = app.run_test(size=request.param)
        yield Screen(station, app, runner.run(test.__aenter__()), runner)
        runner.run(test.__aexit__(None, None, None))


@settings(
    max_examples=3,
    deadline=None,
    phases=[Phase.explicit, Phase.generate],  # an example takes too long to be made smaller
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    arrivals=ARRIVALS,
    faults=FAULTS,
    items=st.lists(SEEDS, max_size=5),
    values=st.lists(EXTREME, max_size=5),
)
def test_whatever_has_arrived_every_panel_draws(
    open_screen: Screen,
    arrivals: list[tuple[int, int, int, float]],
    faults: list[Fault],
    items: list[int],
    values: list[float],
) -> None:
    open_screen.forget()
    station = open_screen.station
    overheard = PassiveObserver(station.fleet)
    for i, (message_id, system, seed, later_s) in enumerate(arrivals):
        if i == len(arrivals) // 2:  # before it nobody is known: everything else came first
            station.receive(1)
        station.time_s += later_s
        message = content(message_id, system, seed)
        for notifications in (
            station.fleet.receive(message, station.time_s),
            overheard.receive(message, station.time_s),
            station.fleet.handle_timer(station.time_s),
        ):
            for one in notifications:
                open_screen.app.view.source.receive(one)  # type: ignore[attr-defined]  # it is live
    mission = tuple(content(MISSION_ITEM, 1, seed) for seed in items)
    for state in station.fleet.vehicles.values():
        state.learn_faults(tuple(faults), station.time_s)
        state.learn_mission(mission, station.time_s)
    open_screen.app.query_one(ParametersPanel).params = {
        1: tuple(Param(f"P{i}", value, 9) for i, value in enumerate(values))
    }
    assert open_screen.show_all() == []


def test_a_position_that_comes_after_the_tracking_is_drawn(open_screen: Screen) -> None:
    """The formation of vehicles of which some positions are not known yet."""
    open_screen.forget()
    station = open_screen.station
    tracking = dialect.MAVLink_ftc_tracking_message(1000, [40.0, 0, 0, 0], [0] * 4, [0] * 4)
    for system in (1, 2):
        station.receive(system)
        station.fleet.receive(sent(tracking, system), station.time_s)
    place = dialect.MAVLink_local_position_ned_message(1100, 5.0, 7.0, -300.0, 40.0, 0.0, 0.0)
    station.fleet.receive(sent(place, 2), station.time_s)
    later = dialect.MAVLink_ftc_tracking_message(1100, [40.0, 0, 0, 0], [0] * 4, [0] * 4)
    station.fleet.receive(sent(later, 2), station.time_s)
    assert open_screen.show_all() == []
