"""Relations between signals of a flight that hold while nothing has failed.

Each is a linear regression of one measured signal on a few others, whose coefficients the flight
itself shows (`evidence`). Nothing of the aircraft is known: no mass, no coefficient, no sign.
Signals are means over 0.8 s on a grid of 10 Hz, since telemetry is often renewed at 2 to 4 Hz only.

After Keipour, Mousaei and Scherer, "Automatic Real-time Anomaly Detection for Autonomous Aerial
Vehicles" (ICRA 2019, arXiv 1907.00511), who regress one signal on a related one: an attitude loop
turns an error into a rate, at a gain that a surface which is stuck or has lost a part does not
make. Some loops feed the rate of the command forward; a log with errors only does not show it.

| surface | measured | by |
| --- | --- | --- |
| aileron | p | error of roll, now and 0.4 s ago; how fast the commanded roll changes |
| elevator | q | the same of pitch; r², as q = r tan(roll) in a turn |
| rudder | specific force along y | p, r |
| engine | thrust less drag, by mass | errors of airspeed and height; specific force along z |

Thrust less drag is measured twice, and the mean taken: as specific force along x, and as the rate
of the energy, g ḣ/V + V̇, which the angle of attack does not enter.
"""

import contextlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.logs.names import AIRSPEEDS
from gcs.results.logs.table import FlightTable, LogChannel, wrapped

Surface = Literal["engine", "aileron", "elevator", "rudder"]
SURFACES: tuple[Surface, ...] = ("engine", "aileron", "elevator", "rudder")

_TURN = 2.0 * np.pi
_GRAVITY_M_S2 = 9.80665
_MEAN_S = 0.8  # over which signals are averaged: two periods of the slowest usual telemetry
_AGO_S = 0.4  # half of it
_SLOW_MEAN_S = 1.0  # of the engine's, which need not be as fast
_BRIDGED_S = 1.0  # longest time without a new value that is bridged
_LEAST_HZ = 1.5  # at which a signal must be renewed
_FLYING = 0.3  # of the usual speed: slower is on the ground
_EDGE_S = 2.0  # left out after take-off and before touch-down
_SLOWEST_M_S = 4.0  # slower is standing or taxiing, and no usual speed
_MEASURED = {"airspeed": AIRSPEEDS, "height": ("altitude", "baro_height")}
_MOST = 1e6  # in any unit here: what is more is damage in the log, not a measurement
_TINY = 1e-9  # of what never changes, as its means differ
_BY_HAND = {"MANUAL", "ACRO", "TRAINING"}  # modes of ArduPlane and PX4 that follow no attitude


Test = Literal["response", "shift", "drop"]


class LearningPace(NamedTuple):
    """How fast relations are sampled, learnt and tested; times in s.

    Attributes:
        kind: By which what other flights have shown is found.
        rate_hz: Of the grid.
        lag_s: By how much the means that a relation is between lag.
        guard_s: The last that is not learnt yet, so that a fault is found before it is learnt.
        least_learnt_s: Learnt before residuals count.
        least_measured_s: Residuals measured before anything is judged.
        block_s: Over whose mean the size of residuals is measured.
        named_s: After an alarm, which name what failed; half of them say since when.
        windows_s: That are tested, by kind of test.
    """

    kind: Literal["telemetry", "model"]
    rate_hz: float
    lag_s: float
    guard_s: float
    least_learnt_s: float
    least_measured_s: float
    block_s: float
    named_s: float
    windows_s: Mapping[Test, tuple[float, ...]]

    def steps(self, span_s: float) -> int:
        """Return the samples of a time."""
        return round(span_s * self.rate_hz)


TELEMETRY = LearningPace(
    kind="telemetry",
    rate_hz=10.0,
    lag_s=_MEAN_S / 2.0,
    guard_s=10.0,
    least_learnt_s=6.0,
    least_measured_s=8.0,
    block_s=2.0,
    named_s=2.0,
    windows_s={
        "response": (2.0, 4.0, 8.0),  # a gain needs manoeuvres
        "shift": (0.5, 1.0, 2.0, 4.0),
        "drop": (1.0, 2.0, 4.0, 8.0),
    },
)


class Relation(NamedTuple):
    """One surface's relation over a flight.

    Attributes:
        surface: What it judges.
        text: By what, for people.
        unit: Of what is measured.
        measured: Shape (n,); NaN where something is missing.
        terms: What it is regressed on, shape (n, m).
        test: "response": a shift or a loss of gain; "shift": a step to either side; "drop": a step
            down.
        pace: Of the grid.
        response: What a gain is tested of, shape (n,); None: of what the terms predict.
        least: Deviation that counts for nothing: a simulator is better than any model is.
    """

    surface: Surface
    text: str
    unit: str
    measured: np.ndarray
    terms: np.ndarray
    test: Test
    pace: LearningPace = TELEMETRY
    response: np.ndarray | None = None
    least: float = 0.0


@dataclass(frozen=True)
class Relations:
    """What can be judged of a flight.

    Attributes:
        time_s: The grid, shape (n,).
        relations: Of the surfaces that can be judged.
        cannot: Why others cannot, each a line.
    """

    time_s: np.ndarray
    relations: tuple[Relation, ...]
    cannot: tuple[str, ...]

    @property
    def pace(self) -> LearningPace:
        """How fast they are tested."""
        return self.relations[0].pace


def relations_of(flight: FlightTable) -> Relations:
    """Return the relations that a log shows.

    Raises:
        BadInput: It shows none, or there is no flight in it.
    """
    signals = Signals(flight)
    found, cannot = [], []
    for surface, make in _MAKERS.items():
        try:
            found.append(_alive(make(signals)))
        except MissingError as missing:
            cannot.append(f"{surface} not judged: {missing}")
    if not found:
        raise BadInput(f"nothing of {flight.title} can be judged", "; ".join(cannot))
    judged = signals.flying() & signals.by_autopilot()
    return Relations(signals.time_s, only_while(judged, found), tuple(cannot))


def only_while(judged: np.ndarray, relations: Iterable[Relation]) -> tuple[Relation, ...]:
    """Return relations without what they measure at other times; `judged` has shape (n,)."""
    return tuple(one._replace(measured=np.where(judged, one.measured, np.nan)) for one in relations)


def _alive(relation: Relation) -> Relation:
    """Return a relation; MissingError if what it measures is of a sensor that is none."""
    known = relation.measured[np.isfinite(relation.measured)]
    if len(known) and not np.ptp(known) > _TINY:
        raise MissingError(f"{relation.text}: the first never changes")
    return relation


class MissingError(Exception):
    """A signal that is not there, or too seldom renewed."""


class Signals:
    """Signals of a log on an even grid."""

    def __init__(self, flight: FlightTable, rate_hz: float = TELEMETRY.rate_hz) -> None:
        self._flight, self._rate_hz = flight, rate_hz
        steps = int(flight.duration_s * rate_hz + 1e-6) + 1
        self.time_s = flight.begin_s + np.arange(steps) / rate_hz

    def of(self, *names: str) -> np.ndarray:
        """Return the first of some signals that the log has, NaN where it has a gap, shape (n,).

        Raises:
            MissingError: It has none of them, or too few values.
        """
        for name in names:
            if name in self._flight:
                return self._on_grid(self._flight[name])
        raise MissingError(f"the log has no {' or '.join(names)}")

    def has(self, *names: str) -> bool:
        """Return whether the log has all of some signals."""
        return self._flight.has(names)

    def error(self, name: str) -> np.ndarray:
        """Return measured minus commanded."""
        if f"error_{name}" in self._flight:
            return self.of(f"error_{name}")
        measured = self.of(*_MEASURED.get(name, (name,)))
        error = measured - self.of(f"reference_{name}")
        return wrapped(error, _TURN) if name in {"roll", "pitch"} else error

    def held_mean(self, name: str, span_s: float) -> np.ndarray:
        """Return the mean over the last seconds of a command, which is held, shape (n,)."""
        sent = self._flight[name]
        end_s = max(float(self.time_s[-1]), float(sent.time_s[-1]))
        lasting = np.diff(np.append(sent.time_s, end_s))
        integral = np.concatenate([[0.0], np.cumsum(sent.values * lasting)])
        times = np.append(sent.time_s, end_s)
        ends = (np.interp(self.time_s - ago, times, integral, np.nan) for ago in (0.0, span_s))
        return np.asarray((next(ends) - next(ends)) / span_s)

    def _on_grid(self, channel: LogChannel) -> np.ndarray:
        if not np.ptp(channel.values):  # such as no wind
            return channel.at(self.time_s)
        is_command = channel.name.startswith("reference_")  # which may stay as it is
        time_s, values = (channel.time_s, channel.values) if is_command else _renewed(channel)
        time_s, values = time_s[np.abs(values) < _MOST], values[np.abs(values) < _MOST]
        span = float(time_s[-1] - time_s[0])
        if len(time_s) < 2 or len(time_s) < _LEAST_HZ * span:
            rate = (len(time_s) - 1) / span if span > 0.0 else 0.0
            raise MissingError(
                f"{channel.name} is renewed {rate:.1f} times a second, expected {_LEAST_HZ:g}"
            )
        if channel.name.endswith(("roll", "yaw")):
            values = np.unwrap(values)
        on_grid = np.interp(self.time_s, time_s, values, left=np.nan, right=np.nan)
        after = np.clip(np.searchsorted(time_s, self.time_s), 1, len(time_s) - 1)
        on_grid[time_s[after] - time_s[after - 1] > _BRIDGED_S + 1e-6] = np.nan
        return np.asarray(on_grid)

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
            text = f"{self._flight.title} has no flight: its speed is {most:.1f} m/s at most"
            raise BadInput(text, f"expected {_SLOWEST_M_S:g} m/s or more")
        slow = (speed < _FLYING * np.median(moving)).astype(float)
        width = 2 * int(_EDGE_S * self._rate_hz) + 1
        return np.asarray(np.convolve(slow, np.ones(width))[width // 2 :][: len(slow)] < 0.5)

    def by_autopilot(self) -> np.ndarray:
        """Return when no pilot flies by hand, shape (n,)."""
        found = np.ones(len(self.time_s), bool)
        for begin_s, mode in self._flight.modes:  # each until the next one
            found[self.time_s >= begin_s] = mode.upper() not in _BY_HAND
        return found

    def speed(self) -> np.ndarray:
        """Return the airspeed, else that over the ground, shape (n,) [m/s]."""
        try:
            return self.of(*AIRSPEEDS)
        except MissingError:
            return np.asarray(np.hypot(self.of("v_north"), self.of("v_east")))


def _renewed(channel: LogChannel) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values where a channel is renewed: merged tables repeat old values.

    Of a value that stays the same, one a second is kept.
    """
    new = np.append(True, np.diff(channel.values) != 0.0)
    spans = np.floor(channel.time_s / _BRIDGED_S)
    new |= np.append(True, np.diff(spans) > 0.0) & ~_shortly_after(channel.time_s, new)
    return channel.time_s[new], channel.values[new]


def _shortly_after(time_s: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return what is less than the bridged time after a new value."""
    last = np.maximum.accumulate(np.where(new, np.arange(len(new)), 0))
    return np.asarray(time_s - time_s[last] < _BRIDGED_S)


def _mean(signal: np.ndarray, span_s: float) -> np.ndarray:
    """Return the mean over the last seconds; NaN where the signal has not been there so long."""
    steps = TELEMETRY.steps(span_s)
    mean = np.convolve(signal, np.full(steps, 1.0 / steps))[: len(signal)]
    mean[: steps - 1] = np.nan
    return mean


def _ago(signal: np.ndarray, span_s: float) -> np.ndarray:
    """Return a signal as it was some seconds ago."""
    return before(signal, TELEMETRY.steps(span_s))


def before(values: np.ndarray, steps: int) -> np.ndarray:
    """Return values as they were some steps ago, shape (n, ...); NaN at first."""
    return np.concatenate([np.full((steps, *values.shape[1:]), np.nan), values])[: len(values)]


def _terms(*columns: np.ndarray) -> np.ndarray:
    return np.stack([np.ones_like(columns[0]), *columns], axis=1)


def _commanded_rate(signals: Signals, name: str) -> list[np.ndarray]:
    """Return how fast a commanded angle changes; empty if unknown."""
    try:
        commanded = signals.of(f"reference_{name}")
    except MissingError:
        return []
    change = wrapped(commanded - _ago(commanded, _AGO_S), _TURN)
    return [_mean(change / _AGO_S, _MEAN_S)]


def _aileron(signals: Signals) -> Relation:
    error = _mean(signals.error("roll"), _MEAN_S)
    p = _mean(signals.of("p"), _MEAN_S)
    return Relation(
        "aileron",
        "roll rate by error of roll",
        "rad/s",
        p,
        _terms(error, _ago(error, _AGO_S), *_commanded_rate(signals, "roll")),
        "response",
    )


def _elevator(signals: Signals) -> Relation:
    error = _mean(signals.error("pitch"), _MEAN_S)
    q, turn = _mean(signals.of("q"), _MEAN_S), _mean(signals.of("r") ** 2, _MEAN_S)
    terms = _terms(error, _ago(error, _AGO_S), turn, *_commanded_rate(signals, "pitch"))
    return Relation("elevator", "pitch rate by error of pitch", "rad/s", q, terms, "shift")


def _rudder(signals: Signals) -> Relation:
    p, r = (_mean(signals.of(name), _MEAN_S) for name in ("p", "r"))
    side = _mean(signals.of("specific_force_y"), _MEAN_S)
    return Relation("rudder", "side force by rates", "m/s²", side, _terms(p, r), "shift")


def _engine(signals: Signals) -> Relation:
    airspeed = signals.error("airspeed")
    terms = [_mean(airspeed, _SLOW_MEAN_S)]
    with contextlib.suppress(MissingError):
        terms.append(_mean(signals.error("height"), _SLOW_MEAN_S))
    terms.append(_mean(signals.of("specific_force_z"), _SLOW_MEAN_S))
    V = float(np.nanmedian(signals.speed()))
    climb = -_mean(signals.of("v_down"), _SLOW_MEAN_S)
    changing = airspeed  # with its command, too, unless the log has the airspeed itself
    with contextlib.suppress(MissingError):
        changing = signals.of(*_MEASURED["airspeed"])
    acceleration = (changing - _ago(changing, _SLOW_MEAN_S)) / _SLOW_MEAN_S
    along = _mean(signals.of("specific_force_x"), _SLOW_MEAN_S)
    excess = (along + _GRAVITY_M_S2 * climb / V + acceleration) / 2.0
    text = "thrust less drag by errors of airspeed and height"
    return Relation("engine", text, "m/s²", excess, _terms(*terms), "drop")


_MAKERS: dict[Surface, Callable[[Signals], Relation]] = {
    "engine": _engine,
    "aileron": _aileron,
    "elevator": _elevator,
    "rudder": _rudder,
}
