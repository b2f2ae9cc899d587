"""Logs of ArduPilot (DataFlash, `.bin`).

pymavlink finds the messages and their formats; their fields are read by NumPy, all of one kind at
a time. Messages and units are as in ArduPilot 4.6, https://ardupilot.org/plane/docs/logmessages.html.
"""

import contextlib
import io
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.console.extras import TOOLS_PACKAGES, check_packages
from gcs.results.logs import names
from gcs.results.logs.clocks import longest_span, utc
from gcs.results.logs.fields import (
    Fields,
    Values,
    between,
    channels_of,
    numbered,
    rows,
    vector,
    with_course,
)
from gcs.results.logs.reading import reading
from gcs.results.logs.table import FlightTable, LogChannel, LogText, by_name
from mavlink_defs.config.user_files import open_file
from mavlink_defs.visible import visible

_HEADER = 3  # bytes of a message before its fields
_INFO, _ERROR = 6, 3
_GPS_EPOCH_S = datetime(1980, 1, 6, tzinfo=UTC).timestamp()
_WEEK_S = 604_800.0
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
_TEXTS = ("Name", "Message")
_TRAVELS = ("Ail", "Elev", "Rudd")


def read_dataflash(path: Path) -> FlightTable:
    """Read a log of ArduPilot.

    Raises:
        BadInput: It cannot be read, is none, or has nothing of a flight.
    """
    messages, remarks = _Messages.of(path)
    kinds = {**_FIELDS, **{older: _FIELDS[name] for older, name in _OLDER.items()}}
    logged = {name: messages.values(name) for name in (*kinds, "MSG", "MODE", "ERR")}
    flown = {name: logged[name] for name in kinds if "time_s" in logged[name]}
    begin, end, jumps = longest_span(values["time_s"] for values in flown.values())
    channels = by_name(
        one
        for name, values in flown.items()
        for one in _channels(name, kinds[name], between(values, begin, end, begin))
    )
    if not channels:
        raise BadInput(f"{path} has no message of a flight, such as ATT, IMU or GPS")
    whole = (begin, end) if jumps else (-np.inf, np.inf)  # what was set before the flight, too
    beside = {name: between(logged[name], *whole, begin) for name in ("MSG", "MODE", "ERR", "GPS")}
    texts = [*_texts(beside["MSG"]), *_errors(beside["ERR"])]
    return FlightTable(
        title=visible(path.name),
        kind="bin",
        channels=channels,
        modes=tuple(_modes(beside["MODE"], texts)),
        texts=tuple(sorted(texts, key=lambda one: one.time_s)),
        parameters={
            name.decode("utf-8", "replace"): value
            for name, value in rows(messages.values("PARM"), "Name", "Value")
        },
        started=_started(beside["GPS"]),
        remarks=(*remarks, *jumps),
    )


def _channels(name: str, fields: Fields, values: Values) -> Iterator[LogChannel | None]:
    chosen = np.ones(len(values["time_s"]), bool)
    for field in _INSTANCES:
        if field in values and len(chosen):
            chosen &= values[field] == values[field].min()
            break
    if name == "GPS":
        values = with_course(values, "Spd", "GCrs")
        chosen &= values.get("Status", np.full(len(chosen), 3)) >= 2
    if name == "AETR":  # 4500 is the whole travel, of the throttle 100
        values = {
            one: column / (45.0 if one in _TRAVELS else 1.0) for one, column in values.items()
        }
    if name.startswith("RCO"):
        pulses = {one: column for one, column in values.items() if one.startswith("C")}
        values = {**values, **{one: np.where(p > 0.0, p, np.nan) for one, p in pulses.items()}}
    values = {one: column[chosen] for one, column in values.items()}
    yield from channels_of(name, fields, values["time_s"], values, "boot")


def _texts(values: Values) -> Iterator[LogText]:
    for at, text in rows(values, "time_s", "Message"):
        yield LogText(at, _INFO, visible(text.decode("utf-8", "replace")))


def _errors(values: Values) -> Iterator[LogText]:
    for at, subsystem, code in rows(values, "time_s", "Subsys", "ECode"):
        yield LogText(at, _ERROR, f"error {code:.0f} of subsystem {subsystem:.0f}")


def _modes(values: Values, texts: list[LogText]) -> Iterator[tuple[float, str]]:
    from pymavlink.mavutil import mode_mapping_bynumber

    said = " ".join(one.text for one in texts)
    kind = next((number for name, number in _KINDS.items() if name in said), _KINDS["ArduPlane"])
    known = mode_mapping_bynumber(kind) or {}
    for at, number in rows(values, "time_s", "ModeNum" if "ModeNum" in values else "Mode"):
        yield at, known.get(number, f"mode {number:.0f}")


def _started(gps: Values) -> datetime | None:
    """Return when the flight's time was 0, by the first message with GPS time."""
    for at, week, ms in rows(gps, "time_s", "GWk", "GMS"):
        if week > 0:
            return utc(_GPS_EPOCH_S + _WEEK_S * week + ms / 1e3 - _LEAP_S - at)
    return None


class _Messages:
    """The messages of a log by their kind."""

    def __init__(self, reader: Any, data: np.ndarray) -> None:
        self._data = data
        self._formats = {one.name: one for one in reader.formats.values()}
        self._offsets = reader.offsets

    @classmethod
    def of(cls, path: Path) -> "tuple[_Messages, list[str]]":
        """Open a log; return it with remarks."""
        with reading(path), open_file(path) as file:
            head = file.read(2)
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
        broken = reading(path, "is a broken log of ArduPilot")
        with broken, contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            reader = Indexed(str(path))
        bad = said.getvalue().count("bad header")
        remarks = [f"{bad} bytes between its messages are none"] if bad else []
        reader.close()
        return cls(reader, np.fromfile(path, np.uint8)), remarks

    def values(self, name: str) -> Values:
        """Return the fields of all messages of a kind, in the units of the log.

        `time_s` is their time [s], if they have one; texts are bytes.
        """
        found: dict[str, np.ndarray] = {}
        stored, of = self._rows(name)
        for column, scale in zip(of.columns, of.msg_mults, strict=False) if of else ():
            kind = stored.dtype[column].kind
            if column in _TEXTS and kind == "S":
                found[column] = stored[column]
            elif column not in _TEXTS and kind in "iuf":
                found[column] = stored[column] * (scale or 1.0)
        for field, unit_s in (("TimeUS", 1e-6), ("TimeMS", 1e-3)):
            if field in found:
                return {**found, "time_s": found[field] * unit_s}
        return found

    def _rows(self, name: str) -> tuple[np.ndarray, Any]:
        of = self._formats.get(name)
        if of is None:
            return np.empty(0), None
        types = list(zip(of.columns, map(_numpy_type, of.format), strict=False))
        if len({name for name, _ in types if name}) < len(types):  # of a damaged format
            return np.empty(0), None
        dtype = np.dtype(types)
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
