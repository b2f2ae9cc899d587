"""The figure of a mission, and the path in a KML file, from a short flight in formation."""

import dataclasses
import xml.etree.ElementTree as ET
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from gcs.fleet.in_process import fly_in_process, fly_in_steps
from gcs.reports.figures.mission import draw_mission, mission_figure
from gcs.reports.flight import flight_tables
from gcs.results.choices import Format, Record
from gcs.results.export import convert
from gcs.results.figures import FlightSummary
from gcs.results.mission_paths import leaders_of, paths_of
from gcs.results.recorder import FlightRecorder
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, load_scenario

pytestmark = pytest.mark.slow

_SPACE = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("missions/hexagon").model_copy(update={"duration_s": 15.0})


@pytest.fixture(scope="module")
def flown(
    scenario: Scenario, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, FlightSummary, Recording]:
    folder = tmp_path_factory.mktemp("run")
    recorder = FlightRecorder(scenario, folder, Record.LIGHT)
    ending = fly_in_steps(scenario, recorder.add)
    return folder, recorder.finish(ending), recorder.preview.recording(ending)


def test_the_summary_tells_the_truth_about_the_path(
    flown: tuple[Path, FlightSummary, Recording],
) -> None:
    _, summary, recording = flown
    distances = [
        np.linalg.norm(recording.states[:, a, :3] - recording.states[:, b, :3], axis=1).min()
        for a, b in ((0, 1), (0, 2), (1, 2))
    ]
    assert summary.separation is not None
    assert summary.separation.least_m == pytest.approx(min(distances), abs=0.05)
    for uav in summary.uavs:
        assert uav.path is not None
        assert uav.path.flown_steps == 15_000
        assert 4_990 < uav.path.counted_steps < 5_000  # not the first ten seconds
        assert uav.path.slot_max_m is not None
        assert 0.0 < uav.path.slot_max_m < 5.0
    assert FlightSummary.from_json(summary.to_json()) == summary


def test_the_tables_tell_of_path_and_separation(
    flown: tuple[Path, FlightSummary, Recording], scenario: Scenario
) -> None:
    printed = StringIO()
    console = Console(width=100, file=printed)
    console.print(*flight_tables(flown[1], scenario), sep="\n")
    lines = printed.getvalue().splitlines()
    (begin,) = (i for i, line in enumerate(lines) if "Path: largest errors" in line)
    table = "\n".join(lines[begin:])
    assert all(f"│ {name}" in table for name in ("1 leader", "2 right", "3 left"))
    assert table.count("33.33 %") == 3  # the last 5 of 15 s
    assert "least separation 2" in table


def test_a_figure_is_drawn_with_the_formation(
    flown: tuple[Path, FlightSummary, Recording], scenario: Scenario, tmp_path: Path
) -> None:
    paths = paths_of(scenario)
    assert paths is not None
    assert leaders_of(scenario) == (0,)
    for folder in (tmp_path / "one", tmp_path / "two"):
        draw_mission(flown[2], scenario, paths, leaders_of(scenario), folder)
    for name in ("mission.png", "mission.svg"):
        one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        assert one == two
        assert len(one) > 20_000


def test_a_take_off_is_no_error_of_the_height_and_one_uav_shows_its_altitude() -> None:
    """It climbs as it can, up to 2 m below its height, where the path is followed from.

    Separation has nothing to show.
    """
    base = load_scenario("runway/circuit")
    scenario = base.model_copy(update={"duration_s": 40.0, "step_us": 4000})
    recording, paths = fly_in_process(scenario), paths_of(scenario)
    assert paths is not None
    (uav,) = summarise(recording, scenario).uavs
    assert uav.path is not None
    assert uav.path.height_max_m is not None
    assert uav.path.height_max_m < 2.0
    figure = mission_figure(recording, scenario, paths, ())
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert "altitude [m]" in labels
    assert "least separation [m]" not in labels


def test_no_moment_is_drawn_when_all_stand(
    flown: tuple[Path, FlightSummary, Recording], scenario: Scenario
) -> None:
    recording, paths = flown[2], paths_of(scenario)
    assert paths is not None
    states, half = recording.states.copy(), len(recording.states) // 2
    states[half:] = states[half]
    figure = mission_figure(dataclasses.replace(recording, states=states), scenario, paths, ())
    texts = [text.get_text() for axis in figure.axes for text in axis.texts]
    times = [text for text in texts if text.endswith(" s")]
    assert 0.3 < max(float(time[:-2]) for time in times) / recording.duration_s < 0.5


def test_kml_has_path_and_home_at_their_altitudes(
    flown: tuple[Path, FlightSummary, Recording], tmp_path: Path
) -> None:
    (path,) = convert(flown[0], Format.KML, tmp_path)
    document = ET.parse(path).getroot().find("k:Document", _SPACE)
    assert document is not None
    marks = {mark.findtext("k:name", "", _SPACE): mark for mark in document}
    assert list(marks)[1:] == ["leader", "right", "left", "path of UAV 1, 2, 3", "home"]
    line = marks["path of UAV 1, 2, 3"].find("k:LineString", _SPACE)
    assert line is not None
    assert line.findtext("k:altitudeMode", "", _SPACE) == "absolute"
    places = [p.split(",") for p in line.findtext("k:coordinates", "", _SPACE).split()]
    longitude, latitude, altitude = np.array(places, float).T
    assert altitude == pytest.approx(np.full(len(places), 684.0))  # 100 m above the origin
    assert (latitude[0], longitude[0]) == pytest.approx((-35.363262, 149.165237), abs=1e-6)
    home = marks["home"].find("k:Point", _SPACE)
    assert home is not None
    assert home.findtext("k:altitudeMode", "", _SPACE) == "clampToGround"
