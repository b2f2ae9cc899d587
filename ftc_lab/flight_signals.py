"""Signals of a log at common times, as all read them that judge a flight: motion, air, commands."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.logs import names
from gcs.results.logs.table import FlightTable, LogChannel, wrapped
from mavlink_defs.constants import ACTUATORS
from sitl_plant.airframe.config import Aircraft

_TURN = 2.0 * np.pi
_BRIDGED_S = 1.0  # longest time without a new value that is bridged
_LEAST_HZ = 1.5  # at which a signal must be renewed
_FLYING = 0.3  # of the usual speed: slower is on the ground
_EDGE_S = 2.0  # left out after take-off and before touch-down
_SLOWEST_M_S = 4.0  # slower is standing or taxiing, and no usual speed
_MEASURED = {"airspeed": names.AIRSPEEDS, "height": ("altitude", "baro_height")}
_MOST = 1e6  # in any unit here: what is more is damage in the log, not a measurement
_BY_HAND = {"MANUAL", "ACRO", "TRAINING"}  # modes of ArduPlane and PX4 that follow no attitude


class MissingError(Exception):
    """A signal that is not there, or too seldom renewed."""


class FlightSignals:
    """Signals of a log at some times.

    Attributes:
        flight: The log.
        time_s: The times, shape (n,).
    """

    def __init__(self, flight: FlightTable, time_s: np.ndarray, *, renewed: bool = False) -> None:
        """Read a log.

        Args:
            flight: The log.
            time_s: At which times, shape (n,).
            renewed: Whether rows that repeat an old value are none, as of merged tables.
        """
        self.flight, self.time_s, self._is_renewed = flight, time_s, renewed

    @classmethod
    def renewed(cls, flight: FlightTable, rate_hz: float) -> "FlightSignals":
        """Return what is new in a log, so many times a second over all of it."""
        steps = int(flight.duration_s * rate_hz + 1e-6) + 1
        return cls(flight, flight.begin_s + np.arange(steps) / rate_hz, renewed=True)

    def has(self, *asked: str) -> bool:
        """Return whether the log has all of some signals."""
        return self.flight.has(asked)

    def of(self, *asked: str) -> np.ndarray:
        """Return the first of some signals that the log has, NaN where it has a gap, shape (n,).

        Raises:
            MissingError: It has none of them, or too few values.
        """
        for name in asked:
            if name in self.flight:
                one = self.flight[name]
                return self._of_new(one) if self._is_renewed else one.at(self.time_s)
        raise MissingError(f"the log has no {' or '.join(asked)}")

    def columns(self, asked: Sequence[str]) -> np.ndarray:
        """Return signals side by side, shape (n, m); MissingError if one is not there."""
        return np.stack([self.of(name) for name in asked], axis=1)

    @cached_property
    def rotation(self) -> np.ndarray | None:
        """From body axes to north, east, down, shape (n, 3, 3); None without an attitude."""
        return to_ned(self.columns(names.ATTITUDE)) if self.has(*names.ATTITUDE) else None

    def ground(self) -> np.ndarray | None:
        """Return the velocity over the ground, body axes, shape (n, 3); None: unknown."""
        if self.has(*"uvw"):
            return self.columns("uvw")
        if self.rotation is None or not self.has(*names.VELOCITY):
            return None
        return np.asarray(np.einsum("nij,ni->nj", self.rotation, self.columns(names.VELOCITY)))

    def wind(self) -> np.ndarray | None:
        """Return the wind of the log, body axes, shape (n, 3); None: it has none."""
        if self.has("wind_u", "wind_v", "wind_w"):
            return self.columns(("wind_u", "wind_v", "wind_w"))
        if self.rotation is None or not self.has("wind_north", "wind_east"):
            return None
        level = self.columns(("wind_north", "wind_east"))
        return np.asarray(np.einsum("nij,ni->nj", self.rotation[:, :2], level))

    def steady_wind(self, airspeed: np.ndarray, slowest: float) -> tuple[float, float]:
        """Return the wind to north and east with which ground speeds fit airspeeds best [m/s].

        Args:
            airspeed: True, shape (n,) [m/s].
            slowest: Less is no flight [m/s].

        Raises:
            BadInput: There is no flight in the log, or no velocity and attitude.
        """
        from scipy.optimize import least_squares

        ground = self.ground()
        if ground is None or self.rotation is None:
            raise BadInput(f"{self.flight.title} has no velocity and attitude: its wind is unknown")
        ned = np.einsum("nij,nj->ni", self.rotation, ground)
        known = np.isfinite(ned).all(axis=1) & (slowest < airspeed)
        if np.count_nonzero(known) < 3:
            raise BadInput(f"{self.flight.title} has no flight: its airspeed is too low")

        def left(wind: np.ndarray) -> np.ndarray:
            through = np.linalg.norm(ned[known] - np.append(wind, 0.0), axis=1)
            return np.asarray(through - airspeed[known])

        north, east = least_squares(left, np.zeros(2)).x.tolist()
        return north, east

    def error(self, name: str) -> np.ndarray:
        """Return measured minus commanded."""
        if f"error_{name}" in self.flight:
            return self.of(f"error_{name}")
        measured = self.of(*_MEASURED.get(name, (name,)))
        error = measured - self.of(f"reference_{name}")
        return wrapped(error, _TURN) if name in {"roll", "pitch"} else error

    def airspeed(self) -> np.ndarray:
        """Return the airspeed as the log has it [m/s]; MissingError if it has none."""
        return self.of(*names.AIRSPEEDS)

    def speed(self) -> np.ndarray:
        """Return the airspeed, else the speed over the ground, shape (n,) [m/s]."""
        try:
            return self.airspeed()
        except MissingError:
            return np.asarray(np.hypot(self.of("v_north"), self.of("v_east")))

    def flying(self) -> np.ndarray:
        """Return when the aircraft flies, by its speed, shape (n,); always if that is unknown.

        Raises:
            BadInput: It never does.
        """
        try:
            speed = self.speed()
        except MissingError:
            return np.ones(len(self.time_s), bool)
        moving = speed[speed > _SLOWEST_M_S]
        if not len(moving):
            most = np.max(speed[np.isfinite(speed)], initial=0.0)
            text = f"{self.flight.title} has no flight: its speed is {most:.1f} m/s at most"
            raise BadInput(text, f"expected {_SLOWEST_M_S:g} m/s or more")
        slow = (speed < _FLYING * np.median(moving)).astype(float)
        width = 2 * np.count_nonzero(self.time_s - self.time_s[0] < _EDGE_S - 1e-6) + 1
        return np.asarray(np.convolve(slow, np.ones(width))[width // 2 :][: len(slow)] < 0.5)

    def by_autopilot(self) -> np.ndarray:
        """Return when no pilot flies by hand, shape (n,)."""
        found = np.ones(len(self.time_s), bool)
        for begin_s, mode in self.flight.modes:  # each until the next one
            found[self.time_s >= begin_s] = mode.upper() not in _BY_HAND
        return found

    def _of_new(self, channel: LogChannel) -> np.ndarray:
        if not np.ptp(channel.values):  # such as no wind
            return channel.at(self.time_s)
        is_command = channel.name.startswith("reference_")  # which may stay as it is
        time_s, values = (channel.time_s, channel.values) if is_command else _news_of(channel)
        time_s, values = time_s[np.abs(values) < _MOST], values[np.abs(values) < _MOST]
        span = float(time_s[-1] - time_s[0])
        if len(time_s) < 2 or len(time_s) < _LEAST_HZ * span:
            rate = (len(time_s) - 1) / span if span > 0.0 else 0.0
            raise MissingError(
                f"{channel.name} is renewed {rate:.1f} times a second, expected {_LEAST_HZ:g}"
            )
        if channel.name.endswith(("roll", "yaw")):
            values = np.unwrap(values)
        found = np.interp(self.time_s, time_s, values, left=np.nan, right=np.nan)
        after = np.clip(np.searchsorted(time_s, self.time_s), 1, len(time_s) - 1)
        found[time_s[after] - time_s[after - 1] > _BRIDGED_S + 1e-6] = np.nan
        return np.asarray(found)


def _news_of(channel: LogChannel) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values where a channel is renewed: merged tables repeat old values.

    Of a value that stays the same, one a second is kept.
    """
    new = np.append(True, np.diff(channel.values) != 0.0)
    spans = np.floor(channel.time_s / _BRIDGED_S)
    last = np.maximum.accumulate(np.where(new, np.arange(len(new)), 0))
    long_ago = channel.time_s - channel.time_s[last] >= _BRIDGED_S
    new |= np.append(True, np.diff(spans) > 0.0) & long_ago
    return channel.time_s[new], channel.values[new]


def command_in(flight: FlightTable, name: str, aircraft: Aircraft) -> LogChannel | None:
    """Return what an actuator was commanded [rad or N]; None if the log does not say.

    Shares are of the stops, and of the largest thrust.
    """
    if f"held_{name}" in flight:
        return flight[f"held_{name}"]
    if f"share_{name}" not in flight:
        return None
    share = flight[f"share_{name}"]
    if name == "throttle":
        return replace(share, unit="N", values=share.values * aircraft.thrust_limit_n)
    low, high = np.radians(aircraft.stops_deg[ACTUATORS.index(name)])
    return replace(
        share, unit="rad", values=np.where(share.values < 0.0, -low, high) * share.values
    )


def held_mean(sent: LogChannel, time_s: np.ndarray, span_s: float) -> np.ndarray:
    """Return the mean over the last seconds of a command, which is held, at times of shape (n,)."""
    times = np.append(sent.time_s, max(float(time_s[-1]), float(sent.time_s[-1])))
    integral = np.concatenate([[0.0], np.cumsum(sent.values * np.diff(times))])
    now, before = (np.interp(time_s - ago, times, integral, np.nan) for ago in (0.0, span_s))
    return np.asarray((now - before) / span_s)


def to_ned(attitude: np.ndarray) -> np.ndarray:
    """Return the rotations from body axes to north, east, down, shape (n, 3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(attitude).T, np.sin(attitude).T
    rows = [
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
