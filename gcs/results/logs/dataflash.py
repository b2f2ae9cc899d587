"""Logs of ArduPilot (DataFlash, `.bin`).

pymavlink finds the messages and their formats; their fields are read by NumPy, all of one kind at
a time. Messages and units are as in ArduPilot 4.6, https://ardupilot.org/plane/docs/logmessages.html.
"""

import contextlib
import io
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.console.extras import TOOLS_PACKAGES, check_packages
from gcs.results.logs import names
from gcs.results.logs.clocks import longest_stretch
from gcs.results.logs.fields import Fields, Values, channels_of, numbered, vector, with_course
from gcs.results.logs.table import FlightTable, LogChannel, LogText, by_name
from mavlink_defs.config.user_files import open_file
from mavlink_defs.visible import visible

_HEADER = 3  # bytes of a message before its fields
_INFO, _ERROR = 6, 3
_GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
_LEAP_S = 18  # of GPS time before UTC, since 2017
_KINDS = {"ArduPlane": 1, "ArduCopter": 2, "ArduRover": 10, "ArduSub": 12}  # MAV_TYPE

_FIELDS: dict[str, Fields] = {
    "ATT": {
        **vector(names.ATTITUDE, "Roll Pitch Yaw", "deg"),
        **vector(names.REFERENCE, "DesRoll DesPitch DesYaw", "deg"),
    },
    "IMU": {
        **vector(names.RATES, "GyrX GyrY GyrZ", "rad/s"),
        **vector(names.FORCE, "AccX AccY AccZ", "m/s²"),
    },
    "RATE": vector(names.REFERENCE_RATES, "RDes PDes YDes", "deg/s"),
    "TECS": {"V": ("sp", "m/s"), "reference_airspeed": ("spdem", "m/s")},
    "ARSP": {
        "indicated_airspeed": ("Airspeed", "m/s"),
        "dynamic_pressure": ("DiffPress", "Pa"),
    },
    "BARO": {"baro_height": ("Alt", "m"), "static_pressure": ("Press", "Pa")},
    "MAG": vector(names.MAGNETIC, "MagX MagY MagZ", "mgauss"),
    "GPS": {
        **vector(names.GNSS_PLACE[:2], "Lat Lng", "deg"),
        **vector(names.GNSS_PLACE[2:], "Alt", "m"),
        **vector(names.GNSS_VELOCITY, "north east VZ", "m/s"),
    },
    "POS": {
        **vector(names.PLACE[:2], "Lat Lng", "deg"),
        **vector(names.PLACE[2:], "Alt", "m"),
    },
    "XKF1": {
        **vector(names.POSITION, "PN PE PD", "m"),
        **vector(names.VELOCITY, "VN VE VD", "m/s"),
    },
    "XKF2": vector(("wind_north", "wind_east"), "VWN VWE", "m/s"),
    "AETR": vector(names.SHARES, "Ail Elev Rudd Thr", "%"),
    "RCOU": numbered(names.OUTPUTS[:14], "C{}", "µs"),
    "RCO2": {f"output_{k}": (f"C{k}", "µs") for k in range(15, 19)},
    "RCO3": {f"output_{k}": (f"C{k}", "µs") for k in range(19, 33)},
    "ESC": {"motor_speed": ("RPM", "rpm")},
    "BAT": {"battery_voltage": ("Volt", "V"), "battery_current": ("Curr", "A")},
}
_OLDER = {"NKF1": "XKF1", "NKF2": "XKF2", "CURR": "BAT"}
"""Messages before, of the same fields."""
_INSTANCES = ("I", "C", "Inst", "Instance")
"""Fields that say which of several sensors or cores a message is of; the first one is read."""


def read_dataflash(path: Path) -> FlightTable:
    """Read a log of ArduPilot.

    Raises:
        BadInput: It cannot be read, is none, or has nothing of a flight.
    """
    messages, remarks = _Messages.of(path)
    time_s = {name: messages.time_s(name) for name in (*_FIELDS, *_OLDER, "MSG", "MODE", "ERR")}
    span = _span(path, time_s, remarks)
    channels = by_name(
        one
        for name, fields in (*_FIELDS.items(), *((a, _FIELDS[b]) for a, b in _OLDER.items()))
        if len(time_s[name])
        for one in _channels(name, fields, time_s[name], messages.values(name), span)
    )
    if not channels:
        raise BadInput(f"{path} has no message of a flight, such as ATT, IMU or GPS")
    parameters = messages.strings("PARM", "Name"), messages.values("PARM").get("Value", ())
    texts = [
        *_texts(time_s["MSG"] - span[0], messages.strings("MSG", "Message")),
        *_errors(time_s["ERR"] - span[0], messages.values("ERR")),
    ]
    return FlightTable(
        title=visible(path.name),
        kind="bin",
        channels=channels,
        modes=_modes(time_s["MODE"] - span[0], messages.values("MODE"), texts),
        texts=tuple(sorted(texts, key=lambda one: one.time_s)),
        parameters={name: float(value) for name, value in zip(*parameters, strict=True)},
        started=_started(time_s["GPS"] - span[0], messages.values("GPS")),
        remarks=tuple(remarks),
    )


def _channels(
    name: str, fields: Fields, time_s: np.ndarray, values: Values, span: tuple[float, float]
) -> Iterator[LogChannel | None]:
    rows = (time_s >= span[0]) & (time_s <= span[1])
    for field in _INSTANCES:
        if field in values:
            rows &= values[field] == values[field].min()
            break
    if name == "GPS":
        values = with_course(values, "Spd", "GCrs")
        rows &= values.get("Status", np.full(len(rows), 3)) >= 2
    if name == "AETR":  # 4500 is the whole travel, of the throttle 100
        values = {one: column / (1.0 if one == "Thr" else 45.0) for one, column in values.items()}
    if name.startswith("RCO"):
        values = {one: np.where(column > 0.0, column, np.nan) for one, column in values.items()}
    values = {one: column[rows] for one, column in values.items()}
    yield from channels_of(name, fields, time_s[rows] - span[0], values, "boot")


def _span(path: Path, time_s: dict[str, np.ndarray], remarks: list[str]) -> tuple[float, float]:
    """Return begin and end of what is read: the longest time without a jump of the clock [s]."""
    fastest = max((times for name, times in time_s.items() if name in _FIELDS), key=len)
    if not len(fastest):
        raise BadInput(f"{path} has no message of a flight, such as ATT, IMU or GPS")
    stretch, jump = longest_stretch(fastest)
    remarks += [jump] if jump else []
    return float(fastest[stretch].min()), float(fastest[stretch].max()) + 1.0


def _texts(time_s: np.ndarray, texts: list[str]) -> Iterator[LogText]:
    for at, text in zip(time_s.tolist(), texts, strict=True):
        yield LogText(at, _INFO, visible(text))


def _errors(time_s: np.ndarray, values: Values) -> Iterator[LogText]:
    columns = (values.get(name, ()) for name in ("Subsys", "ECode"))
    for at, subsystem, code in zip(time_s.tolist(), *columns, strict=True):
        yield LogText(at, _ERROR, f"error {code:.0f} of subsystem {subsystem:.0f}")


def _modes(
    time_s: np.ndarray, values: Values, texts: list[LogText]
) -> tuple[tuple[float, str], ...]:
    from pymavlink.mavutil import mode_mapping_bynumber

    said = " ".join(one.text for one in texts)
    kind = next((number for name, number in _KINDS.items() if name in said), _KINDS["ArduPlane"])
    known = mode_mapping_bynumber(kind) or {}
    numbers = values.get("ModeNum", values.get("Mode", np.empty(0)))
    return tuple(
        (at, known.get(int(number), f"mode {number:.0f}"))
        for at, number in zip(time_s.tolist(), numbers, strict=True)
    )


def _started(time_s: np.ndarray, gps: Values) -> datetime | None:
    """Return when the flight's time was 0, by the first message with GPS time."""
    week, ms = gps.get("GWk", np.empty(0)), gps.get("GMS", np.empty(0))
    known = np.flatnonzero(week > 0)
    if not len(known) or len(time_s) != len(ms):
        return None
    first = known[0]
    return _GPS_EPOCH + timedelta(
        weeks=float(week[first]),
        milliseconds=float(ms[first]),
        seconds=-_LEAP_S - float(time_s[first]),
    )


class _Messages:
    """The messages of a log by their kind."""

    def __init__(self, reader: Any, data: np.ndarray) -> None:
        self._data = data
        self._formats = {one.name: one for one in reader.formats.values()}
        self._offsets = reader.offsets

    @classmethod
    def of(cls, path: Path) -> "tuple[_Messages, list[str]]":
        """Open a log; return it with remarks."""
        try:
            with open_file(path) as file:
                head = file.read(2)
        except OSError as problem:
            raise BadInput(f"cannot read {path}: {problem.strerror}") from None
        if head != b"\xa3\x95":
            what = "is empty" if not head else "is no log of ArduPilot: it does not begin as one"
            raise BadInput(f"{path} {what}", "logs are downloaded as .bin, of telemetry as .tlog")
        check_packages(TOOLS_PACKAGES, f"{path.name}, a log of ArduPilot,", "tools")
        from pymavlink.DFReader import DFReader_binary

        class Indexed(DFReader_binary):  # type: ignore[misc]  # it has no types
            init_arrays_fast = DFReader_binary.init_arrays  # compiled, its complaints go anywhere

            def init_clock(self) -> None:
                """Leave it: it would read every message, one by one."""

        said = io.StringIO()
        try:
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                reader = Indexed(str(path))
        except Exception as problem:  # of formats that are broken: struct.error, KeyError, ...
            text = f"{path} is a broken log of ArduPilot: {type(problem).__name__}: {problem}"
            raise BadInput(text) from None
        bad = said.getvalue().count("bad header")
        remarks = [f"{bad} bytes between its messages are none"] if bad else []
        reader.close()
        return cls(reader, np.fromfile(path, np.uint8)), remarks

    def time_s(self, name: str) -> np.ndarray:
        """Return the times of all messages of a kind [s], shape (n,)."""
        values = self.values(name)
        if "TimeUS" in values:
            return np.asarray(values["TimeUS"] / 1e6)
        return np.asarray(values.get("TimeMS", np.empty(0)) / 1e3)

    def values(self, name: str) -> Values:
        """Return the fields of numbers of all messages of a kind, in the units of the log."""
        rows, of = self._rows(name)
        found = {}
        for column, scale in zip(of.columns, of.msg_mults, strict=False) if of else ():
            if rows.dtype[column].kind in "iuf":
                found[column] = rows[column] * (scale or 1.0)
        return found

    def strings(self, name: str, column: str) -> list[str]:
        """Return a field of text of all messages of a kind."""
        rows, of = self._rows(name)
        if of is None or column not in of.columns:
            return []
        return [one.decode("utf-8", "replace") for one in rows[column].tolist()]

    def _rows(self, name: str) -> tuple[np.ndarray, Any]:
        of = self._formats.get(name)
        if of is None:
            return np.empty(0), None
        dtype = np.dtype(list(zip(of.columns, map(_numpy_type, of.format), strict=False)))
        at = np.asarray(self._offsets[of.type], np.int64)
        at = at[at + of.len <= len(self._data)]
        if dtype.itemsize != of.len - _HEADER or not len(at):
            return np.empty(0, dtype), of
        content = self._data[at[:, None] + np.arange(_HEADER, of.len)]
        return content.view(dtype)[:, 0], of


def _numpy_type(code: str) -> str:
    """Return the type of a field by its letter in a format."""
    from pymavlink.DFReader import FORMAT_TO_STRUCT

    packed: str = FORMAT_TO_STRUCT[code][0]
    return f"S{packed[:-1]}" if packed.endswith("s") else f"<{packed}"
