"""The model under recorded commands, from a recorded start, with and without the fault."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ftc_lab.fault_replay.found import FoundFault
from ftc_lab.flight_signals import FlightSignals, command_in, to_ned
from gcs.results.logs import names
from gcs.results.logs.table import FlightTable, LogChannel, wrapped
from mavlink_defs.constants import ACTUATORS
from sitl_plant.airframe.config import Aircraft
from sitl_plant.simulators.base import Motion
from sitl_plant.simulators.own import OwnSimulator

QUANTITIES = {"roll": "deg", "pitch": "deg", "yaw": "deg", "airspeed": "m/s", "height": "m"}
HORIZONS_S = (0.5, 1.0, 2.0, 5.0)
DIVERGED = {"roll": 10.0, "pitch": 10.0, "airspeed": 3.0}
"""Differences of model and aircraft from which on they do not fly the same."""
_STEP_S = 0.01
_EARLY = 2  # of `HORIZONS_S`: later a fault that is compensated shows in all
_CLEARLY = 0.8
_STARTS = 24  # healthy ones, of which bands are made
_ONE: dict[str, int] = {name: k for k, name in enumerate(ACTUATORS)}


class ServoTimes(NamedTuple):
    """By how much actuators are behind their commands [s]."""

    delay_s: float = 0.0
    lags_s: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


def times_by(shifts_s: Mapping[str, float]) -> ServoTimes:
    """Return the times that an identification has found."""
    lags = (max(shifts_s.get(name, 0.0), 0.0) for name in ("da", "de", "dr"))
    a, b, c = lags
    return ServoTimes(max(shifts_s.get("delay", 0.0), 0.0), (a, b, c, 0.0))


@dataclass(frozen=True)
class Replayed:
    """A flight over some time, recorded or flown again.

    Attributes:
        time_s: By the log, shape (n,).
        values: Of `QUANTITIES`, each of shape (n,).
    """

    time_s: np.ndarray
    values: Mapping[str, np.ndarray]

    def less(self, other: "Replayed") -> "Replayed":
        """Return the differences, angles by the short way."""
        found = {name: one - other.values[name] for name, one in self.values.items()}
        for name in ("roll", "yaw"):
            found[name] = wrapped(found[name], 360.0)
        return Replayed(self.time_s, found)

    def largest(self, name: str, within_s: float) -> float:
        """Return the largest size of a quantity in the first seconds; NaN if it is unknown."""
        size = np.abs(self.values[name][self.time_s <= self.time_s[0] + within_s + 1e-6])
        return float(np.nanmax(size)) if np.isfinite(size).any() else math.nan


class LogMotion:
    """What is needed of a log to begin anywhere in it, and to go on by its commands."""

    def __init__(self, flight: FlightTable, aircraft: Aircraft, servos: ServoTimes) -> None:
        """Read a log, with commands and a wind."""
        self.aircraft, self.servos = aircraft, servos
        common = [*names.ATTITUDE, *names.RATES]
        self.time_s = flight.grid(1.0 / _STEP_S, common)
        signals = FlightSignals(flight, self.time_s)
        ground, wind, rotation = signals.ground(), signals.wind(), signals.rotation
        assert ground is not None
        assert wind is not None
        assert rotation is not None
        self.attitude = np.unwrap(np.nan_to_num(signals.columns(names.ATTITUDE)), axis=0)
        self.rates, self.ground = signals.columns(names.RATES), ground
        self.wind = np.nan_to_num(np.einsum("nij,nj->ni", rotation, wind))
        self.height = self._height(signals)
        through = np.linalg.norm(ground - wind, axis=1)
        measured = flight.airspeed
        if measured is not None and measured.name == "V":
            through = measured.at(self.time_s)
        self.airspeed = through
        if measured is not None and signals.has("angle_of_attack", "sideslip"):
            self.wind = self._by_vanes(signals, rotation, ground)
        limits = [*np.radians(aircraft.stops_deg).tolist(), (0.0, aircraft.thrust_limit_n)]
        late = self.time_s - servos.delay_s
        self.sent = np.stack(
            [
                self._sent(command_in(flight, name, aircraft), late, *limits[k])
                for k, name in enumerate(ACTUATORS)
            ],
            axis=1,
        )
        self.known = np.isfinite(
            np.column_stack([ground, self.rates, self.airspeed, self.sent, self.height])
        ).all(axis=1)

    def _by_vanes(
        self, signals: FlightSignals, rotation: np.ndarray, ground: np.ndarray
    ) -> np.ndarray:
        """Return the wind that airspeed and vanes measured, gusts and all, shape (n, 3)."""
        alpha, beta = signals.of("angle_of_attack"), signals.of("sideslip")
        level = np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)
        body = ground - self.airspeed[:, None] * np.stack(level, axis=1)
        found = np.einsum("nij,nj->ni", rotation, body)
        return np.asarray(np.where(np.isfinite(found), found, self.wind))

    @staticmethod
    def _height(signals: FlightSignals) -> np.ndarray:
        for name, sign in (("down", -1.0), ("altitude", 1.0), ("baro_height", 1.0)):
            if signals.has(name):
                return np.asarray(sign * signals.of(name))
        return np.zeros(len(signals.time_s))

    @staticmethod
    def _sent(one: LogChannel | None, at_s: np.ndarray, low: float, high: float) -> np.ndarray:
        if one is None:
            return np.zeros(len(at_s))
        held = replace(one, by_event=True).at(np.maximum(at_s, one.time_s[0]))
        return np.asarray(np.clip(held, low, high))

    def index(self, time_s: float) -> int:
        """Return the step at a time."""
        return int(np.clip(np.searchsorted(self.time_s, time_s), 0, len(self.time_s) - 1))

    def recorded(self, begin: int, end: int) -> Replayed:
        """Return what the log has of some steps."""
        part, angles = slice(begin, end), np.degrees(self.attitude[begin:end]).T
        values = dict(zip(names.ATTITUDE, angles, strict=True))
        values |= {"airspeed": self.airspeed[part], "height": self.height[part]}
        return Replayed(self.time_s[part], values)

    def flown(self, begin: int, end: int, fault: FoundFault | None) -> Replayed:
        """Return what the model does in some steps from the log's state at the first."""
        simulator = OwnSimulator(self.aircraft)
        pull = [1.0 if lag < 1e-4 else 1.0 - math.exp(-_STEP_S / lag) for lag in self.servos.lags_s]
        at, rows = self.sent[begin].copy(), []
        v, angles, omega = (
            (float(x), float(y), float(z))
            for x, y, z in (self.ground[begin], self.attitude[begin], self.rates[begin])
        )
        place = (0.0, 0.0, -float(self.height[begin]))
        simulator.reset(Motion(place, v, angles, omega, (0.0, 0.0, 0.0)))
        for k in range(begin, end):
            now = simulator.read()
            rotated = self._through(now, self.wind[k])
            rows.append((*np.degrees(now.attitude), rotated, -now.position[2]))
            at += pull * (self.sent[k] - at)
            did = at if fault is None else self._faulty(at, fault, self.time_s[k])
            a, b, c = (float(one) for one in did[:3])
            simulator.control((a, b, c), float(did[3]))
            x, y, z = (float(one) for one in self.wind[k])
            simulator.set_wind((x, y, z))
            simulator.advance(_STEP_S)
        values = dict(zip(QUANTITIES, np.array(rows).T, strict=True))
        return Replayed(self.time_s[begin:end], values)

    @staticmethod
    def _through(now: Motion, wind: np.ndarray) -> float:
        body = to_ned(np.array([now.attitude]))[0].T @ wind
        return float(np.linalg.norm(np.array(now.velocity) - body))

    def _faulty(self, at: np.ndarray, fault: FoundFault, time_s: float) -> np.ndarray:
        """Return what actuators do when one has failed."""
        if time_s < fault.onset_s:
            return at
        k, did = _ONE[fault.actuator], at.copy()
        unit, size = ("n", 1.0) if k == 3 else ("deg", math.pi / 180.0)
        values = fault.values
        if f"stuck_{unit}" in values:
            did[k] = values[f"stuck_{unit}"] * size
            return did
        did[k] = values.get("effectiveness", 1.0) * at[k]
        did[k] += values.get(f"bias_{unit}", 0.0) * size
        return did


class ReplayErrors(NamedTuple):
    """How far the model is from the aircraft.

    Attributes:
        healthy: What 95 % of healthy replays are below, by quantity, at each of `HORIZONS_S`.
        starts: How many those are.
        faulty: Of the replay over the onset, with the fault.
        healed: The same without.
        diverged_s: Since the onset, with the fault; None: not before the end.
        judged_s: From the onset to the end of the replay.
    """

    healthy: Mapping[str, tuple[float, ...]]
    starts: int
    faulty: Mapping[str, tuple[float, ...]]
    healed: Mapping[str, tuple[float, ...]]
    diverged_s: float | None
    judged_s: float

    @property
    def confirms(self) -> bool:
        """Whether the model with the fault flies clearly more like the aircraft than without."""
        apart = [
            sum(sizes[name][_EARLY] / most for name, most in DIVERGED.items())
            for sizes in (self.faulty, self.healed)
        ]
        return apart[0] < _CLEARLY * apart[1]


def healthy_bands(log: LogMotion, until_s: float) -> tuple[dict[str, tuple[float, ...]], int]:
    """Return what 95 % of errors are below, of the model from starts before a time."""
    length = round(HORIZONS_S[-1] / _STEP_S) + 1
    bad = np.concatenate([[0], np.cumsum(~log.known)])
    last = log.index(until_s) - length
    clear = [k for k in range(0, max(last, 0), length // 2) if bad[k + length] == bad[k]]
    chosen = np.array(clear)[np.linspace(0, len(clear) - 1, min(_STARTS, len(clear))).astype(int)]
    errors = [
        log.flown(k, k + length, None).less(log.recorded(k, k + length)) for k in chosen.tolist()
    ]
    if not errors:
        return {}, 0
    return {
        name: tuple(
            float(np.percentile([one.largest(name, span) for one in errors], 95.0))
            for span in HORIZONS_S
        )
        for name in QUANTITIES
    }, len(errors)


def diverged(off: Replayed, onset_s: float) -> float | None:
    """Return how long after a time the model and the aircraft do not fly the same; None: never."""
    apart = np.zeros(len(off.time_s), bool)
    for name, most in DIVERGED.items():
        apart |= np.abs(off.values[name]) > most
    apart &= off.time_s >= onset_s
    return float(off.time_s[np.argmax(apart)] - onset_s) if apart.any() else None


def errors_of(log: LogMotion, begin: int, end: int, fault: FoundFault | None) -> ReplayErrors:
    """Compare the model with the log from a step to another."""
    onset_s = float(log.time_s[begin]) if fault is None else fault.onset_s
    first = log.index(onset_s)
    recorded = log.recorded(begin, end)
    faulty, healed = (log.flown(begin, end, one).less(recorded) for one in (fault, None))
    bands, starts = healthy_bands(log, onset_s)

    def sizes(off: Replayed) -> dict[str, tuple[float, ...]]:
        late = Replayed(
            off.time_s[first - begin :], {n: v[first - begin :] for n, v in off.values.items()}
        )
        return {name: tuple(late.largest(name, span) for span in HORIZONS_S) for name in QUANTITIES}

    judged_s = float(log.time_s[end - 1]) - onset_s
    return ReplayErrors(
        bands, starts, sizes(faulty), sizes(healed), diverged(faulty, onset_s), judged_s
    )
