"""Relations of a log with commands to the actuators, by a model of the aircraft.

It measures as the diagnosis in flight does (`ftc_autopilot.control.diagnosis`): by Euler's
equation the surfaces' moment is C δ = J ω̇ + ω × Jω - N, and C is square, so each surface has a
measurement of what it does; the thrust's follows from V̇. Here it is the mean over 0.2 s between two
samples, and so is the command beside it. What it lacks of the command is regressed on the command:
a model that is somewhat wrong is corrected while the flight is healthy, within seconds.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ftc_autopilot.control.inversion import inversion_problem
from ftc_lab.flight_diagnosis.relations import (
    LearningPace,
    Relation,
    Relations,
    Surface,
    before,
    only_while,
)
from ftc_lab.flight_signals import FlightSignals, MissingError, command_in, held_mean, to_ned
from gcs.console.errors import BadInput
from gcs.results.logs import names
from gcs.results.logs.table import FlightTable, channel
from gcs.results.store import EVENTS
from gcs.results.ulog_export import sent_in
from mavlink_defs.constants import ACTUATORS, THROTTLE
from sitl_plant.airframe.aerodynamics import Aerodynamics, aerodynamics
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft

_SPAN_S = 0.2  # over which moments and commands are averaged
_LEAST_DEG, _LEAST_SHARE = 0.1, 0.01  # of a surface; of the thrust limit
BY_MODEL = LearningPace(
    kind="model",
    rate_hz=25.0,
    lag_s=_SPAN_S / 2.0,
    guard_s=2.0,
    least_learnt_s=0.8,
    least_measured_s=1.2,
    block_s=0.4,
    named_s=0.6,
    windows_s={"response": (0.4, 0.8, 1.6), "shift": (), "drop": ()},
)
SURFACE_OF: dict[str, Surface] = {
    "aileron": "aileron",
    "elevator": "elevator",
    "rudder": "rudder",
    "throttle": "engine",
}


def flown_run(run: Path, flight: FlightTable, uav: int | None) -> FlightTable:
    """Return a flight of our own with every command that was sent, between recorded steps, too.

    Args:
        run: The run folder.
        flight: What was read of it.
        uav: System id; None: the first one.
    """
    sent = sent_in(run) if (run / EVENTS).exists() else {}
    time_s, channel_of, value = sent.get(uav or min(sent, default=0), (np.empty(0),) * 3)
    held = (
        channel(f"held_{name}", time_s[channel_of == j], value[channel_of == j], EVENTS)
        for j, name in enumerate(ACTUATORS)
    )
    found = {one.name: one for one in held if one is not None}
    return replace(flight, channels={**flight.channels, **found})


def relations_by_model(flight: FlightTable, aircraft: Aircraft) -> Relations:
    """Return the relations that a log shows, given the aircraft.

    Raises:
        BadInput: It lacks what they are made of, or the aircraft has no inverse.
    """
    if (problem := inversion_problem(aircraft, needs_rudder=False)) is not None:
        raise BadInput(f"cannot diagnose by this aircraft: {problem}")
    signals = FlightSignals.renewed(flight, BY_MODEL.rate_hz)
    try:
        v, attitude, omega = _motion(signals)
        commanded = np.stack([_command(signals, name, aircraft) for name in ACTUATORS], axis=1)
    except MissingError as missing:
        raise BadInput(
            f"{flight.title} cannot be diagnosed by a model: {missing}", "leave out --aircraft"
        ) from None
    done = _done(v, attitude, omega, commanded, aircraft)
    made = [
        Relation(
            surface=SURFACE_OF[name],
            text=f"{'thrust' if j == THROTTLE else 'deflection'} made less commanded",
            unit="N" if j == THROTTLE else "rad",
            measured=done[:, j] - commanded[:, j],
            terms=np.stack([np.ones(len(done)), commanded[:, j]], axis=1),
            test="response",
            pace=BY_MODEL,
            response=commanded[:, j],
            least=_LEAST_SHARE * aircraft.thrust_limit_n
            if j == THROTTLE
            else np.radians(_LEAST_DEG),
        )
        for j, name in enumerate(ACTUATORS)
        if name != "rudder" or aircraft.has("rudder")
    ]
    return Relations(signals.time_s, only_while(signals.flying(), made), ())


def _motion(signals: FlightSignals) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return velocity through the air [m/s], attitude [rad], rates [rad/s], each shape (n, 3)."""
    attitude, omega = signals.columns(names.ATTITUDE), signals.columns(names.RATES)
    ground, wind = signals.ground(), signals.wind()
    if ground is None or wind is None:
        raise MissingError(f"the log has no {'velocity' if ground is None else 'wind'}")
    return ground - wind, attitude, omega


def _command(signals: FlightSignals, name: str, aircraft: Aircraft) -> np.ndarray:
    """Return the mean command over the last span [rad or N], shape (n,)."""
    sent = command_in(signals.flight, name, aircraft)
    if sent is None:
        raise MissingError(f"the log has no held_{name} or share_{name}")
    return held_mean(sent, signals.time_s, _SPAN_S)


def _done(
    v: np.ndarray,
    attitude: np.ndarray,
    omega: np.ndarray,
    commanded: np.ndarray,
    aircraft: Aircraft,
) -> np.ndarray:
    """Return what the actuators did over the last span [rad, N], shape (n, 4)."""
    record = aircraft_record(aircraft)
    J, mass = np.array(record["J"]), aircraft.mass_kg
    known = np.isfinite(v).all(axis=1) & np.isfinite(omega).all(axis=1) & (v[:, 0] > 0.0)
    air = [
        aerodynamics(tuple(v[k].tolist()), tuple(omega[k].tolist()), record) if known[k] else None
        for k in range(len(v))
    ]
    N, F, C = (_stacked(air, name) for name in ("N", "F", "C"))
    V = np.linalg.norm(v, axis=1)
    steps = BY_MODEL.steps(_SPAN_S)
    turning = (omega - before(omega, steps)) / _SPAN_S @ J.T
    inner = _over_span(np.cross(omega, omega @ J.T) - N)
    inner -= commanded[:, THROTTLE:] * np.array(record["thrust_arms"])
    C = _over_span(C.reshape(-1, 9)).reshape(-1, 3, 3)
    surfaces = np.full((len(v), 3), np.nan)
    good = np.isfinite(C).all(axis=(1, 2))
    n = 3 if aircraft.has("rudder") else 2  # without one, yaw is nobody's
    moment = (turning + inner)[good][:, :n, None]
    surfaces[good, :n] = np.linalg.solve(C[good][:, :n, :n], moment)[:, :, 0]
    gravity = to_ned(attitude)[:, 2, :] * aircraft.gravity_m_s2
    along = (v * (F + mass * gravity)).sum(axis=1) / V
    thrust = mass * (V - before(V, steps)) / _SPAN_S - _over_span(along)
    return np.column_stack([surfaces, thrust * _over_span(V / v[:, 0])])


def _stacked(air: list[Aerodynamics | None], name: str) -> np.ndarray:
    example = next((one for one in air if one is not None), None)
    unknown = np.full(np.shape(getattr(example, name, (0.0, 0.0, 0.0))), np.nan)
    return np.array([unknown if one is None else getattr(one, name) for one in air])


def _over_span(values: np.ndarray) -> np.ndarray:
    """Return means over the last span, by trapezoids; NaN at first."""
    steps = BY_MODEL.steps(_SPAN_S)
    halves = 0.5 * (values + before(values, 1))
    total = sum(before(halves, k) for k in range(steps))
    return np.asarray(total) / steps
