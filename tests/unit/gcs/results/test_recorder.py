"""What is kept of a flight: every bit, thinned out, or torn; and it needs little memory."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_lab.theory import check_theory
from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_process, fly_in_steps
from gcs.results.choices import Record
from gcs.results.columns import LIGHT
from gcs.results.recorder import FlightRecorder, trajectory_bytes
from gcs.results.recording import Recording, Steps, event_table
from gcs.results.store import TrajectoryStream, batches, is_complete, read_recording
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario

DURATION_S = 1.23


@pytest.fixture(scope="module")
def scenario(scenario1: Scenario) -> Scenario:
    return scenario1.model_copy(update={"duration_s": DURATION_S})


@pytest.fixture(scope="module")
def flight(scenario: Scenario) -> Recording:
    return fly_in_process(scenario)


def recorded(scenario: Scenario, folder: Path, record: Record) -> Path:
    recorder = FlightRecorder(scenario, folder, record)
    recorder.finish(fly_in_steps(scenario, recorder.add))
    return folder


def figures_of(folder: Path) -> dict[str, object]:
    summary: dict[str, object] = json.loads((folder / "summary.json").read_text())
    return {name: summary[name] for name in summary if name not in {"wall_s", "real_time_factor"}}


@pytest.mark.parametrize("record", Record)
def test_the_figures_cover_every_step(
    scenario: Scenario, flight: Recording, tmp_path: Path, record: Record
) -> None:
    recorded(scenario, tmp_path, record)
    expected = summarise(flight, scenario).to_json()
    for name, value in figures_of(tmp_path).items():
        assert json.dumps(value) == json.dumps(expected[name]), name
    files = {path.name for path in tmp_path.iterdir()} - {"summary.json"}
    streams = {"events.arrows", "trajectory.arrows"}
    arrays = {"events.npz", "trajectory.npz"}
    assert files == {"none": set(), "npz": arrays}.get(record, streams)
    trajectory = tmp_path / "trajectory.arrows"
    size = trajectory.stat().st_size if trajectory.exists() else 0
    assert size < trajectory_bytes(scenario, record) + 50_000  # of names and types


def test_a_full_recording_has_every_bit(
    scenario: Scenario, flight: Recording, tmp_path: Path
) -> None:
    again = read_recording(recorded(scenario, tmp_path, Record.FULL))
    for one, other in zip(flight.steps[1:], again.steps[1:], strict=True):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.tobytes() == other.tobytes()
    assert again.step_us == flight.step_us
    assert summarise(again, scenario).uavs == summarise(flight, scenario).uavs
    assert check_theory(again, scenario).uavs == check_theory(flight, scenario).uavs


def test_a_light_recording_has_some_steps_and_every_event(
    scenario: Scenario, flight: Recording, tmp_path: Path
) -> None:
    recorded(scenario, tmp_path, Record.LIGHT)
    table = pa.ipc.open_stream((tmp_path / "trajectory.arrows").read_bytes()).read_all()
    assert table.column_names == ["time_s", "uav", *(column.name for column in LIGHT)]
    kept = Steps(0, *(array[::20] for array in flight.steps[1:]))
    assert np.array_equal(table["time_s"], np.repeat(flight.time_s[::20], 3))
    assert np.array_equal(table["uav"], np.tile([1, 2, 3], kept.length))
    for column in LIGHT:
        values = column.of(kept).ravel()
        assert np.array_equal(table[column.name], values, equal_nan=True), column.name
    events = pa.ipc.open_stream((tmp_path / "events.arrows").read_bytes()).read_all()
    expected = event_table(flight)
    for name in ("time_s", "step", "uav", "value"):
        assert np.array_equal(events[name], expected[name]), name
    names = np.array(["aileron", "elevator", "rudder", "throttle"])[expected["channel"]]
    assert events["actuator"].to_pylist() == names.tolist()
    with pytest.raises(BadInput, match="no full recording"):
        read_recording(tmp_path)


@pytest.fixture(scope="module")
def events(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = recorded(scenario, tmp_path_factory.mktemp("light"), Record.LIGHT)
    return folder / "events.arrows"


@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_torn_recording_is_read_up_to_its_tear(
    events: Path, share: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    stream = events.read_bytes()
    path = tmp_path_factory.mktemp("torn") / "events.arrows"
    path.write_bytes(stream[: int(share * len(stream))])
    whole = pa.ipc.open_stream(stream).read_all()
    assert not is_complete(path)
    names = 8 + int.from_bytes(stream[4:8], "little")  # up to the end of the schema
    if int(share * len(stream)) < names:
        with pytest.raises(BadInput, match="is no recording"):
            list(batches(path))
        return
    found = list(batches(str(path)))  # as one types it at a prompt
    table = pa.Table.from_batches(found, whole.schema)
    assert len(table) <= len(whole)
    assert table.equals(whole.slice(0, len(table)))


def test_a_full_recording_that_is_torn_is_not_taken_for_one(
    scenario: Scenario, tmp_path: Path
) -> None:
    recorded(scenario, tmp_path, Record.FULL)
    path = tmp_path / "trajectory.arrows"
    path.write_bytes(path.read_bytes()[:-100_000])
    with pytest.raises(BadInput, match=r"ends after \d+ of 1230 steps"):
        read_recording(tmp_path)
    path.unlink()
    with pytest.raises(BadInput, match=r"cannot read .*trajectory.arrows: No such file"):
        read_recording(tmp_path)


@pytest.mark.parametrize("record", [Record.FULL, Record.LIGHT, Record.NONE])
def test_memory_does_not_grow_with_the_flight(
    flight: Recording, scenario: Scenario, tmp_path: Path, record: Record
) -> None:
    long = scenario.model_copy(update={"duration_s": 200.0})
    recorder = FlightRecorder(long, tmp_path, record)
    part = flight.steps.part(0, 1000)

    def fly(begin: int, end: int) -> int:
        for k in range(begin, end):
            recorder.add(part._replace(first=1000 * k))
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        early = fly(0, 40)
        assert fly(40, 200) - early < 8e6  # 1 GB of steps; intervals for the figure are kept
    finally:
        tracemalloc.stop()
        recorder.close()


def test_a_stream_takes_steps_that_come_in_any_portions(flight: Recording, tmp_path: Path) -> None:
    tables = []
    for cut in (1, 7, 500):
        path = tmp_path / f"{cut}.arrows"
        stream = TrajectoryStream(path, LIGHT, 3, (1, 2, 3), 1000, compressed=True)
        for begin in range(0, 1230, cut):
            stream.add(flight.steps.part(begin, begin + cut))
        stream.close()
        assert is_complete(path)
        tables.append(pa.ipc.open_stream(path.read_bytes()).read_all())
    for table in tables[1:]:
        assert table.schema == tables[0].schema
        for name in table.column_names:
            assert np.array_equal(table[name], tables[0][name], equal_nan=True), name
    assert len(tables[0]) == 410 * 3
