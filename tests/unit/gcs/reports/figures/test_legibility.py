"""Every figure: units and numbers in each panel, colours that differ, axes that fit the signal."""

import ast
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest
from campaign_tables import campaign, draws_table, results_table, write_campaign
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from sweeping import swept

import gcs
from ftc_autopilot.control.laws import KINDS
from ftc_lab.baselines.combinations import AIRCRAFT, Combination
from ftc_lab.campaigns.findings import Findings, findings_of
from ftc_lab.figures import sweep
from ftc_lab.figures.campaign import distributions, importance, sobol_indices, two_factors
from ftc_lab.figures.combinations import draw_combinations
from ftc_lab.figures.events import fig7, fig8, fig9
from ftc_lab.figures.trajectories import fig5
from gcs.fleet.in_process import fly_in_process
from gcs.reports.figures import mission, overview
from gcs.reports.figures import style as style_module
from gcs.reports.figures.flown import PlottedFlight
from gcs.reports.figures.style import (
    REFERENCE,
    SINGLE,
    STYLES,
    frame,
    new_figure,
    save,
    style,
    usual_range,
)
from gcs.reports.figures.tracking import fig6, fig10, fig11
from gcs.results.mission_paths import leaders_of, paths_of
from gcs.results.preview import Preview
from gcs.results.recording import Recording, events_of
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, load_scenario

pytestmark = pytest.mark.slow

Draw: TypeAlias = Callable[[PlottedFlight], Figure]

DURATION_S = 3.0
WITHOUT_UNIT = r"(share|strength|transmissions|events) |^(mass|cl_alpha|idle)$"
"""Shares and counts; and factors of a campaign whose scenario is not there to name their units."""
SCENARIO_1 = Path(gcs.__file__).parents[1] / "scenarios" / "paper" / "scenario1.yaml"
# linear RGB as seen without red or green receptors (Machado, Oliveira and Fernandes, 2009)
DEUTERANOPIA = np.array(
    [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]], float
)
PROTANOPIA = np.array(
    [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]], float
)
MIN_DISTANCE = {"normal": (np.eye(3), 30.0), "deutan": (DEUTERANOPIA, 15.0)}
MIN_DISTANCE["protan"] = (PROTANOPIA, 15.0)


def lab(colour: str, seen: np.ndarray) -> np.ndarray:
    """A colour in CIELAB (D65), as a reader sees it."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array(
        [[0.4125, 0.3576, 0.1804], [0.2127, 0.7152, 0.0722], [0.0193, 0.1192, 0.9503]]
    )
    xyz = to_xyz @ np.clip(seen @ linear, 0.0, 1.0) / (0.9505, 1.0, 1.0888)
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def assert_distinguishable(colours: set[str]) -> None:
    for reader, (seen, least) in MIN_DISTANCE.items():
        for a, b in combinations(sorted(colours), 2):
            distance = np.linalg.norm(lab(a, seen) - lab(b, seen))
            assert distance >= least, f"{a} and {b} are {distance:.0f} apart ({reader})"


def captured(module: Any, draw: Callable[[], None]) -> Figure:
    """The figure that a function would save."""
    found: list[Figure] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "save", lambda figure, *_: found.append(figure))
        draw()
    [figure] = found
    return figure


def preview_of(flight: PlottedFlight) -> tuple[Recording, Preview]:
    recording, preview = flight.recording, Preview(flight.scenario)
    events = events_of(recording.signals, 0, recording.uav_ids, recording.step_us)
    preview.add(recording.steps, events)
    return preview.recording(recording.ending), preview


def overview_of(flight: PlottedFlight) -> Figure:
    shown, preview = preview_of(flight)
    draw = overview.draw_flight
    return captured(style_module, lambda: draw(shown, flight.scenario, preview.gaps(), Path()))


def mission_of(flight: PlottedFlight) -> Figure:
    """Of the same signals as if they were a mission's."""
    scenario = load_scenario("missions/hexagon").model_copy(update={"duration_s": DURATION_S})
    paths, leaders = paths_of(scenario), leaders_of(scenario)
    assert paths is not None
    signals = flight.recording.signals.copy()
    signals["path_position"] = np.arange(len(signals))[:, np.newaxis] * 0.04
    signals["slot"] = 0
    shown = replace(flight.recording, signals=signals)
    draw = mission.draw_mission
    return captured(style_module, lambda: draw(shown, scenario, paths, leaders, Path()))


def findings(folder: Path, **changes: Any) -> Findings:
    draws = draws_table(["a", "b"], 60)
    results = results_table(
        draws, {"a": ["completed"] * 60, "b": ["crashed"] * 5 + ["completed"] * 55}
    )
    write_campaign(folder, campaign(["a", "b"], 60, **changes), draws, results)
    return findings_of(folder)


OF_A_FLIGHT: dict[str, Draw] = {
    "fig5": fig5,
    "fig6": fig6,
    "fig7": fig7,
    "fig8": fig8,
    "fig9": lambda flight: fig9(flight, {1: {"throttle": 7}}),
    "fig10": lambda flight: fig10([replace(flight, label=f"law {k}") for k in range(len(STYLES))]),
    "fig11": lambda flight: fig11([flight, replace(flight, label="other")]),
    "flight": overview_of,
    "mission": mission_of,
}
WITH_SIGNALS = ["fig6", "fig10", "fig11", "flight", "mission"]
NAMES = [
    *OF_A_FLIGHT,
    *("distributions", "importance", "sobol_indices", "two_factors", "combinations", "sweep"),
]


@pytest.fixture(scope="module")
def flight(scenario1: Scenario) -> PlottedFlight:
    fault = scenario1.faults[0].model_copy(update={"start_s": 1.2, "end_s": 1.4})
    short = scenario1.model_copy(update={"duration_s": DURATION_S, "faults": (fault,)})
    return PlottedFlight("proposed", short, fly_in_process(short))


@pytest.fixture(scope="module")
def drawn(flight: PlottedFlight, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Figure]:
    folder = tmp_path_factory.mktemp("drawn")
    figures: dict[str, Figure | None] = {name: draw(flight) for name, draw in OF_A_FLIGHT.items()}
    own = findings(folder / "campaign")
    figures |= {each.__name__: each(own) for each in (distributions, importance, two_factors)}
    completed = {"a": ["completed"] * 80}
    plan = draws_table(["a"], 80)
    write_campaign(
        folder / "saltelli",
        campaign(["a"], 16, design="saltelli"),
        plan,
        results_table(plan, completed),
    )
    # 16 points of three factors: five flights each
    figures["sobol_indices"] = sobol_indices(findings_of(folder / "saltelli"))
    summary = summarise(flight.recording, flight.scenario)
    flown = [
        Combination(aircraft, law, "joint", flight.scenario, summary)
        for aircraft in AIRCRAFT
        for law in KINDS
    ]
    figures["combinations"] = draw_combinations(flown, 3)
    (folder / "short.yaml").write_text(f"extends: {SCENARIO_1}\nduration_s: 0.05\n")
    settings = ["trigger.b2_deg=0.5,1", "faults=[]", "controller.kind=pid,proposed"]
    points = swept([folder / "short.yaml"], settings, folder / "sweep")
    figures["sweep"] = captured(sweep, lambda: sweep.draw_sweep(points, 3, folder))
    assert sorted(figures) == sorted(NAMES)
    for figure in figures.values():
        assert figure is not None
        figure.draw_without_rendering()
    return figures  # type: ignore[return-value]  # none is None


def panels(figure: Figure) -> Iterator[Axes]:
    return (axes for axes in figure.axes if axes.get_visible() and axes.get_label() != "<colorbar>")


def texts(axis: Axis) -> list[str]:
    """The visible labels of an axis's ticks."""
    labels = [tick.label1 for tick in axis.get_major_ticks()]
    return [label.get_text() for label in labels if label.get_visible() and label.get_text()]


def is_number(text: str) -> bool:
    return bool(re.fullmatch(r"[\d.,−$\\a-z{}^]*\d[\d.,−$\\a-z{}^]*", text))


@pytest.mark.parametrize("name", NAMES)
def test_every_panel_has_numbers_and_units_of_its_own(drawn: dict[str, Figure], name: str) -> None:
    for axes in panels(drawn[name]):
        beside = axes.get_shared_y_axes().get_siblings(axes)
        for axis, others in ((axes.xaxis, []), (axes.yaxis, beside)):
            label, shown = axis.get_label().get_text(), texts(axis)
            named = [text for other in others for text in texts(other.yaxis)]
            if named and not all(map(is_number, named)):
                continue  # names of factors, once in a row
            assert shown, f"{label}: no tick has a label"
            if all(map(is_number, shown)):
                assert re.search(r"\[.+\]", label) or re.search(WITHOUT_UNIT, label), label


@pytest.mark.parametrize("name", NAMES)
def test_colours_of_a_panel_differ(drawn: dict[str, Figure], name: str) -> None:
    for axes in panels(drawn[name]):
        found = {to_hex(line.get_color()) for line in axes.lines}
        assert_distinguishable({each for each in found if len(set(to_rgb(each))) > 1})


@pytest.mark.parametrize("name", ["fig5", "fig6", "flight", "mission"])
def test_every_uav_has_a_colour_of_its_own(drawn: dict[str, Figure], name: str) -> None:
    palette = {style.colour.lower() for style in STYLES[:3]}
    for axes in panels(drawn[name]):
        if axes.get_ylabel() not in {"least separation [m]"}:
            assert palette <= {to_hex(line.get_color()) for line in axes.lines}


def test_the_palette_can_be_distinguished_by_every_reader() -> None:
    assert_distinguishable({*(style.colour for style in STYLES), str(REFERENCE["color"])})
    assert_distinguishable({SINGLE, STYLES[1].colour})


def test_no_two_of_a_large_fleet_look_the_same() -> None:
    assert len({(style(i).colour, style(i).dashes) for i in range(18)}) == 18


def spans(figure: Figure) -> np.ndarray:
    """Lengths of the y axes of signals over time: not of maps, not of intervals between events."""
    return np.array(
        [
            np.ptp(axes.get_ylim())
            for axes in panels(figure)
            if axes.get_xlabel() == "time [s]" and axes.get_yscale() == "linear"
        ]
    )


@pytest.mark.parametrize("start", [0, 1700])
@pytest.mark.parametrize("name", WITH_SIGNALS)
def test_a_transient_does_not_scale_an_axis(
    drawn: dict[str, Figure], flight: PlottedFlight, name: str, start: int
) -> None:
    recording = flight.recording
    brief = slice(start, start + 100)  # 0.1 s
    signals, states = recording.signals.copy(), recording.states.copy()
    states[brief, 2] += 100.0
    for field in ("V", "held", "error", "sync_error"):
        signals[field][brief, 2] += 100.0
    spiked = replace(flight, recording=replace(recording, signals=signals, states=states))
    before, after = spans(drawn[name]), spans(OF_A_FLIGHT[name](spiked))
    assert len(after) >= 7
    assert np.all(after <= 1.75 * before), after / before


@pytest.mark.parametrize("name", ["flight", "mission"])
@pytest.mark.parametrize("offset", [0.0, -9_000.0])
def test_numbers_and_labels_have_room(flight: PlottedFlight, name: str, offset: float) -> None:
    """Without a layout of matplotlib's; with short numbers, and long ones."""
    recording = flight.recording
    signals, states = recording.signals.copy(), recording.states.copy()
    states[:, :, :2] += offset
    signals["held"] += offset
    moved = replace(flight, recording=replace(recording, signals=signals, states=states))
    figure = OF_A_FLIGHT[name](moved)
    figure.draw_without_rendering()
    boxes = [box for axes in panels(figure) if (box := axes.get_tightbbox()) is not None]
    boxes += [legend.get_window_extent() for legend in figure.legends]
    page = figure.bbox.padded(1.0)
    for box in boxes:
        assert page.containsx(box.x0)
        assert page.containsx(box.x1)
        assert page.containsy(box.y0)
        assert page.containsy(box.y1)
    for one, other in combinations(boxes, 2):
        assert not one.padded(-4.0).overlaps(other.padded(-4.0))


values = st.lists(st.floats(-1e3, 1e3) | st.just(np.nan), min_size=1, max_size=300)


@given(values, st.sampled_from([0.001, 0.02, 1.0]))
def test_the_usual_range_is_within_the_full_one(shown: list[float], step_s: float) -> None:
    curve = np.array(shown)
    low, high = usual_range([curve], step_s)
    if np.isnan(curve).all():
        assert np.isnan([low, high]).all()
    else:
        assert np.nanmin(curve) <= low <= high <= np.nanmax(curve)
    axes = new_figure(2.0).subplots()
    frame(axes, [curve], low, high)
    assert np.isfinite(axes.get_ylim()).all()


@given(st.floats(-1e3, 1e3), st.floats(0.01, 10.0), st.floats(0.5, 100.0))
@example(40.0, 0.05, 5.0)
def test_a_note_says_how_far_a_signal_leaves_its_axis(
    base: float, amplitude: float, peak: float
) -> None:
    curve = base + amplitude * np.sin(np.arange(2000) / 50.0)
    curve[7] = base + (1.1 + peak) * amplitude
    axes = new_figure(2.0).subplots()
    frame(axes, [curve], base - amplitude, base + amplitude)
    noted = float(axes.get_title("right").removeprefix("max ").replace("−", "-"))
    top = axes.get_ylim()[1]
    assert abs(noted - curve[7]) <= 0.5 * (curve[7] - top)
    assert noted > top


@given(st.integers(0, 23_900), st.integers(1, 100), st.floats(10.0, 1e9))
@example(0, 100, 1e9)
def test_what_is_brief_is_left_out_and_what_lasts_is_not(
    start: int, steps: int, height: float
) -> None:
    curve = np.sin(np.arange(24_000) / 500.0)
    curve[start : start + steps] = height
    low, high = usual_range([curve, np.zeros(24_000)], 0.001)
    assert high - low <= 3.01
    curve[: 24_000 // 2] = height
    assert usual_range([curve], 0.001)[1] == height


def test_every_image_is_saved_as_png_and_svg(tmp_path: Path) -> None:
    figure = new_figure(2.0)
    figure.subplots().plot([0.0, 1.0])
    save(figure, tmp_path, "one")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.png", "one.svg"]
    writers = {
        path.name
        for path in Path(gcs.__file__).parent.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr in {"savefig", "print_png", "print_svg"}
    }
    assert writers == {"style.py"}


def test_the_overview_names_uavs_faults_and_what_panels_leave_out(flight: PlottedFlight) -> None:
    recording = flight.recording
    lost = replace(flight, recording=replace(recording, loss="UAV 3 was lost"))
    figure = overview_of(lost)
    [legend] = figure.legends
    named = [text.get_text() for text in legend.get_texts()]
    uavs = ["leader", "follower 1", "follower 2", "reference"]
    assert named[:4] == uavs
    assert named[4].startswith("fault: rudder of follower 2")
    assert named[5] == f"flight lost at {DURATION_S:.2f} s"
    thrust = figure.axes[4]
    assert thrust.get_ylabel() == "thrust [N]"
    assert thrust.get_title("right").startswith("min 0")  # before the first command
    held = np.degrees(recording.signals["held"][:, 1, 0])
    line = figure.axes[5].lines[1]
    assert line.get_drawstyle() == "steps-post"
    at = np.searchsorted(recording.time_s, np.asarray(line.get_xdata()))
    np.testing.assert_allclose(np.asarray(line.get_ydata()), held[at])
