"""Texts in tables: what is too long, numbers, and how the fleet table uses its width."""

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from plain_faults import actuator_fault
from rich.cells import cell_len
from textual.pilot import Pilot
from tui_bench import Station, at_screen, live, sent

from gcs.tui.app import Dashboard
from gcs.tui.events import EventTable
from gcs.tui.fleet_table import _GROUP_WIDTH, _MIN_FAULTS, FleetTable, diagnosis_text
from gcs.tui.grid import GridColumn, Row, _fit
from gcs.tui.key_bar import KeyBar
from gcs.tui.wire_panel import WirePanel
from mavlink_defs import dialect
from mavlink_defs.visible import visible

SIZES = [(80, 24), (120, 40), (200, 50)]
NUMBER = re.compile(r"[0-9]+(?:[.,][0-9]+)*(?:e[+-]?[0-9]+)?")


@given(text=st.text(), width=st.integers(0, 40), align=st.sampled_from(["left", "right"]))
def test_a_cell_is_as_wide_as_its_column(text: str, width: int, align: str) -> None:
    fitted = _fit(text, width, align)  # type: ignore[arg-type]  # one of the two
    assert cell_len(fitted) == width
    assert visible(fitted) == fitted


@given(
    parts=st.lists(
        st.sampled_from(["at ", " %", "(", ", ", "-"])
        | st.floats(0, 1e7).map("{:.6g}".format)
        | st.floats(0, 600).map("{:.3f}".format)
    ),
    width=st.integers(1, 40),
)
@example(parts=["until ", "540.066", "] s"], width=10)
@example(parts=["until ", "540.066", "] s"], width=11)
def test_no_number_in_a_text_is_cut(parts: list[str], width: int) -> None:
    text = "|".join(parts)
    fitted = _fit(text, width, "left")
    assert set(NUMBER.findall(fitted)) <= set(NUMBER.findall(text))


def test_a_scroll_bar_hides_no_text() -> None:
    station = Station(1)
    text = "texts " * 50

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        grid = app.query_one(EventTable)
        for count, there in ((1, False), (99, True), (1, False)):
            rows = [Row(i, ((text, ""),)) for i in range(count)]
            grid.show([GridColumn("text", 0, "left")], rows)
            await pilot.pause()
            assert grid.show_vertical_scrollbar == there
            room = grid.scrollable_content_region.width
            assert grid.render_line(1).text == _fit(text, room, "left")

    at_screen(live(station), work)


@given(value=st.floats(allow_nan=False), width=st.integers(1, 9), digits=st.integers(0, 3))
@example(value=123456.78, width=6, digits=2)
@example(value=-1e300, width=6, digits=2)
def test_a_number_too_long_loses_digits_behind_the_point_only(
    value: float, width: int, digits: int
) -> None:
    fitted = _fit(f"{value:.{digits}f}", width, "right").strip()
    assert fitted == "…" or float(fitted) == pytest.approx(value, rel=0.5, abs=0.5)


@pytest.mark.parametrize(
    ("phases", "expected"),
    [
        ((0, 0, 0, 0), ("healthy", 0)),
        ((0, 1, 0, 1), ("elevator throttle?", 1)),
        ((2, 1, 0, 0), ("aileron lost", 2)),
    ],
)
def test_diagnoses_as_texts(phases: tuple[int, ...], expected: tuple[str, int]) -> None:
    assert diagnosis_text(phases) == expected


def faults_of(station: Station, count: int) -> tuple[str, ...]:
    """Let a vehicle on a path have active faults; return their texts."""
    tracking = dialect.MAVLink_ftc_tracking_message(50_000, [40.0, 0, 0, 0], [0] * 4, [0] * 4)
    path = dialect.MAVLink_ftc_formation_message(
        50_000, 1, 9.0, 1.0, [0.0] * 3, [0.0] * 3, 28.0, 2, 0, 0, 0, [0] * 64
    )
    for message in (tracking, path):
        station.fleet.receive(sent(message, 1), station.time_s)
    faults = tuple(actuator_fault(i, 0.93, 0.5, 0.0, 39.082 + i, 539.064) for i in range(count))
    station.fleet.vehicles[1].learn_faults(faults, station.time_s)
    return tuple(fault.describe() for fault in faults)


@pytest.mark.parametrize("width", [120, 150, 175, 200, 240])
@pytest.mark.parametrize("diagnoses", [False, True])
def test_active_faults_are_shown_in_full_and_groups_take_the_room_that_is_left(
    diagnoses: bool, width: int
) -> None:
    station = Station(1, 2)
    if diagnoses:
        nothing = [0.0] * 4
        phases = dialect.MAVLink_ftc_diagnosis_message(0, nothing, nothing, nothing, [0, 0, 2, 0])
        station.fleet.receive(sent(phases, 1), station.time_s)

    async def look(app: Dashboard, pilot: Pilot[None], count: int) -> None:
        text = " · ".join(faults_of(station, count))
        app.refresh_view(force=True)
        await pilot.pause()
        table = app.query_one(FleetTable)
        titles = [column.title for column in table.columns]
        groups = {column.group for column in table.columns if column.group}
        drawn = "".join(segment.text for segment in table.render_line(2))
        free = table.room - sum(column.width + 1 for column in table.columns)
        if free + _GROUP_WIDTH * (len(groups) - 1) >= len(text):  # beside one group at least
            assert text in drawn
            assert len(groups) == 5 or free < max(len(text), _MIN_FAULTS) + _GROUP_WIDTH
        assert ("diagnosis" in titles) == ("rudder lost" in drawn)
        assert diagnoses or "diagnosis" not in titles
        if diagnoses and len(groups) > 2:
            assert "diagnosis" in titles

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        for count in (0, 1, 2, 0):
            await look(app, pilot, count)

    at_screen(live(station), work, (width, 50))


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_nothing_is_cut_in_titles_and_keys(size: tuple[int, int]) -> None:
    station = Station(1, 2)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        faults_of(station, 2)
        for key in "1234567":
            await pilot.press(key)
            app.refresh_view(force=True)
            await pilot.pause()
            bar = app.query_one(KeyBar)
            keys = list(bar.children)
            assert {"help", "quit"} <= {getattr(key, "action", "") for key in keys}
            palette = next(key for key in keys if key.has_class("-command-palette"))
            others = [key for key in keys if key is not palette]
            assert max(key.region.right for key in others) <= palette.region.x
            if key == "1":
                wire = app.query_one(WirePanel)
                title = "".join(segment.text for segment in wire.render_line(0))
                assert "…" not in title
                assert len(str(wire.border_title)) < wire.size.width

    at_screen(live(station), work, size)
