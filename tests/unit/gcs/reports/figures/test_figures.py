"""Figures: what is drawn, named and shaded, and that files are the same each time."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from ftc_autopilot.control.signals import no_signals
from ftc_lab.figures.events import fig7, fig8, fig9
from ftc_lab.figures.trajectories import fig5
from gcs.fleet.in_process import fly_in_process
from gcs.reports.figures.flown import PlottedFlight, fault_windows
from gcs.reports.figures.overview import draw_flight
from gcs.reports.figures.style import STYLES, decimated, draw_curve, frame, new_figure, save
from gcs.reports.figures.tracking import fig6, fig10, fig11
from gcs.results.preview import Preview
from gcs.results.quantities import PAPER_ORDER, QUANTITIES
from gcs.results.recording import events_of
from gcs.scenario.model import Scenario
from gcs.scenario.sections import ScenarioFault

pytestmark = pytest.mark.slow

Draw: TypeAlias = Callable[[PlottedFlight], Figure]

DURATION_S = 2.5
FAULT = "fault: rudder of follower 2 at 90 %, 1.2 s to 1.4 s"
UAVS = ["leader", "follower 1", "follower 2"]
PRINTED = {1: {"throttle": 7, "rudder": 11}, 3: dict.fromkeys(PAPER_ORDER, 5)}
DRAW: dict[str, Draw] = {
    "fig5": fig5,
    "fig6": fig6,
    "fig7": fig7,
    "fig8": fig8,
    "fig9": lambda flight: fig9(flight, PRINTED),
    "fig10": lambda flight: fig10([flight, replace(flight, label="other")]),
    "fig11": lambda flight: fig11([flight, replace(flight, label="other")]),
}
OVER_TIME = ["fig6", "fig7", "fig8", "fig10", "fig11"]


@pytest.fixture(scope="module")
def flight(scenario1: Scenario) -> PlottedFlight:
    fault = scenario1.faults[0].model_copy(update={"start_s": 1.2, "end_s": 1.4})
    short = scenario1.model_copy(update={"duration_s": DURATION_S, "faults": (fault,)})
    return PlottedFlight("proposed", short, fly_in_process(short))


@pytest.fixture(scope="module")
def drawn(flight: PlottedFlight) -> dict[str, Figure]:
    return {name: draw(flight) for name, draw in DRAW.items()}


def draw_overview(flight: PlottedFlight, folder: Path) -> None:
    recording = flight.recording
    preview = Preview(flight.scenario)
    events = events_of(recording.signals, 0, recording.uav_ids, recording.step_us)
    preview.add(recording.steps, events)
    shown = preview.recording(recording.ending)
    draw_flight(shown, flight.scenario, preview.gaps(), folder)


def lost_after(flight: PlottedFlight, steps: int) -> PlottedFlight:
    recording = flight.recording
    short = replace(
        recording,
        states=recording.states[:steps],
        wind=recording.wind[:steps],
        applied=recording.applied[:steps],
        signals=recording.signals[:steps],
        loss="UAV 3 was lost",
    )
    return replace(flight, recording=short)


def panels(figure: Figure) -> list[Axes]:
    return [axis for axis in figure.axes if axis.get_title("left")]


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for box in figure.legends for text in box.get_texts()]


def line(axis: Axes, name: str) -> Line2D:
    [found] = [line for line in axis.lines if line.get_label() == name]
    return found


def shades(axis: Axes) -> Iterator[tuple[str, float, float]]:
    for patch in axis.patches:
        if isinstance(patch, Rectangle) and str(patch.get_label()).startswith("fault"):
            begin, end = patch.get_x(), patch.get_x() + patch.get_width()
            yield str(patch.get_label()), round(begin, 9), round(end, 9)


@pytest.mark.parametrize(
    ("name", "letters"),
    [
        ("fig6", "abcdefghijkl"),
        ("fig7", "abcdefghijkl"),
        ("fig8", "abc"),
        ("fig10", "abcdefgh"),
        ("fig11", "abcdefgh"),
    ],
)
def test_panels_have_letters(drawn: dict[str, Figure], name: str, letters: str) -> None:
    found = [axis.get_title("left") for axis in panels(drawn[name])]
    assert found == [f"({letter})" for letter in letters]


@pytest.mark.parametrize("name", ["fig6", "fig10", "fig11"])
def test_quantities_have_units(drawn: dict[str, Figure], name: str) -> None:
    for k, axis in enumerate(panels(drawn[name])):
        what = QUANTITIES[k % 4] + ("", " error", " sync. error")[k // 4]
        assert axis.get_ylabel() == f"{what} [{'deg' if k % 4 else 'm/s'}]"


@pytest.mark.parametrize("name", OVER_TIME)
def test_time_has_a_unit(drawn: dict[str, Figure], name: str) -> None:
    assert {axis.get_xlabel() for axis in panels(drawn[name])} == {"time [s]"}


@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("fig5", UAVS),
        ("fig6", [*UAVS, "reference", FAULT]),
        ("fig7", [FAULT]),
        ("fig8", [FAULT]),
        ("fig9", ["proposed", "printed in the paper"]),
        ("fig10", ["proposed", "other", "reference", FAULT]),
        ("fig11", ["proposed", "other", "reference", FAULT]),
    ],
)
def test_the_legend_names_everything_once(
    drawn: dict[str, Figure], name: str, names: list[str]
) -> None:
    assert sorted(legend(drawn[name])) == sorted(names)


@pytest.mark.parametrize("name", OVER_TIME)
def test_the_fault_is_shaded_while_it_acts(drawn: dict[str, Figure], name: str) -> None:
    axes = panels(drawn[name])
    of_follower_2 = {"fig7": axes[2::3], "fig8": axes[2:]}.get(name, axes)
    for axis in axes:
        expected = [(FAULT, 1.2, 1.4)] if axis in of_follower_2 else []
        assert list(shades(axis)) == expected


@pytest.mark.parametrize("name", ["fig6", "fig10", "fig11"])
def test_the_reference_is_dashed_and_the_curves_are_the_flight(
    drawn: dict[str, Figure], flight: PlottedFlight, name: str
) -> None:
    top = panels(drawn[name])[:4]
    name, i = ("follower 1", 1) if name == "fig6" else ("proposed", 2)
    for k, axis in enumerate(top):
        assert line(axis, "reference").is_dashed()
        t, shown = line(axis, name).get_data()
        flown = np.interp(np.asarray(t), flight.recording.time_s, flight.response(i)[:, k])
        np.testing.assert_allclose(np.asarray(shown), flown)


def test_styles_differ_without_colour() -> None:
    assert len({(style.dashes, style.width) for style in STYLES}) == len(STYLES)
    assert len({style.colour for style in STYLES}) == len(STYLES)


def test_trajectories_have_units_times_and_paths(flight: PlottedFlight) -> None:
    [axis] = fig5(flight, times_s=(0.0, 1.0, 99.0)).axes
    labels = [axis.get_xlabel(), axis.get_ylabel(), axis.get_zlabel()]  # type: ignore[attr-defined]  # 3D
    assert labels == ["north [m]", "east [m]", "altitude [m]"]
    assert [text.get_text() for text in axis.texts] == ["0 s", "1 s"]
    path = np.array(line(axis, "follower 2").get_data_3d())  # type: ignore[attr-defined]  # 3D
    np.testing.assert_array_equal(path[:, 0], [-40.0, 40.0, 100.0])
    np.testing.assert_array_equal(
        path[:, -1], flight.recording.states[-1, 2, :3] * [1.0, 1.0, -1.0]
    )


def test_intervals_are_those_between_events(
    drawn: dict[str, Figure], flight: PlottedFlight
) -> None:
    axis = panels(drawn["fig7"])[4]  # aileron of follower 1
    at = np.flatnonzero(flight.recording.signals["events"][:, 1] & 1)
    np.testing.assert_allclose(np.asarray(axis.lines[0].get_ydata()), np.diff(at))
    assert axis.get_yscale() == "log"
    assert axis.get_title("right").startswith(f"{len(at)} events, median")


def test_no_event_gets_lost_between_bins(drawn: dict[str, Figure], flight: PlottedFlight) -> None:
    for i, axis in enumerate(panels(drawn["fig8"])):
        shown = [int(np.ma.asarray(image.get_array()).filled(0).sum()) for image in axis.images]
        assert shown == flight.event_counts(i)


def test_bars_carry_their_numbers(drawn: dict[str, Figure], flight: PlottedFlight) -> None:
    for i, axis in enumerate(drawn["fig9"].axes):
        printed = PRINTED.get(flight.recording.uav_ids[i], {})
        numbers = [*flight.event_counts(i), *printed.values()]
        assert [text.get_text() for text in axis.texts] == [str(n) for n in numbers]
        assert axis.get_xlabel() == UAVS[i]
    assert legend(fig9(flight, {})) == ["proposed"]


def test_errors_under_faults_are_shown_about_their_time(flight: PlottedFlight) -> None:
    axes = panels(fig11([flight]))
    assert axes[0].get_xlim() == (0.0, DURATION_S)
    assert axes[4].get_xlim() == pytest.approx((0.2, 2.4))


@pytest.mark.parametrize("steps", [0, 700])
@pytest.mark.parametrize("name", DRAW)
def test_a_lost_flight_draws_and_says_so(flight: PlottedFlight, name: str, steps: int) -> None:
    lost = lost_after(flight, steps)
    figure = DRAW[name](lost)
    said = [*legend(figure), *(text.get_text() for text in figure.axes[0].texts)]
    assert any(f"lost at {steps / 1000:.2f} s" in text for text in said) or (name, steps) == (
        "fig5",
        0,
    )
    if name in OVER_TIME:
        assert panels(figure)[0].get_xlim() == (0.0, DURATION_S)


@given(st.lists(st.floats(-1e6, 1e6), max_size=200), st.integers(1, 20))
def test_decimation_keeps_extremes_ends_and_order(values: list[float], buckets: int) -> None:
    t, y = np.arange(float(len(values))), np.array(values)
    thin_t, thin_y = decimated(t, y, buckets)
    assert np.all(np.diff(thin_t) > 0)
    np.testing.assert_array_equal(thin_y, y[thin_t.astype(int)])
    assert len(thin_y) <= 2 * buckets + 2
    if values:
        assert (thin_y.min(), thin_y.max()) == (y.min(), y.max())
        assert (thin_t[0], thin_t[-1]) == (0, len(values) - 1)


@given(st.integers(0, 23_999), st.floats(1.0, 1e3))
def test_decimation_keeps_a_spike_where_it_is(step: int, height: float) -> None:
    t, y = np.arange(24_000) / 1e3, np.zeros(24_000)
    y[step] = height
    thin_t, thin_y = decimated(t, y)
    assert thin_t[thin_y.argmax()] == t[step]
    assert thin_y.max() == height


def test_a_line_breaks_where_the_angle_wraps() -> None:
    axis = new_figure(2.0).subplots()
    draw_curve(axis, np.arange(4.0), np.array([170.0, 179.0, -172.0, -160.0]))
    shown = axis.lines[0].get_ydata()
    np.testing.assert_array_equal(shown, [170.0, 179.0, np.nan, -172.0, -160.0])


def with_missing(flight: PlottedFlight, begin: int, end: int) -> PlottedFlight:
    """The same flight, of which UAV 2's autopilot missed some steps."""
    signals = flight.recording.signals.copy()
    signals[begin:end, 1] = no_signals(end - begin)
    return replace(flight, recording=replace(flight.recording, signals=signals))


@pytest.mark.parametrize("name", DRAW)
def test_missing_steps_are_counted_in_every_figure_of_one_flight(
    flight: PlottedFlight, name: str
) -> None:
    figure = DRAW[name](with_missing(flight, 1000, 1500))
    said = [*legend(figure), *(text.get_text() for axis in figure.axes for text in axis.texts)]
    said += [label for axis in figure.axes for label in (axis.get_ylabel(), axis.get_xlabel())]
    if name not in {"fig10", "fig11"}:  # they show UAV 3
        assert any("follower 1 (500 steps missing)" in text for text in said)


def test_missing_steps_are_gaps_except_in_the_true_response(flight: PlottedFlight) -> None:
    axes = panels(fig6(with_missing(flight, 1000, 1500)))
    for axis in axes:
        t, shown = map(np.asarray, line(axis, "follower 1 (500 steps missing)").get_data())
        inside = shown[(t > 1.005) & (t < 1.495)]
        assert np.isnan(inside).any() == (axis not in axes[:4])
        assert np.isnan(inside).all() == (axis not in axes[:4])
        assert np.isfinite(shown[(t < 0.995) | (t > 1.505)]).all()


def test_a_flight_without_any_signal_is_drawn(
    flight: PlottedFlight, drawn: dict[str, Figure], tmp_path: Path
) -> None:
    signals = np.stack([no_signals(len(flight.recording.states))] * 3, axis=1)
    recording = replace(flight.recording, signals=signals)
    for name, draw in DRAW.items():
        found, full = panels(draw(replace(flight, recording=recording))), panels(drawn[name])
        assert [axis.get_title("left") for axis in found] == [
            axis.get_title("left") for axis in full
        ]
    draw_overview(replace(flight, recording=recording), tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"flight.png", "flight.svg"}


@given(st.lists(st.floats(-1e6, 1e6) | st.just(np.nan), min_size=1, max_size=200))
def test_decimation_does_not_let_gaps_hide_extremes(values: list[float]) -> None:
    y = np.array(values)
    _, thin = decimated(np.arange(float(len(y))), y, 5)
    assert np.isnan(y).all() == np.isnan(thin).all()
    if not np.isnan(y).all():
        assert (np.nanmin(thin), np.nanmax(thin)) == (np.nanmin(y), np.nanmax(y))


def test_what_leaves_a_panel_is_noted() -> None:
    axis = new_figure(2.0).subplots()
    frame(axis, [np.array([-0.5, 0.5, 12.25])], -1.0, 1.0)
    assert axis.get_ylim() == pytest.approx((-0.59, 1.09))
    assert axis.get_title("right") == "max 12"


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ({"actuator": "rudder", "effectiveness": 0.9}, "rudder of leader at 90 %"),
        (
            {"actuator": "elevator", "effectiveness": 0.9, "bias_deg": 0.5},
            "elevator of leader at 90 % + 0.5°",
        ),
        ({"actuator": "throttle", "bias_n": -20.0}, "throttle of leader − 20 N"),
        (
            {"actuator": "aileron", "stuck_deg": -3.0, "frequency_hz": 2.0},
            "aileron of leader stuck at −3°, 2 Hz",
        ),
    ],
)
def test_faults_as_text(flight: PlottedFlight, fault: dict[str, object], text: str) -> None:
    found = ScenarioFault.model_validate({"uav": 1, "start_s": 1.0, **fault})
    late = found.model_copy(update={"start_s": 10.0})
    scenario = flight.scenario.model_copy(update={"faults": (found, late)})
    [window] = fault_windows([replace(flight, scenario=scenario)])
    assert window.text == f"fault: {text}, 1 s to 2.5 s"
    assert (window.start_s, window.end_s) == (1.0, DURATION_S)


def test_different_faults_at_one_time_share_a_window(flight: PlottedFlight) -> None:
    other = flight.scenario.faults[0].model_copy(update={"actuator": "aileron"})
    scenario = flight.scenario.model_copy(update={"faults": (other,)})
    [window] = fault_windows([flight, replace(flight, scenario=scenario)])
    assert window.text == "faults of follower 2, 1.2 s to 1.4 s"


@pytest.mark.parametrize("name", ["fig5", "fig8", "fig9"])
def test_files_are_the_same_each_time_and_small(
    flight: PlottedFlight, name: str, tmp_path: Path
) -> None:
    files = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        save(DRAW[name](flight), folder, name)
        files.append([(folder / f"{name}.{suffix}").read_bytes() for suffix in ("png", "svg")])
    assert files[0] == files[1]
    png, svg = files[0]
    assert png.startswith(b"\x89PNG")
    assert re.search(rb"<svg ", svg)
    assert b"<dc:date>" not in svg
    assert len(svg) < 1_500_000
