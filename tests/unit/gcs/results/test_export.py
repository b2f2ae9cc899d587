"""Exported flights, read back by the libraries of other programs, are the recording."""

import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from mcap.reader import make_reader
from pyarrow import csv, parquet

from gcs.commands.export import export
from gcs.console import extras
from gcs.console.errors import BadInput, FlightLost
from gcs.fleet.in_process import fly_in_steps
from gcs.results.choices import Format, Record
from gcs.results.export import convert
from gcs.results.recorder import FlightRecorder
from gcs.scenario.model import Scenario


@pytest.fixture(scope="module")
def run(scenario1: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    scenario = scenario1.model_copy(update={"duration_s": 1.0, "name": "<turn> & climb"})
    recorder = FlightRecorder(scenario, folder, Record.LIGHT)
    recorder.finish(fly_in_steps(scenario, recorder.add))
    return folder


def table_of(run: Path, name: str) -> pa.Table:
    return pa.ipc.open_stream((run / f"{name}.arrows").read_bytes()).read_all()


def rows_of(table: pa.Table) -> list[dict[str, object]]:
    """The rows, with None for NaN, which equals nothing."""
    return [
        {
            name: None if isinstance(value, float) and math.isnan(value) else value
            for name, value in row.items()
        }
        for row in table.to_pylist()
    ]


def test_parquet_and_csv_have_every_row(run: Path, tmp_path: Path) -> None:
    convert(run, Format.PARQUET, tmp_path)
    convert(run, Format.CSV, tmp_path)
    for name in ("trajectory", "events"):
        expected = table_of(run, name)
        assert rows_of(parquet.read_table(tmp_path / f"{name}.parquet")) == rows_of(expected)
        plain = csv.read_csv(tmp_path / f"{name}.csv")
        assert plain.column_names == expected.column_names
        for column in expected.column_names:
            pairs = rows_of(plain.select([column])), rows_of(expected.select([column]))
            assert pairs[0] == pairs[1], column


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as arrays:
        return dict(arrays)


def test_npz_of_a_full_recording_equals_record_npz(scenario1: Scenario, tmp_path: Path) -> None:
    """The same keys, types and bits as a whole flight in memory gives."""
    scenario = scenario1.model_copy(update={"duration_s": 0.2})
    folders = {record: tmp_path / record.value for record in (Record.FULL, Record.NPZ)}
    for record, folder in folders.items():
        folder.mkdir()
        recorder = FlightRecorder(scenario, folder, record)
        recorder.finish(fly_in_steps(scenario, recorder.add))
    for path in convert(folders[Record.FULL], Format.NPZ, tmp_path):
        found, expected = arrays_of(path), arrays_of(folders[Record.NPZ] / path.name)
        assert list(found) == list(expected)
        for name, array in expected.items():
            assert found[name].dtype == array.dtype, name
            assert np.array_equal(found[name], array, equal_nan=array.dtype.kind == "f"), name


def test_npz_of_a_light_recording_has_what_was_recorded(run: Path, tmp_path: Path) -> None:
    _, path = convert(run, Format.NPZ, tmp_path)
    arrays, table = arrays_of(path), table_of(run, "trajectory")
    assert set(arrays) == {
        *("uav", "time_s", "state", "wind", "applied"),
        *("V", "command", "reference", "error", "held", "path_position", "slot"),
    }
    assert arrays["error"].shape == (50, 3, 4)
    own = table.filter(pc.equal(table["uav"], 2))
    assert np.array_equal(arrays["error"][:, 1, 3], own["error_yaw"].to_numpy())
    assert np.array_equal(arrays["time_s"], own["time_s"].to_numpy())


def test_kml_has_the_tracks(run: Path, tmp_path: Path) -> None:
    (path,) = convert(run, Format.KML, tmp_path)
    space = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
    document = ET.parse(path).getroot().find("k:Document", space)
    assert document is not None
    assert document.findtext("k:name", None, space) == "<turn> & climb"
    table = table_of(run, "trajectory")
    tracks = document.findall("k:Placemark", space)
    assert len(tracks) == 3
    for system, mark in enumerate(tracks, start=1):
        own = table.filter(pc.equal(table["uav"], system))
        places = [e.text or "" for e in mark.findall("gx:Track/gx:coord", space)]
        assert len(places) == len(mark.findall("gx:Track/k:when", space)) == len(own)
        longitude, latitude, altitude = np.array([p.split() for p in places], float).T
        assert altitude == pytest.approx(584.0 - own["down"].to_numpy(), abs=1e-3)
        north = np.radians(latitude + 35.363262) * 6378137.0
        assert north == pytest.approx(own["north"].to_numpy(), abs=0.02)
        assert np.ptp(longitude) < 1e-3


def test_what_mcap_lacks_is_said(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extras, "missing", lambda packages: [*packages])
    with pytest.raises(BadInput, match=r"^gcs export --to mcap needs mcap, not installed here$"):
        convert(run, Format.MCAP, tmp_path)
    assert not list(tmp_path.iterdir())


def test_mcap_has_states_places_and_events(run: Path, tmp_path: Path) -> None:
    (path,) = convert(run, Format.MCAP, tmp_path)
    found: dict[str, list[tuple[int, dict[str, object]]]] = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
    trajectory, events = table_of(run, "trajectory"), table_of(run, "events")
    assert set(found) == {f"/uav{i}/{kind}" for i in (1, 2, 3) for kind in KINDS}
    for system in (1, 2, 3):
        own = trajectory.filter(pc.equal(trajectory["uav"], system)).drop(["uav"])
        states = found[f"/uav{system}/state"]
        assert [{"time_s": t / 1e9, **values} for t, values in states] == rows_of(own)
        assert len(found[f"/uav{system}/location"]) == len(states)
        count = len(events.filter(pc.equal(events["uav"], system)))
        assert len(found[f"/uav{system}/event"]) == count > 10


KINDS = ("state", "location", "event")


def test_a_torn_recording_is_exported_and_reported(run: Path, tmp_path: Path) -> None:
    for name in ("trajectory.arrows", "events.arrows"):
        (tmp_path / name).write_bytes((run / name).read_bytes())
    torn = tmp_path / "events.arrows"
    torn.write_bytes(torn.read_bytes()[:-8])
    with pytest.raises(FlightLost, match=r"^events.arrows of .* is torn"):
        export(tmp_path, Format.PARQUET)
    assert (tmp_path / "events.parquet").exists()


def test_a_run_without_a_recording_is_refused(tmp_path: Path) -> None:
    for to in Format:
        with pytest.raises(BadInput, match=r"cannot read .*trajectory.arrows: No such file"):
            convert(tmp_path, to, tmp_path)
        assert not list(tmp_path.iterdir()), "nothing is left of a failed export"


@pytest.mark.parametrize("to", Format)
@pytest.mark.parametrize("is_file", [True, False])
def test_what_is_no_run_folder_is_refused(to: Format, is_file: bool, tmp_path: Path) -> None:
    thing = tmp_path / "thing"
    if is_file:
        thing.write_text("x")
    with pytest.raises(BadInput, match=r"cannot read .*thing/trajectory.arrows: N"):
        export(thing, to)
    assert thing.exists() == is_file
