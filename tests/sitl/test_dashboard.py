"""Textual's pilot drives every panel of the dashboard against a real fleet over UDP."""

import asyncio
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from flying import SCENARIO_1, process_of, scenario_tree
from operating import drive, make_fly, operator
from station import Up, up
from textual.widgets import TabbedContent
from waiting import until_focused

from gcs.tui.events import EventsPanel, EventTable
from gcs.tui.faults import FaultTimeline
from gcs.tui.grid import Grid
from gcs.tui.guard import CachedStatic
from gcs.tui.plots import Chart
from gcs.tui.profiles import Holdings, ProfilesPanel
from gcs.tui.wire_panel import WirePanel

pytestmark = pytest.mark.sitl


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    """Scenario 1, waiting to be armed, without its fault; slowly, as a busy machine may be late."""
    folder, tree = tmp_path_factory.mktemp("fleet"), scenario_tree(faults=[])
    with up(folder, tree=tree) as fleet:
        yield fleet


def test_a_fleet_is_armed_and_started_and_its_flight_shows(fleet: Up) -> None:
    async def work() -> None:
        async with operator(fleet) as someone:
            await make_fly(someone)
            await someone.sees(lambda: (someone.state(2).time_s or 0.0) > 1.5, "time runs")
            await someone.sees(lambda: "AUTO" in someone.row(2), "AUTO")
            wire = someone.app.query_one(WirePanel)
            await someone.sees(lambda: "saved" in str(wire.border_title), "savings")
            await someone.sees(lambda: "rudder" in wire.text and "█" in wire.text, "a rate")
            await someone.sees(lambda: len(wire.rows) == 15, "15 rows")
            await someone.press("2")
            charts = list(someone.app.query(Chart))
            await someone.sees(
                lambda: all("→" in str(c.border_title) for c in charts[1:5]), "plots"
            )
            await someone.sees(lambda: "airspeed" in someone.app.export_screenshot(), "airspeed")
            await someone.sees(lambda: "formation" in someone.app.export_screenshot(), "formation")

    drive(work())


def test_a_fault_goes_from_the_form_to_the_plant_and_is_cleared(fleet: Up) -> None:
    async def work() -> None:
        async with operator(fleet) as someone:
            await make_fly(someone)
            await someone.press("3")
            # what cannot be is said at once, and not sent
            await someone.choose("vehicle", 2)
            await someone.choose("actuator", "elevator")
            await someone.write("effectiveness", "1.5")
            form = someone.app.query_one("#form-says", CachedStatic)
            problem = "effectiveness: expected [0, 1], got 1.5"
            await someone.sees(lambda: problem in form.says, problem)
            assert someone.app.query_one("#set").disabled
            # what the aircraft cannot do it refuses, and that is reported
            await someone.choose("fault-kind", "stuck")
            await someone.write("effectiveness", "")
            await someone.write("value", "200")
            await someone.press("n", "ctrl+s")
            await someone.sees_event("2 action", "DENIED", "Value is 200 deg, must be -35 to 35")

            before = abs((someone.state(2).error or (0.0,) * 4)[2])
            await someone.write("value", "3")
            await someone.press("ctrl+s")
            await someone.sees_event("2 action", "set: elevator stuck at 3 deg")
            faults = someone.app.query_one(FaultTimeline)
            await someone.sees(lambda: "active" in faults.text, "an active fault")
            vehicles = await asyncio.to_thread(fleet.gcs_json, "fault", "list", "--uav", "2")
            ((fault,),) = [vehicle["faults"] for vehicle in vehicles]
            assert (fault["actuator"], fault["active"]) == ("elevator", True)
            await someone.sees(
                lambda: abs((someone.state(2).error or (0.0,) * 4)[2]) > before + 0.5,
                "the plant pitches with a stuck elevator",
            )
            await someone.press("1")
            await someone.sees(lambda: "1/1" in someone.row(2), "1/1")

            await someone.press("r")  # the next UAV without it
            await someone.sees_event("1 action", "set: elevator stuck at 3 deg")
            history = someone.app.view.source.fault_history
            await someone.sees(lambda: len(history.records) == 2, "repeated")
            acks = [record.acknowledged for record in history.records]
            assert [ack and ack.asked_by for ack in acks] == ["this station"] * 2

            await someone.press("3", "home", "d")  # the latest one
            await someone.answer("enter")
            await someone.sees_event("1 action", "faults of the elevator cleared")
            await someone.sees(lambda: someone.state(1).faults == (), "cleared")
            await someone.press("C")
            await someone.answer("enter")
            await someone.sees_event("2 action", "all faults cleared")
            both = ["cleared", "cleared"]
            await someone.sees(
                lambda: [row.cells[1][0] for row in faults.rows] == both, "past faults"
            )

    drive(work())


def test_a_profile_is_uploaded_downloaded_and_compared(fleet: Up, tmp_path: Path) -> None:
    tree = scenario_tree()
    tree["profile"][1]["airspeed_m_s"] = 44.0
    other, bad, broken = (tmp_path / f"{name}.yaml" for name in ("other", "bad", "broken"))
    other.write_text(yaml.safe_dump({"profile": tree["profile"]}))
    fast = [{"start_s": 0.0, "airspeed_m_s": 500.0}]
    bad.write_text(yaml.safe_dump({"profile": fast}))
    broken.write_text("profile: [{start_s: 1}]")

    async def work() -> None:
        async with operator(fleet) as someone:
            await make_fly(someone)
            panel = someone.app.query_one(ProfilesPanel)
            holdings = someone.app.query_one(Holdings)
            await someone.press("4")
            panel.load(broken)
            await someone.sees(
                lambda: (
                    "airspeed_m_s: missing" in str(someone.app.query_one("#profile-says").render())
                ),
                "what is wrong with the file",
            )
            await someone.press("o")
            await until_focused(someone.pilot, "profile-path")
            await someone.write("profile-path", str(SCENARIO_1))
            await someone.press("enter")
            await someone.sees(lambda: holdings.text.count("= file") == 3, "compared")

            await someone.press("o")
            await until_focused(someone.pilot, "profile-path")
            await someone.write("profile-path", str(other))
            await someone.press("enter")
            await someone.sees(lambda: someone.app.focused is holdings, "focus on the list")
            await someone.press("down")
            await someone.sees(lambda: "≠ file: 1 value" in holdings.text, "a difference")
            await someone.sees(
                lambda: "44≠45" in someone.app.query_one("#profile-table", Grid).text, "44≠45"
            )
            await someone.press("space", "u")
            await someone.answer("enter")  # it flies: the question whether
            await someone.sees_event("2 action", "other.yaml, 3 segments uploaded")
            await someone.sees(lambda: holdings.text.count("= file") == 1, "uploaded to one")
            await someone.press("g")
            await someone.sees_event("2 action", "holds 3 segments, the same as other.yaml")

            panel.load(bad)
            await someone.press("u")
            await someone.answer("enter")
            await someone.sees_event("2 action", "refused the upload", "airspeed 500")
            assert len(someone.state(2).profile or ()) == 3

    drive(work())


def test_a_restarted_dashboard_finds_everything_again(fleet: Up) -> None:
    async def work() -> None:
        async with operator(fleet) as someone:
            await make_fly(someone)
        fleet.gcs(
            "fault", "set", "rudder", "--uav", "3", "--effectiveness", "0.9", "--start-s", "9000"
        )
        async with operator(fleet, size=(80, 24)) as someone:
            assert all(someone.state(i).profile for i in (1, 2, 3))
            await someone.sees(lambda: someone.state(1).counts.total > 0, "the events")
            await someone.press("3")
            faults = someone.app.query_one(FaultTimeline)
            await someone.sees(lambda: "waiting rudder at 90 %" in faults.text, "the fault")
        fleet.gcs("fault", "clear")

    drive(work())


def test_parameters_and_disarming_in_flight(fleet: Up) -> None:
    async def work() -> None:
        async with operator(fleet, size=(80, 24)) as someone:
            await make_fly(someone)
            await someone.press("5")
            params = someone.app.query_one("#params", Grid)
            await someone.sees(lambda: "TRIG_B2_DEG" in params.text, "the parameters")
            await someone.sees(lambda: "[0, 10]" in params.text, "the range")
            await someone.press("1", "x")
            await someone.answer("escape")
            assert someone.state(1).armed
            await someone.press("x")
            await someone.answer("enter")
            await someone.sees_event("1 action", "refused MAV_CMD_COMPONENT_ARM_DISARM")
            await someone.press("m")
            await someone.answer("right", "right", "enter")
            await someone.sees(lambda: "LOITER" in someone.row(1), "LOITER")
            await someone.press("m")
            await someone.answer("enter")
            await someone.sees(lambda: "AUTO" in someone.row(1), "AUTO")
            await someone.press("left_square_bracket")
            await someone.sees(lambda: someone.app.view.selected == 3, "UAV 3 selected")

    drive(work())


def test_the_event_log_is_filtered(fleet: Up) -> None:
    async def work() -> None:
        async with operator(fleet) as someone:
            await someone.press("6")
            log = someone.app.query_one(EventsPanel).query_one(EventTable)
            await someone.sees(lambda: log.text.count("vehicle found") == 3, "all events")
            await someone.choose("of", 2)
            await someone.sees(lambda: log.text.count("vehicle found") == 1, "of UAV 2")
            await someone.choose("of", 0)
            await someone.press("slash")
            await until_focused(someone.pilot, "event-text")
            await someone.press(*"found")
            await someone.sees(lambda: len(log.rows) == 3, "lines with a word")
            await someone.press("enter")
            await someone.sees(lambda: someone.app.focused is log, "focus on the list")
            await someone.choose("severity", 4)
            await someone.sees(lambda: not log.rows, "warnings only")
            await someone.press("1")
            tabs = someone.app.query_one(TabbedContent)
            await someone.sees(lambda: tabs.active == "fleet", "the fleet")

    drive(work())


def test_a_silent_vehicle_shows_and_is_picked_up_again(fleet: Up) -> None:
    """The delay is tested with the dashboard's clock in tests/unit/gcs/tui/test_tui.py."""

    async def work() -> None:
        async with operator(fleet, size=(80, 24)) as someone:
            pid = process_of(fleet.folder, "uav2")
            os.kill(pid, signal.SIGSTOP)
            try:
                await someone.sees(
                    lambda: "1 SILENT" in someone.app.export_screenshot().replace("&#160;", " "),
                    "silence",
                )
                await someone.sees(lambda: "LOST" in someone.row(2), "LOST")
                await someone.press("down", "down", "c")  # everything else goes on
                await someone.sees(lambda: "●" in someone.row(3), "UAV 3 is heard")
            finally:
                os.kill(pid, signal.SIGCONT)
            await someone.sees(lambda: "● 0." in someone.row(2), "back")
            await someone.sees_event("2 link", "link lost")
            await someone.sees_event("2 link", "link back")

    drive(work())
