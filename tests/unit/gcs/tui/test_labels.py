"""What a reader sees on a map: whole labels, apart from each other, whatever the places."""

import re

import plotext  # type: ignore[import-untyped]  # has no annotations
import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual.pilot import Pilot
from tui_bench import at_screen, playback

from gcs.tui.app import MIN_SIZE, Dashboard
from gcs.tui.curves import Palette
from gcs.tui.key_bar import KeyBar
from gcs.tui.keys import TABS
from gcs.tui.labels import MapMark, draw_marks, sheet_of

GREY = (9, 9, 9)
PALETTE = Palette(GREY, GREY, GREY, (GREY, GREY, GREY, GREY), GREY, GREY)
LABEL = re.compile(r"(?P<one>[↑↗→↘↓↙←↖·](\d+)( \+(\d+))?|(\d+)[↑↗→↘↓↙←↖·]|(\d+)×)")

_metres = st.floats(-30.0, 30.0)
_places = st.one_of(
    st.tuples(_metres, _metres),
    st.tuples(st.integers(-2, 2).map(float), st.integers(-4, 4).map(float)),
)
_fleets = st.dictionaries(st.integers(1, 255), _places, max_size=12)


def drawn(
    fleet: dict[int, tuple[float, float]],
    route: list[tuple[int, tuple[float, float]]],
    selected: int | None,
    size: tuple[int, int],
) -> list[str]:
    """Return the lines within the axes."""
    plotext.clear_figure()
    plotext.limit_size(False, False)
    plotext.plotsize(*size)
    plotext.plot([0.0], [0.0], marker=" ")
    sheet = sheet_of(plotext, size, (0.0, 0.0), (31.0, 31.0))
    draw_marks(sheet, [MapMark(i, "↑", at, i == selected) for i, at in fleet.items()], PALETTE)
    for at in fleet.values():
        sheet.write_sign("○", at, PALETTE.text)
    for number, at in route:
        sheet.write_number(number, at, PALETTE.route)
    lines = plotext.uncolorize(plotext.build()).splitlines()[1:-2]
    return [re.split("[┤│]", line, maxsplit=1)[1].rstrip("│") for line in lines]


@given(
    fleet=_fleets,
    route=st.lists(st.tuples(st.integers(1, 400), _places), max_size=8),
    first=st.booleans(),
    size=st.sampled_from([(20, 8), (44, 17), (90, 30)]),
)
def test_every_vehicle_is_counted_and_no_number_is_read_wrongly(
    fleet: dict[int, tuple[float, float]],
    route: list[tuple[int, tuple[float, float]]],
    first: bool,
    size: tuple[int, int],
) -> None:
    selected = min(fleet, default=None) if first else None
    lines = drawn(fleet, route, selected, size)
    counted, single = 0, set()
    for line in lines:
        for hit in LABEL.finditer(line):
            _, with_arrow, _, more, arrow_after, several = hit.groups()
            counted += int(several or 1) + int(more or 0)
            single |= {int(i) for i in (with_arrow, arrow_after) if i}
    assert counted == len(fleet), "\n".join(lines)
    assert single <= set(fleet)
    assert selected is None or selected in single
    numbers = {int(n) for line in lines for n in re.findall(r"\d+", LABEL.sub(" ", line))}
    assert numbers <= {number for number, _ in route}, "\n".join(lines)


def test_a_formation_in_one_cell_is_counted() -> None:
    lines = drawn(dict.fromkeys((1, 2, 3), (0.0, 0.0)), [], None, (44, 17))
    assert [line.strip() for line in lines if line.strip()] == ["3×"]
    lines = drawn(dict.fromkeys((1, 2, 3), (0.0, 0.0)), [], 2, (44, 17))
    assert [line.strip() for line in lines if line.strip()] == ["↑2 +2"]


@pytest.mark.parametrize("name", TABS)
def test_help_and_the_way_out_show_on_every_panel(name: str) -> None:
    def shown(app: Dashboard) -> list[str]:
        keys = app.query_one(KeyBar).children
        whole = [key for key in keys if 0 < key.region.right <= app.size.width]
        return [getattr(key, "action", "") for key in whole]

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        app.action_tab(name)
        for _ in range(200):
            await pilot.pause(0.01)
            if {"help", "quit"} <= set(shown(app)):
                return
        raise AssertionError(shown(app))

    at_screen(playback(), work, MIN_SIZE)
