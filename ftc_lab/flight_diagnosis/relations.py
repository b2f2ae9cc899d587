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

from ftc_lab.flight_signals import FlightSignals, MissingError
from gcs.console.errors import BadInput
from gcs.results.logs.table import FlightTable, wrapped

Surface = Literal["engine", "aileron", "elevator", "rudder"]
SURFACES: tuple[Surface, ...] = ("engine", "aileron", "elevator", "rudder")

_TURN = 2.0 * np.pi
_GRAVITY_M_S2 = 9.80665
_MEAN_S = 0.8  # over which signals are averaged: two periods of the slowest usual telemetry
_AGO_S = 0.4  # half of it
_SLOW_MEAN_S = 1.0  # of the engine's, which need not be as fast
_TINY = 1e-9  # of what never changes, as its means differ


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
    signals = FlightSignals.renewed(flight, TELEMETRY.rate_hz)
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


def _commanded_rate(signals: FlightSignals, name: str) -> list[np.ndarray]:
    """Return how fast a commanded angle changes; empty if unknown."""
    try:
        commanded = signals.of(f"reference_{name}")
    except MissingError:
        return []
    change = wrapped(commanded - _ago(commanded, _AGO_S), _TURN)
    return [_mean(change / _AGO_S, _MEAN_S)]


def _aileron(signals: FlightSignals) -> Relation:
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


def _elevator(signals: FlightSignals) -> Relation:
    error = _mean(signals.error("pitch"), _MEAN_S)
    q, turn = _mean(signals.of("q"), _MEAN_S), _mean(signals.of("r") ** 2, _MEAN_S)
    terms = _terms(error, _ago(error, _AGO_S), turn, *_commanded_rate(signals, "pitch"))
    return Relation("elevator", "pitch rate by error of pitch", "rad/s", q, terms, "shift")


def _rudder(signals: FlightSignals) -> Relation:
    p, r = (_mean(signals.of(name), _MEAN_S) for name in ("p", "r"))
    side = _mean(signals.of("specific_force_y"), _MEAN_S)
    return Relation("rudder", "side force by rates", "m/s²", side, _terms(p, r), "shift")


def _engine(signals: FlightSignals) -> Relation:
    airspeed = signals.error("airspeed")
    terms = [_mean(airspeed, _SLOW_MEAN_S)]
    with contextlib.suppress(MissingError):
        terms.append(_mean(signals.error("height"), _SLOW_MEAN_S))
    terms.append(_mean(signals.of("specific_force_z"), _SLOW_MEAN_S))
    V = float(np.nanmedian(signals.speed()))
    climb = -_mean(signals.of("v_down"), _SLOW_MEAN_S)
    changing = airspeed  # with its command, too, unless the log has the airspeed itself
    with contextlib.suppress(MissingError):
        changing = signals.airspeed()
    acceleration = (changing - _ago(changing, _SLOW_MEAN_S)) / _SLOW_MEAN_S
    along = _mean(signals.of("specific_force_x"), _SLOW_MEAN_S)
    excess = (along + _GRAVITY_M_S2 * climb / V + acceleration) / 2.0
    text = "thrust less drag by errors of airspeed and height"
    return Relation("engine", text, "m/s²", excess, _terms(*terms), "drop")


_MAKERS: dict[Surface, Callable[[FlightSignals], Relation]] = {
    "engine": _engine,
    "aileron": _aileron,
    "elevator": _elevator,
    "rudder": _rudder,
}
