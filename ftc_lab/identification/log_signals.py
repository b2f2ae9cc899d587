"""What identification needs of a log, on even steps: air, rates, forces, surfaces, thrust.

Inputs are means over a step, rates are read at its ends. So a command that is held, a recording of
1 kHz and a vane that is read now and then are the same thing, and any of them can be shifted in
time by less than a step.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ftc_lab.flight_signals import FlightSignals, command_in
from ftc_lab.identification.readings import angles_of
from gcs.console.errors import BadInput
from gcs.results.logs import names
from gcs.results.logs.table import FlightTable
from mavlink_defs.constants import SURFACES
from sitl_plant.airframe.aircraft import AircraftRecord, aircraft_record
from sitl_plant.airframe.config import Aircraft

LEAST_HZ = 8.0
"""Rates must be renewed so often: four times in the roll of a small aircraft, some 0.5 s."""
_MOST_HZ = 100.0  # steps per second, of which more show nothing of a rigid body
_SEA_LEVEL_KG_M3 = 1.225  # by which indicated airspeeds are pressures
_FINE_S = 0.005  # of steps in which a surface hardly moves
_OF_THIRD = 0.6745 * math.sqrt(20.0)  # median size of third differences, by the noise's
_NO_LAG_S = 1e-4  # below which a lag is none
_STILL_M_S = 0.1  # by which nothing is divided
_SLOWEST = 0.8  # of the lowest airspeed command accepted: slower is on the ground


@dataclass(frozen=True, eq=False)
class Track:
    """A signal as its integral at even times, so that its mean over any step is a difference."""

    time_s: np.ndarray
    integral: np.ndarray

    def means(self, ends_s: np.ndarray, shift_s: float = 0.0) -> np.ndarray:
        """Return the means over steps, of what the signal was some seconds before.

        Args:
            ends_s: When steps begin and end, shape (..., n + 1).
            shift_s: How long before.
        """
        h, last = float(self.time_s[1] - self.time_s[0]), len(self.time_s) - 1
        place = np.clip((ends_s - (shift_s + self.time_s[0])) / h, 0.0, last)
        before = np.minimum(place.astype(np.int64), last - 1)
        at = self.integral[before]
        at += (place - before) * (self.integral[before + 1] - at)
        return np.asarray(np.diff(at) / np.diff(ends_s))

    @lru_cache(maxsize=16)  # noqa: B019 - of the few signals of a flight, and small beside them
    def behind(self, lag_s: float) -> "Track":
        """Return what follows the signal by a first-order lag: its integral follows by the same."""
        if lag_s < _NO_LAG_S:
            return self
        from scipy.signal import lfilter

        h = float(self.time_s[1] - self.time_s[0])
        left = math.exp(-h / lag_s)
        mean = lag_s / h * (1.0 - left)
        return Track(self.time_s, lfilter([1.0 - mean, mean - left], [1.0, -left], self.integral))


@dataclass(frozen=True)
class LogSignals:
    """n steps of a flight; SI units, body axes.

    Attributes:
        ends_s: When steps begin and end, shape (n + 1,).
        good: Whether all is known, and the aircraft flies, shape (n,).
        rates: At the ends, shape (n + 1, 3).
        mean_rates: Over the steps, shape (n, 3).
        gyroscopic: Mean of ω × J ω [N m], shape (n, 3).
        airspeed: Mean, shape (n,).
        pressure: Mean dynamic pressure [Pa], shape (n,).
        force: Mean specific force [m/s²], shape (n, 3).
        thrust: Mean, as the aircraft's file has it [N], shape (n,); None: not in the log.
        tracks: What can be shifted: "alpha", "beta", "da", "de", "dr" [rad].
        exact: Whether all is of one clock, and the surfaces are where they were: a recording.
        kinematic: Rate of change of the velocities along z and y as the accelerations have it,
            without a change of wind, shape (n, 2) [m/s²]; None: not comparable.
        noise: Of one sample of the probes of "alpha" and "beta", standard deviation [rad] and time
            between samples [s]; empty without probes.
        record: The aircraft as the equations read it.
        remarks: What was taken for what, and what is missing.
    """

    ends_s: np.ndarray
    good: np.ndarray
    rates: np.ndarray
    mean_rates: np.ndarray
    gyroscopic: np.ndarray
    airspeed: np.ndarray
    pressure: np.ndarray
    force: np.ndarray
    thrust: np.ndarray | None
    tracks: dict[str, Track]
    exact: bool
    kinematic: np.ndarray | None
    noise: Mapping[str, tuple[float, float]]
    record: AircraftRecord
    remarks: Sequence[str]

    @property
    def step_s(self) -> float:
        """Length of a step [s]."""
        return float(self.ends_s[1] - self.ends_s[0])

    def mean(
        self, name: str, steps: np.ndarray, shift_s: float = 0.0, lag_s: float = 0.0
    ) -> np.ndarray:
        """Return the means of a track over steps, which follow each other in each row."""
        ends_s = self.ends_s[np.concatenate([steps, steps[..., -1:] + 1], axis=-1)]
        return self.tracks[name].behind(lag_s).means(ends_s, shift_s)

    def with_noisier_probes(self) -> "LogSignals":
        """Return the same with as much noise again on the probes of the angles."""
        rng, tracks = np.random.default_rng(1), dict(self.tracks)
        for name, (size, step_s) in self.noise.items():
            time_s, integral = tracks[name].time_s, tracks[name].integral
            at_s = np.arange(time_s[0], time_s[-1] + step_s, step_s)
            more = np.interp(time_s, at_s, size * rng.standard_normal(len(at_s)))
            tracks[name] = Track(time_s, integral + _track(time_s, more).integral)
        return replace(self, tracks=tracks)


class _Reader(FlightSignals):
    """A log on fine steps, with notes of what it lacks."""

    def __init__(self, flight: FlightTable, aircraft: Aircraft, time_s: np.ndarray) -> None:
        super().__init__(flight, time_s)
        self.aircraft, self.remarks = aircraft, list[str]()

    def air(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]:
        """Return true airspeed, dynamic pressure, α, β, and whether vanes measured the angles."""
        rho, measured = self.aircraft.air_density_kg_m3, self.flight.airspeed
        ground, wind = self.ground(), self.wind()
        V = q = None
        if measured is not None:
            density = rho if measured.name == "V" else _SEA_LEVEL_KG_M3
            q = 0.5 * density * np.maximum(measured.at(self.time_s), 0.0) ** 2
            V = np.sqrt(2.0 * q / rho)
            if self.has("angle_of_attack", "sideslip"):
                return V, q, self.of("angle_of_attack"), self.of("sideslip"), True
            if ground is not None and wind is None:
                wind = self._fitting_wind(V)
        if ground is None or wind is None:
            if V is None:
                text = f"{self.flight.title} has no airspeed, and no wind by which it could be"
                hint = "identification needs V, indicated_airspeed, or a wind estimate"
                raise BadInput(f"{text} known", hint)
            text = f"{self.flight.title} has no angle_of_attack and sideslip, and no attitude and "
            raise BadInput(f"{text}velocity by which they could be known")
        through = ground - wind
        alpha, beta = angles_of(through)
        if V is None or q is None or self.flight.kind == "recording":
            V = np.linalg.norm(through, axis=1)
            q = 0.5 * rho * V**2
        if not self.has("wind_u"):
            self.remarks.append(
                "no vanes: angles of attack and sideslip are of the velocity less a steady wind, so"
                " that gusts are not in them, and what they do counts as noise"
            )
        return V, q, alpha, beta, False

    def _fitting_wind(self, V: np.ndarray) -> np.ndarray:
        """Return the steady wind that fits an airspeed, body axes, shape (n, 3)."""
        north, east = self.steady_wind(V, _SLOWEST * self.aircraft.airspeed_min_m_s)
        text = f"a steady wind of {north:.1f} m/s to the north and {east:.1f} m/s to the east"
        self.remarks.append(f"no wind in the log: {text} fits the airspeed best")
        assert self.rotation is not None
        return np.asarray(np.einsum("nij,i->nj", self.rotation[:, :2], np.array([north, east])))

    def force(self, omega: np.ndarray) -> np.ndarray:
        """Return the specific force, shape (n, 3): v̇ + ω × v - g where it is not measured."""
        if self.has(*names.FORCE):
            return self.columns(names.FORCE)
        ground = self.ground()
        if ground is None or self.rotation is None:
            text = f"{self.flight.title} has no specific_force, and no velocity and attitude from"
            raise BadInput(f"{text} which it could be known")
        slope = np.gradient(ground, self.time_s, axis=0)
        gravity = self.aircraft.gravity_m_s2 * self.rotation[:, 2, :]
        return np.asarray(slope + np.cross(omega, ground) - gravity)

    def surface(self, name: str, stops: tuple[float, float]) -> np.ndarray:
        """Return a deflection [rad]: where it was, else the command, shape (n,)."""
        if self.has(f"applied_{name}"):
            return self.of(f"applied_{name}")
        if (sent := command_in(self.flight, name, self.aircraft)) is not None:
            return sent.at(self.time_s)
        if not np.any(stops):
            return np.zeros(len(self.time_s))
        raise BadInput(
            f"{self.flight.title} has no {name}: expected held_{name} [rad] or share_{name}",
            "as by a column map, or name the surface `none` in the aircraft's file",
        )

    def thrust(self, V: np.ndarray, record: AircraftRecord) -> np.ndarray | None:
        """Return the thrust as the aircraft's file has it [N], shape (n,)."""
        if self.has("applied_throttle") or self.has("held_throttle"):
            return self.of("applied_throttle", "held_throttle")
        if not self.has("share_throttle"):
            self.remarks.append("no throttle: thrust, and with it drag, does not show")
            return None
        rows, most = record["thrust_rows"], record["thrust_limit"]
        if rows:  # as of `sitl_plant.airframe.thrust`, which is of one airspeed
            by = record["thrust_airspeeds"][:rows], record["thrust_most"][:rows]
            most = np.minimum(np.interp(V, *by), most)
        return np.asarray(self.of("share_throttle") * most)


def log_signals(flight: FlightTable, aircraft: Aircraft) -> LogSignals:
    """Return what identification needs of a log.

    Args:
        flight: The log.
        aircraft: The aircraft as it is known so far: size, mass, stops and thrust.

    Raises:
        BadInput: It lacks something, and what.
    """
    fine_s, every = _steps(flight)
    reader, record = _Reader(flight, aircraft, fine_s), aircraft_record(aircraft)
    J = np.array(record["J"])
    omega = reader.columns(names.RATES)
    V, pressure, alpha, beta, by_vanes = reader.air()
    force = reader.force(omega)
    moving = {
        part: reader.surface(name, stops)
        for part, name, stops in zip(("da", "de", "dr"), SURFACES, aircraft.stops_deg, strict=True)
    }
    moving |= {"alpha": alpha, "beta": beta}
    pull = reader.thrust(V, record)
    thrust = np.zeros(len(V)) if pull is None else pull
    known = np.isfinite(np.column_stack([omega, V, force, thrust, *moving.values()])).all(axis=1)
    known &= np.nan_to_num(V) > _SLOWEST * aircraft.airspeed_min_m_s
    exact = flight.kind == "recording" and flight["p"].step_s <= _FINE_S
    kinematic = _kinematic(reader, V, alpha, beta, omega, force) if by_vanes else None
    ends = slice(None, (len(fine_s) - 1) // every * every + 1, every)
    held = flight.kind != "recording"
    tracks = {
        name: _track(fine_s, values, held=held and name[0] == "d")
        for name, values in moving.items()
    }

    def mean(values: np.ndarray) -> np.ndarray:
        columns = values.T if values.ndim == 2 else [values]
        found = [_track(fine_s, one).means(fine_s[ends]) for one in columns]
        return np.stack(found, axis=1) if values.ndim == 2 else found[0]

    unknown = np.concatenate([[0], np.cumsum(~known)])
    edges = np.arange(len(fine_s))[ends]
    return LogSignals(
        ends_s=fine_s[ends],
        good=unknown[edges[1:] + 1] == unknown[edges[:-1]],
        rates=omega[ends],
        mean_rates=mean(omega),
        gyroscopic=mean(np.cross(omega, omega @ J)),
        airspeed=np.maximum(mean(V), _STILL_M_S),
        pressure=mean(pressure),
        force=mean(force),
        thrust=None if pull is None else mean(thrust),
        tracks=tracks,
        exact=exact,
        kinematic=None if kinematic is None else mean(kinematic),
        noise=_probe_noise(flight) if by_vanes else {},
        record=record,
        remarks=reader.remarks,
    )


def _steps(flight: FlightTable) -> tuple[np.ndarray, int]:
    """Return fine steps as of the fastest channel, and how many of them make a step."""
    if not flight.has(names.RATES):
        missing = ", ".join(name for name in names.RATES if name not in flight)
        raise BadInput(f"{flight.title} has no {missing}: moments are known by rates alone")
    rates = [flight[name] for name in names.RATES]
    renewed = max(min(one.rate_hz, one.renewed_hz) for one in rates)
    if renewed < LEAST_HZ:
        text = f"p, q, r of {flight.title} are renewed {renewed:.2g} times a second"
        raise BadInput(f"{text}, expected {LEAST_HZ:g} or more")
    step_s = max(1.0 / _MOST_HZ, rates[0].step_s)
    every = max(math.ceil(step_s / min(_FINE_S, *(one.step_s for one in rates)) - 1e-6), 1)
    rate = every / step_s
    return flight.grid(rate, names.RATES), every


def _probe_noise(flight: FlightTable) -> dict[str, tuple[float, float]]:
    """Return the noise of probes from third differences, which smooth motion has little of."""
    channels = {"alpha": flight["angle_of_attack"], "beta": flight["sideslip"]}
    return {
        name: (float(np.median(np.abs(np.diff(one.values, 3)))) / _OF_THIRD, one.step_s)
        for name, one in channels.items()
    }


def _track(time_s: np.ndarray, values: np.ndarray, *, held: bool = False) -> Track:
    """Return the integral of a signal, by trapezoids; of a command, which holds, by rectangles."""
    values = np.nan_to_num(values)
    over = values[:-1] if held else 0.5 * (values[1:] + values[:-1])
    return Track(time_s, np.concatenate([[0.0], np.cumsum(over * np.diff(time_s))]))


def _kinematic(
    reader: _Reader,
    V: np.ndarray,
    alpha: np.ndarray,
    beta: np.ndarray,
    omega: np.ndarray,
    force: np.ndarray,
) -> np.ndarray:
    """Return ẇ and v̇ of the rigid body in steady wind, NaN without an attitude, shape (n, 2)."""
    if reader.rotation is None:
        return np.full((len(V), 2), np.nan)
    down = reader.aircraft.gravity_m_s2 * reader.rotation[:, 2, :]
    u, v, w = V * np.cos(alpha) * np.cos(beta), V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    p, q, r = omega.T
    w_dot = force[:, 2] + down[:, 2] + q * u - p * v
    v_dot = force[:, 1] + down[:, 1] - r * u + p * w
    return np.stack([w_dot, v_dot], axis=1)
