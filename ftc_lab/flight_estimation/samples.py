"""What the sensors of a recorded flight reported, in the messages that an autopilot takes."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ftc_lab.flight_signals import FlightSignals, MissingError
from gcs.console.errors import BadInput
from gcs.results.logs import names
from gcs.results.logs.as_recording import origin_of
from gcs.results.logs.table import FlightTable, LogChannel
from mavlink_defs.constants import ACCELEROMETER, BAROMETER, GYRO, MAGNETOMETER, PITOT
from mavlink_defs.framing.codec import HIL_GPS, HIL_SENSOR
from mavlink_defs.origin import Origin
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.sensing.geomagnetism import magnetic_field
from sitl_plant.sensing.standard_air import pressure_at
from sitl_plant.sensing.units import UPDATED

Compass = Literal["calibrated", "raw", "none"]

_MOST_HZ, _LEAST_HZ = 100.0, 10.0  # of steps; a control period is 0.1 s at most
_SEA_LEVEL_KG_M3 = 1.225  # by which indicated airspeeds are pressures
_HPA = 0.01  # of one Pa
_OF_THIRD = 0.6745 * math.sqrt(20.0)  # median size of third differences, by the noise's
_LEAST_NOISE = 1e-4
_FIX_3D = 3
_FIRST_US = 10_000_000  # time of the first step: a fix may be of before
_LEAST_S = 10.0  # of flight

_REAL: dict[str, dict[str, float]] = {
    "gyro": {"turn_on_bias_deg_s": 0.5},
    "accelerometer": {"turn_on_bias_m_s2": 0.3},
    "magnetometer": {"hard_iron_gauss": 0.02, "misalignment_deg": 3.0, "noise_gauss": 0.005},
    "barometer": {
        "noise_pa": 25.0,
        "bias_instability_pa": 60.0,
        "turn_on_bias_pa": 100.0,
        "correlation_s": 60.0,
    },
    "pitot": {"noise_pa": 6.0, "turn_on_bias_pa": 5.0, "scale_error": 0.03},
    "gnss": {
        "horizontal_velocity_noise_m_s": 0.25,
        "vertical_velocity_noise_m_s": 0.4,
        "horizontal_error_m": 2.5,
        "vertical_error_m": 4.0,
        "horizontal_noise_m": 0.5,
        "vertical_noise_m": 1.0,
    },
}
"""What the filter assumes of sensors in a small aircraft: static ports in its wake, a receiver
without corrections, an IMU that shakes. Barometer and pitot tube are as noisy as in the flight of
`docs/how-to/estimate-from-a-log.md`."""


@dataclass(frozen=True)
class RecordedSamples:
    """What the sensors reported in n steps; steps without an IMU's sample are not among them.

    Attributes:
        time_s: Of each step, by the log, shape (n,).
        number: Of each step, shape (n,).
        step_us: Between two of them.
        imus: HIL_SENSOR, shape (n,).
        gps: HIL_GPS, shape (n,), of the last fix.
        has_fix: Whether a fix came in a step, shape (n,).
        sensors: As the filter is to assume them.
        origin: Place of the first fix.
        remarks: What was taken for what, and what is missing.
    """

    time_s: np.ndarray
    number: np.ndarray
    step_us: int
    imus: np.ndarray
    gps: np.ndarray
    has_fix: np.ndarray
    sensors: NavigationSensors
    origin: Origin
    remarks: tuple[str, ...]

    @property
    def time_us(self) -> np.ndarray:
        """Time of each step as messages have it, shape (n,)."""
        return _FIRST_US + self.number * self.step_us


def samples_of(
    flight: FlightTable,
    span_s: tuple[float, float],
    latency_s: float,
    compass: Compass,
    own: NavigationSensors | None = None,
) -> RecordedSamples:
    """Return what sensors reported of a flight.

    Args:
        flight: The log.
        span_s: From when to when [s].
        latency_s: How old a fix of the receiver is when the log has it, 0 to 1.
        compass: How the magnetometer's readings are taken.
        own: What the filter is to assume of the sensors; None: what it should of real ones, and
            of the IMU the noise that the log shows.

    Raises:
        BadInput: There is no IMU or no receiver in the log, or it is too slow.
    """
    needed = [*names.RATES, *names.FORCE, *names.GNSS_PLACE, *names.GNSS_VELOCITY[:2]]
    if missing := [name for name in needed if name not in flight]:
        text = f"{flight.title} has no {', '.join(missing)}: an estimate needs the IMU and GNSS"
        raise BadInput(text, "`gcs log FILE --list` shows what it has, a column map adds channels")
    rate = min(flight[name].rate_hz for name in (*names.RATES, *names.FORCE))
    if rate < _LEAST_HZ:
        text = f"p, q, r and specific_force of {flight.title} come {rate:.2g} times a second"
        raise BadInput(text, f"expected {_LEAST_HZ:g} or more, for an estimate by the IMU")
    step_us = round(1e6 / min(rate, _MOST_HZ))
    ends = np.arange(span_s[0], span_s[1], step_us / 1e6)
    motion = np.stack([_means(flight[name], ends) for name in needed[:6]], axis=1)
    known = np.isfinite(motion).all(axis=1)
    if np.count_nonzero(known) * step_us < _LEAST_S * 1e6:
        raise BadInput(f"{flight.title} has less than {_LEAST_S:g} s of flight with an IMU")
    origin, remarks = origin_of(flight), list[str]()
    assert origin is not None
    time_s, number = ends[1:][known], np.flatnonzero(known)
    imus = np.zeros(len(time_s), HIL_SENSOR)
    imus["time_usec"] = _FIRST_US + number * step_us
    imus["fields_updated"] = UPDATED[GYRO] | UPDATED[ACCELEROMETER]
    for name, values in zip(
        ["xgyro", "ygyro", "zgyro", "xacc", "yacc", "zacc"], motion[known].T, strict=True
    ):
        imus[name] = values
    sensors = _assumed(motion[known], step_us) if own is None else own.model_dump()
    _write_air(flight, imus, time_s, sensors, remarks)
    _write_compass(flight, imus, time_s, compass, origin, sensors, remarks)
    gps, has_fix = _fixes(
        flight, time_s, imus["time_usec"].astype(float), latency_s, sensors, remarks
    )
    sensors["gnss"]["latency_s"] = latency_s
    assumed = NavigationSensors.model_validate(sensors | {"imus": 1})
    return RecordedSamples(
        time_s=time_s,
        number=number,
        step_us=step_us,
        imus=imus,
        gps=gps,
        has_fix=has_fix,
        sensors=assumed,
        origin=origin,
        remarks=tuple(remarks),
    )


def _assumed(motion: np.ndarray, step_us: int) -> dict[str, Any]:
    """Return what is assumed of real sensors, keys as of `sensors.navigation`."""
    gyro, force = (_noise(motion[:, k : k + 3]) for k in (0, 3))
    sensors: dict[str, Any] = {name: dict(keys) for name, keys in _REAL.items()}
    root = math.sqrt(2.0 * step_us / 1e6)
    sensors["gyro"]["noise_density_deg_s_sqrt_hz"] = math.degrees(gyro) * root
    sensors["accelerometer"]["noise_density_m_s2_sqrt_hz"] = force * root
    return sensors


def _means(channel: LogChannel, ends: np.ndarray) -> np.ndarray:
    """Return the means of a channel over steps; NaN in gaps, shape (n - 1,)."""
    t, values = channel.time_s, channel.values
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])
    mean = np.diff(np.interp(ends, t, integral)) / np.diff(ends)
    known = np.isfinite(channel.at(ends))
    return np.where(known[1:] & known[:-1], mean, np.nan)


def _noise(values: np.ndarray) -> float:
    """Return the noise of samples by third differences, which motion has little of."""
    size = np.median(np.abs(np.diff(values, 3, axis=0)), axis=0) / _OF_THIRD
    return max(float(size.mean()), _LEAST_NOISE)


def _new(time_s: np.ndarray, channel: LogChannel) -> tuple[np.ndarray, np.ndarray]:
    """Return the value that a channel has in each step, and whether it is a new one."""
    fresh = np.append(True, np.diff(channel.values) != 0.0)
    times, values = channel.time_s[fresh], channel.values[fresh]
    last = np.searchsorted(times, time_s + 1e-6, side="right") - 1
    new = (np.diff(last, prepend=last[0]) > 0) & (last >= 0)
    return values[np.clip(last, 0, None)], new


def _write_air(
    flight: FlightTable,
    imus: np.ndarray,
    time_s: np.ndarray,
    sensors: dict[str, Any],
    remarks: list[str],
) -> None:
    """Write pressures, or what they were by heights and airspeeds."""
    if "static_pressure" in flight:
        static, new = _new(time_s, flight["static_pressure"])
        static = static * _HPA
    elif "baro_height" in flight:
        height, new = _new(time_s, flight["baro_height"])
        ground = float(flight["gnss_altitude"].at(time_s[:1])[0] - height[0])
        static = np.array([pressure_at(one) for one in (height + np.nan_to_num(ground)).tolist()])
        remarks.append("no static_pressure: it is of the barometer's height")
    else:
        static, new = np.zeros(len(time_s)), np.zeros(len(time_s), bool)
        sensors["barometer"]["fitted"] = False
        remarks.append("no barometer in the log")
    imus["abs_pressure"] = static
    imus["fields_updated"] |= np.where(new, UPDATED[BAROMETER], 0).astype("u4")
    measured = flight.airspeed
    if "dynamic_pressure" in flight:
        dynamic, new = _new(time_s, flight["dynamic_pressure"])
    elif measured is not None:
        speed, new = _new(time_s, measured)
        dynamic = 0.5 * _SEA_LEVEL_KG_M3 * np.maximum(speed, 0.0) ** 2
        remarks.append(f"no dynamic_pressure: it is of {measured.name}")
    else:
        dynamic, new = np.zeros(len(time_s)), np.zeros(len(time_s), bool)
        sensors["pitot"]["fitted"] = False
        remarks.append("no airspeed in the log")
    imus["diff_pressure"] = dynamic * _HPA
    imus["fields_updated"] |= np.where(new, UPDATED[PITOT], 0).astype("u4")
    for name, one in (("barometer", BAROMETER), ("pitot", PITOT)):
        times = time_s[(imus["fields_updated"] & UPDATED[one]) == UPDATED[one]]
        sensors[name]["rate_hz"] = _rate(times)


def _rate(times: np.ndarray) -> float:
    return 1.0 / float(np.median(np.diff(times))) if len(times) > 2 else 1.0


def _write_compass(
    flight: FlightTable,
    imus: np.ndarray,
    time_s: np.ndarray,
    compass: Compass,
    origin: Origin,
    sensors: dict[str, Any],
    remarks: list[str],
) -> None:
    """Write the magnetic field, as it was read or with the hard iron and the scale taken off."""
    sensors["magnetometer"]["fitted"] = compass != "none" and flight.has(names.MAGNETIC)
    if not sensors["magnetometer"]["fitted"]:
        if compass != "none":
            remarks.append("no magnetometer in the log: the heading is of the course")
        return
    found = [_new(time_s, flight[name]) for name in names.MAGNETIC]
    field, new = (
        np.stack([one for one, _ in found], axis=1),
        np.any([one for _, one in found], axis=0),
    )
    if compass == "calibrated":
        size = float(np.linalg.norm(magnetic_field(origin)))
        A = np.column_stack([2.0 * field, np.ones(len(field))])
        solved = np.linalg.lstsq(A, (field**2).sum(axis=1), rcond=None)[0]
        radius = math.sqrt(max(float(solved[3] + solved[:3] @ solved[:3]), 1e-9))
        field = (field - solved[:3]) * size / radius
        iron = ", ".join(f"{one:.3f}" for one in solved[:3])
        remarks.append(
            f"compass calibrated by this flight: hard iron of {iron} gauss taken off, times "
            f"{size / radius:.3f}"
        )
    imus["xmag"], imus["ymag"], imus["zmag"] = field.T
    imus["fields_updated"] |= np.where(new, UPDATED[MAGNETOMETER], 0).astype("u4")
    sensors["magnetometer"]["rate_hz"] = _rate(time_s[new])


def _fixes(
    flight: FlightTable,
    time_s: np.ndarray,
    time_us: np.ndarray,
    latency_s: float,
    sensors: dict[str, Any],
    remarks: list[str],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the last fix in each step, and whether it came in it."""
    gps = np.zeros(len(time_s), HIL_GPS)
    parts = [*names.GNSS_PLACE, *(one for one in names.GNSS_VELOCITY if one in flight)]
    found = {name: _new(time_s, flight[name]) for name in parts}
    has_fix = np.any([new for _, new in found.values()], axis=0)
    if np.count_nonzero(has_fix) < 3:
        raise BadInput(f"{flight.title} has no GNSS fixes while it flies")
    scales = {"lat": 1e7, "lon": 1e7, "alt": 1e3, "vn": 100.0, "ve": 100.0, "vd": 100.0}
    values = dict(zip(scales, (*names.GNSS_PLACE, *names.GNSS_VELOCITY), strict=True))
    for name, scale in scales.items():
        if values[name] in found:
            gps[name] = np.round(found[values[name]][0] * scale)
    if "gnss_v_down" not in flight:
        sensors["gnss"]["vertical_velocity_noise_m_s"] = 5.0
        remarks.append("the receiver's log has no vertical velocity: it counts as 0 ± 5 m/s")
    last = np.maximum.accumulate(np.where(has_fix, np.arange(len(time_s)), 0))
    gps["time_usec"] = time_us[last] - 1e6 * latency_s
    gps["fix_type"] = _FIX_3D
    sensors["gnss"]["rate_hz"] = _rate(time_s[has_fix])
    return gps, has_fix


def flown_span(
    flight: FlightTable, start_s: float | None = None, end_s: float | None = None
) -> tuple[float, float]:
    """Return the longest time in the air, within what is asked for [s].

    Raises:
        BadInput: There is none.
    """
    signals = FlightSignals.renewed(flight, _LEAST_HZ)
    try:
        flying = signals.flying() & np.isfinite(signals.speed())
    except MissingError:
        flying = np.ones(len(signals.time_s), bool)
    t = signals.time_s
    flying &= (t >= (-np.inf if start_s is None else start_s)) & (t <= (end_s or np.inf))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flying, [False]]).astype(int)))
    if not len(edges):
        raise BadInput(f"{flight.title} has no flight in the time that is asked for")
    begins, ends = edges[::2], edges[1::2] - 1
    longest = int(np.argmax(t[ends] - t[begins]))
    return float(t[begins[longest]]), float(t[ends[longest]])
