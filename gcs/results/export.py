"""Recordings of run folders in the formats of other programs, converted batch by batch.

NumPy's .npz, which holds whole arrays, needs memory for all of the recording.
"""

import json
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import closing
from datetime import UTC, datetime, timedelta
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias
from xml.sax.saxutils import escape

import numpy as np

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.control.signals import SIGNALS
from gcs.console.errors import BadInput
from gcs.console.extras import check_packages
from gcs.results.channels import EVENT, LOCATION, ChannelKind, encoded, nanoseconds, state_kind
from gcs.results.choices import Format
from gcs.results.columns import COLUMNS, ESTIMATES
from gcs.results.recording import Recording, event_table
from gcs.results.store import EVENTS, TRAJECTORY, batches, stream_of
from gcs.results.ulog_export import to_ulg
from mavlink_defs.config.output_files import complete_file, naming, save_arrays
from mavlink_defs.constants import ACTUATORS

if TYPE_CHECKING:
    import pyarrow as pa

    from gcs.results.logs.table import FlightTable

_Recorded: TypeAlias = "Path | pa.Buffer"
_TRACK_POINTS = 20_000  # of one UAV: what Google Earth draws without delay


def convert(run: Path, to: Format, folder: Path) -> list[Path]:
    """Convert the recording of a run folder.

    Args:
        run: Run folder with a light or full recording.
        to: The format.
        folder: For the files, exists.

    Returns:
        The files written.

    Raises:
        BadInput: There is no recording, or it has no steps.
        OSError: A file cannot be written; it is named.
    """
    with closing(_batches(run / TRAJECTORY)) as recorded:
        next(recorded)  # before a file is made
    if to is Format.NPZ:
        return _to_npz(run, folder)
    if to is Format.KML:
        return [_to_kml(run / TRAJECTORY, folder / "track.kml")]
    if to is Format.MCAP:
        return [_to_mcap(run, folder / "flight.mcap")]
    if to is Format.ULG:
        return to_ulg(run, folder)
    write = _to_csv if to is Format.CSV else _to_parquet
    return [
        write(run / name, folder / f"{Path(name).stem}.{to.value}") for name in (TRAJECTORY, EVENTS)
    ]


def convert_log(flight: "FlightTable", to: Format, folder: Path, stem: str) -> list[Path]:
    """Convert a log: a row for each step of its fastest channel, but npz has each channel as it is.

    Args:
        flight: What was read of it.
        to: The format.
        folder: For the file, exists.
        stem: Name of the file.

    Returns:
        The file written.

    Raises:
        BadInput: It cannot be had in this format.
        OSError: The file cannot be written; it is named.
    """
    from gcs.results.logs.as_recording import origin_of, recording_of

    path = folder / f"{stem}.{to.value}"
    if to in {Format.MCAP, Format.ULG}:
        text = f"--to {to} is of our own recordings, and {flight.title} is a log of others"
        raise BadInput(text, "csv, parquet, npz and kml are of all")
    if to is Format.KML and origin_of(flight) is None:
        raise BadInput(f"{flight.title} does not say where it was: it has no latitude")
    if to is Format.NPZ:
        arrays = {one.name: one.values for one in flight.channels.values()}
        times = {f"{one.name}.time_s": one.time_s for one in flight.channels.values()}
        save_arrays(path, arrays | times)
        return [path]
    write = {Format.CSV: _to_csv, Format.PARQUET: _to_parquet, Format.KML: _to_kml}[to]
    return [write(stream_of(recording_of(flight)), path)]


def save_arrays_of(recording: Recording, folder: Path) -> list[Path]:
    """Write `events.npz` and `trajectory.npz` of a whole flight; return their paths.

    Raises:
        OSError: One of them cannot be written; it is named.
    """
    trajectory = {
        "uav": np.array(recording.uav_ids),
        "time_s": recording.time_s,
        "state": recording.states,
        "wind": recording.wind,
        "applied": recording.applied,
    }
    if recording.estimates is not None:
        trajectory["estimates"] = recording.estimates
    trajectory |= {name: recording.signals[name] for name in (SIGNALS.names or ())}
    return _save(folder, event_table(recording), trajectory)


def _save(
    folder: Path, events: dict[str, np.ndarray], trajectory: dict[str, np.ndarray]
) -> list[Path]:
    paths = [folder / "events.npz", folder / "trajectory.npz"]
    for path, arrays in zip(paths, (events, trajectory), strict=True):
        save_arrays(path, arrays)
    return paths


def _to_npz(run: Path, folder: Path) -> list[Path]:
    """Write what was recorded as `save_arrays_of` does; a light recording has less of it."""
    table = _table_of(_batches(run / TRAJECTORY))
    uavs = np.unique(table["uav"])
    values = {name: column.reshape(-1, len(uavs)) for name, column in table.items()}
    trajectory = {"uav": values["uav"][0].astype(np.int64), "time_s": values["time_s"][:, 0]}
    everything = (*COLUMNS, *ESTIMATES)
    for (array, field), group in groupby(everything, lambda column: (column.array, column.field)):
        parts = [part for part in group if part.name in values]
        if parts:
            whole = np.stack([values[part.name] for part in parts], axis=-1)
            key = field or ("state" if array == "states" else array)
            trajectory[key] = whole[..., 0] if parts[0].index is None else whole
    table = _table_of(batches(run / EVENTS))
    events = {name: table[name] for name in ("step", "time_s", "value") if table}
    if table:
        channel = np.array([ACTUATORS.index(name) for name in table["actuator"]])
        events = {"uav": table["uav"].astype(np.int64), "channel": channel, **events}
    return _save(folder, events, trajectory)


def _table_of(batches: Iterable["pa.RecordBatch"]) -> dict[str, np.ndarray]:
    """Return the columns of all batches together."""
    parts = [
        {name: batch.column(name).to_numpy(zero_copy_only=False) for name in batch.schema.names}
        for batch in batches
    ]
    names = parts[0] if parts else ()
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def _to_csv(source: _Recorded, path: Path) -> Path:
    """Write a table as CSV, in the units of the recording."""
    from pyarrow import csv

    def plain(batch: "pa.RecordBatch") -> "pa.RecordBatch":
        """Return a batch without dictionaries, which CSV does not have."""
        import pyarrow as pa

        fields = [
            f.with_type(f.type.value_type) if pa.types.is_dictionary(f.type) else f
            for f in batch.schema
        ]
        return batch.cast(pa.schema(fields))

    return _written(source, path, plain, csv.CSVWriter)


def _to_parquet(source: _Recorded, path: Path) -> Path:
    """Write a table as Parquet, with the metadata of the recording."""
    from pyarrow import parquet

    def writer(file: Any, schema: "pa.Schema") -> Any:
        return parquet.ParquetWriter(file, schema, compression="zstd")

    return _written(source, path, lambda batch: batch, writer)


def _written(
    source: _Recorded,
    path: Path,
    change: Callable[["pa.RecordBatch"], "pa.RecordBatch"],
    writer_of: Callable[[Any, "pa.Schema"], Any],
) -> Path:
    with naming(path), complete_file(path) as file:
        writer = None
        for batch in map(change, _batches(source)):
            writer = writer or writer_of(file, batch.schema)
            writer.write_batch(batch)
        if writer is not None:
            writer.close()
    return path


def _batches(source: _Recorded) -> Generator["pa.RecordBatch"]:
    """Yield the batches of a recording; BadInput if it has none."""
    empty = True
    for batch in batches(source):
        empty = False
        yield batch
    if empty:
        raise BadInput(f"{source} has no rows")


class _Places:
    """Geographic places of the positions in a recording."""

    def __init__(self, schema: "pa.Schema") -> None:
        self._origin = Origin.model_validate_json(schema.metadata[b"origin"])
        names: Mapping[str, str] = json.loads(schema.metadata[b"names"])
        self.names = {int(system): name for system, name in names.items()}
        self.scenario = schema.metadata[b"scenario"].decode()
        self.paths: Mapping[str, list[tuple[float, float, float]]] = json.loads(
            schema.metadata.get(b"paths", b"{}")
        )

    def of(self, batch: "pa.RecordBatch") -> Iterator[tuple[float, float, float]]:
        """Yield latitude [deg], longitude [deg] and altitude above the sea [m] of each row."""
        columns = (batch.column(name).to_pylist() for name in ("north", "east", "down"))
        for position in zip(*columns, strict=True):
            yield self.of_one(*position)

    def of_one(self, north: float, east: float, down: float) -> tuple[float, float, float]:
        """Return the same of one position [m]."""
        place = place_of(self._origin, north, east, down)
        return place.latitude / 1e7, place.longitude / 1e7, place.altitude / 1e3


def _to_kml(source: _Recorded, path: Path) -> Path:
    """Write the tracks of all UAVs, whose time counts from 1970-01-01, and their paths and home."""
    total = sum(len(batch) for batch in _batches(source))
    tracks: dict[int, tuple[list[str], list[str]]] = {}
    places: _Places | None = None
    row = 0
    for batch in _batches(source):
        if places is None:
            places = _Places(batch.schema)
            every = -(-total // (len(places.names) * _TRACK_POINTS))
        n = len(places.names)
        rows = np.arange(row, row + len(batch))
        row += len(batch)
        chosen = batch.take(np.flatnonzero(rows // n % every == 0))
        times, systems = (chosen.column(name).to_pylist() for name in ("time_s", "uav"))
        for t, system, place in zip(times, systems, places.of(chosen), strict=True):
            latitude, longitude, altitude = place
            when = (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=t)).isoformat()
            times_of, places_of = tracks.setdefault(system, ([], []))
            times_of.append(f"<when>{when}</when>")
            places_of.append(f"<gx:coord>{longitude} {latitude} {altitude}</gx:coord>")
    assert places is not None
    marks = "\n".join(
        f"<Placemark><name>{escape(places.names[system])}</name><gx:Track>"
        "<altitudeMode>absolute</altitudeMode>\n"
        + "\n".join([*times_of, *places_of])
        + "</gx:Track></Placemark>"
        for system, (times_of, places_of) in tracks.items()
    )
    marks = "\n".join([marks, *_path_marks(places)])
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2" '
        'xmlns:gx="http://www.google.com/kml/ext/2.2">\n'
        f"<Document><name>{escape(places.scenario)}</name>\n{marks}\n</Document></kml>\n"
    )
    with complete_file(path) as file:
        file.write(text.encode())
    return path


def _path_marks(places: _Places) -> Iterator[str]:
    """Yield the path of each mission, at its altitude, and home, on the ground."""
    for uavs, corners in places.paths.items():
        coordinates = " ".join(
            f"{longitude},{latitude},{altitude}"
            for north, east, height in corners
            for latitude, longitude, altitude in [places.of_one(north, east, -height)]
        )
        yield (
            f"<Placemark><name>path of UAV {uavs}</name>"
            "<Style><LineStyle><color>ff00ffff</color><width>2</width></LineStyle></Style>"
            "<LineString><altitudeMode>absolute</altitudeMode>"
            f"<coordinates>{coordinates}</coordinates></LineString></Placemark>"
        )
    if places.paths:
        latitude, longitude, _ = places.of_one(0.0, 0.0, 0.0)
        yield (
            "<Placemark><name>home</name><Point><altitudeMode>clampToGround</altitudeMode>"
            f"<coordinates>{longitude},{latitude},0</coordinates></Point></Placemark>"
        )


def _to_mcap(run: Path, path: Path) -> Path:
    """Write MCAP with messages in JSON: state, place and events of each UAV, by simulated time.

    Topics: ``/uav1/state``, ``/uav1/location`` (foxglove.LocationFix), ``/uav1/event``.
    """
    check_packages(("mcap",), "gcs export --to mcap", "export")
    from mcap.writer import Writer

    with complete_file(path) as file:
        writer = Writer(file)
        writer.start(profile="", library="ftc-sitl")
        channels: dict[str, int] = {}
        schemas: dict[str, int] = {}

        def write(kind: ChannelKind, system: int, t: float, values: Mapping[str, Any]) -> None:
            if kind.name not in schemas:
                schemas[kind.name] = writer.register_schema(
                    kind.schema_name, "jsonschema", kind.schema
                )
            topic = kind.topic(system)
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", schemas[kind.name])
            ns = nanoseconds(t)
            writer.add_message(channels[topic], ns, encoded(values), ns)

        places: _Places | None = None
        for batch in _batches(run / TRAJECTORY):
            places = places or _Places(batch.schema)
            state = state_kind(batch.schema.names[2:])
            for values, place in zip(batch.to_pylist(), places.of(batch), strict=True):
                t, system = values.pop("time_s"), values.pop("uav")
                write(state, system, t, values)
                write(LOCATION, system, t, dict(zip(LOCATION.fields, place, strict=True)))
        counts: Counter[tuple[int, str]] = Counter()
        for batch in batches(run / EVENTS):
            for values in batch.to_pylist():
                system, actuator = values["uav"], values["actuator"]
                counts[system, actuator] += 1
                event = {"actuator": actuator, "value": values["value"]}
                event["count"] = counts[system, actuator]
                write(EVENT, system, values["time_s"], event)
        finish: Any = writer.finish  # without annotations
        finish()
    return path
