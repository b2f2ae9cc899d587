"""What failed in a log, since when, and by how much: a fault as scenarios have them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ftc_lab.flight_diagnosis.by_model import SURFACE_OF, relations_by_model
from ftc_lab.flight_diagnosis.decisions import diagnose_flight, learnt, watch
from ftc_lab.flight_diagnosis.relations import relations_of
from ftc_lab.flight_signals import FlightSignals, MissingError, command_in
from gcs.console.errors import BadInput
from gcs.results.logs.table import FlightTable, channel
from mavlink_defs.constants import ACTUATORS
from sitl_plant.airframe.config import Aircraft

_BEFORE_S, _AFTER_S = 10.0, 5.0  # from which the value is known: healthy, and faulty
_SETTLED_S = 0.3  # after the latest onset: means are over less
_BETTER = 0.8  # of what a simpler fault leaves: it is another one
_SLOWEST = 0.8  # of the lowest airspeed command
_LEAST_GAIN = 0.3  # of the healthy response to a command, that says how wrong a model is


@dataclass(frozen=True)
class FoundFault:
    """A fault that a log shows.

    Attributes:
        actuator: What failed.
        onset_s: Since when, most likely.
        between_s: The same, between which times.
        alarm_s: When it is sure.
        values: Keys of a fault of a scenario, as in {"stuck_deg": 4.0}.
        unexplained: Share of what the actuator did, standard deviation, that the value leaves.
        at_s: Over which times the value was measured.
    """

    actuator: str
    onset_s: float
    between_s: tuple[float, float]
    alarm_s: float
    values: Mapping[str, float]
    unexplained: float
    at_s: tuple[float, float]

    def __str__(self) -> str:
        """Return what it is, for people."""
        return f"{self.actuator}, " + ", ".join(
            f"{key} {one:g}" for key, one in self.values.items()
        )


def with_wind(flight: FlightTable, aircraft: Aircraft) -> tuple[FlightTable, str]:
    """Return a log that has a wind: its own, else the steady one that fits the airspeeds best.

    Args:
        flight: The log.
        aircraft: The aircraft.

    Returns:
        The log, and what its wind is, for people.

    Raises:
        BadInput: It has no airspeed, velocity or attitude.
    """
    if flight.has(("wind_u", "wind_v", "wind_w")) or flight.has(("wind_north", "wind_east")):
        return flight, "the wind is the log's"
    signals = FlightSignals(flight, flight.grid(10.0))
    try:
        airspeed = signals.airspeed()
    except MissingError:
        text = f"{flight.title} has no airspeed and no wind"
        raise BadInput(text, "either is needed to fly it again") from None
    north, east = signals.steady_wind(airspeed, _SLOWEST * aircraft.airspeed_min_m_s)
    ends = np.array([flight.begin_s, flight.end_s])
    found = {
        name: channel(name, ends, np.full(2, value), "fits the airspeeds", unit="m/s")
        for name, value in (("wind_north", north), ("wind_east", east))
    }
    channels = {**flight.channels, **{name: one for name, one in found.items() if one is not None}}
    text = f"the wind is a steady one that fits the airspeeds: {north:.1f} m/s to the north"
    return replace(flight, channels=channels), f"{text} and {east:.1f} m/s to the east, no gusts"


def check_commands(flight: FlightTable, aircraft: Aircraft) -> None:
    """Refuse a log without commands, and say what it shows.

    Raises:
        BadInput: A command is missing.
    """
    lacks = [
        name
        for name in ACTUATORS
        if command_in(flight, name, aircraft) is None and (name != "rudder" or aircraft.has(name))
    ]
    if not lacks:
        return
    try:
        relations = relations_of(flight)
        watched = watch(relations)
        finding = (
            diagnose_flight(relations, watched, learnt(relations)).finding if watched else None
        )
        shows = "shows no failure"
        if finding is not None:
            shows = f"shows that the {finding.surface} failed at {finding.onset_s:.1f} s"
    except BadInput as problem:
        shows = f"cannot be judged either: {problem}"
    raise BadInput(
        f"{flight.title} cannot be flown again: it has no commands of {', '.join(lacks)}; what it "
        f"has {shows}",
        f"held_{lacks[0]} or share_{lacks[0]} is needed, as by a column map; `gcs diagnose` says "
        "more of what it shows",
    )


def fault_of(flight: FlightTable, aircraft: Aircraft) -> FoundFault | None:
    """Return the fault that a log shows by a model; None if it shows none.

    Args:
        flight: The log, with commands and a wind.
        aircraft: The model.

    Raises:
        BadInput: It cannot be judged.
    """
    relations = relations_by_model(flight, aircraft)
    watched = watch(relations)
    if not watched:
        raise BadInput(f"{flight.title} is too short: some 5 s are needed to learn what is healthy")
    finding = diagnose_flight(relations, watched, learnt(relations)).finding
    if finding is None:
        return None
    actuator = next(name for name, surface in SURFACE_OF.items() if surface == finding.surface)
    relation = watched[finding.surface].relation
    assert relation.response is not None
    did, sent, t = relation.measured + relation.response, relation.response, relations.time_s
    known = np.isfinite(did) & np.isfinite(sent)
    healthy = known & (t > finding.between_s[0] - _BEFORE_S) & (t < finding.between_s[0])
    begin = finding.between_s[1] + _SETTLED_S
    faulty = known & (t >= begin) & (t <= begin + _AFTER_S)
    if np.count_nonzero(faulty) < 3:
        raise BadInput(
            f"{flight.title} ends {t[-1] - finding.onset_s:.1f} s after the {finding.surface} "
            "failed: too soon to say how"
        )
    offset, gain = _healthy(did[healthy], sent[healthy])
    values, left = _values((did[faulty] - offset) / gain, sent[faulty], actuator, aircraft)
    return FoundFault(
        actuator,
        finding.onset_s,
        finding.between_s,
        finding.alarm_s,
        values,
        left,
        (float(t[faulty][0]), float(t[faulty][-1])),
    )


def _healthy(did: np.ndarray, sent: np.ndarray) -> tuple[float, float]:
    """Return what a model gives a healthy actuator beside its command: an offset, and a gain."""
    if len(did) < 3:
        return 0.0, 1.0
    if np.std(sent) < 1e-9:
        return float(np.mean(did - sent)), 1.0
    gain, offset = np.polyfit(sent, did, 1).tolist()
    if not _LEAST_GAIN < gain < 1.0 / _LEAST_GAIN:
        return float(np.mean(did - sent)), 1.0
    return offset, gain


def _values(
    did: np.ndarray, sent: np.ndarray, actuator: str, aircraft: Aircraft
) -> tuple[dict[str, float], float]:
    """Return the fault that explains best what an actuator did, and the share that is left."""
    share = float(np.clip(sent @ did / max(float(sent @ sent), 1e-12), 0.0, 1.0))
    bias, stuck = float(np.mean(did - sent)), float(np.mean(did))
    slope, offset = 0.0, stuck
    if np.std(sent) > 1e-9:
        slope = float(np.clip(np.polyfit(sent, did, 1)[0], 0.0, 1.0))
        offset = float(np.mean(did - slope * sent))
    tried: list[tuple[tuple[float, float], dict[str, float]]] = [
        ((share, 0.0), {"effectiveness": share}),
        ((1.0, bias), {"bias": bias}),
        ((0.0, stuck), {"stuck": stuck}),
    ]
    if slope > 0.0:
        tried.append(((slope, offset), {"effectiveness": slope, "bias": offset}))
    keys, rest = dict[str, float](), np.inf
    for line, found_keys in tried:  # a command that hardly moves shows no difference
        if (left := _rms(did, *line, sent)) < _BETTER * rest:
            keys, rest = found_keys, left
    of_thrust = actuator == "throttle"
    unit, size = ("n", 1.0) if of_thrust else ("deg", 180.0 / np.pi)
    low, high = (
        (0.0, aircraft.thrust_limit_n)
        if of_thrust
        else aircraft.stops_deg[ACTUATORS.index(actuator)]
    )
    found = {}
    for key, value in keys.items():
        if key == "effectiveness":
            found[key] = round(value, 3)
        else:
            least = low if key == "stuck" else low - high
            found[f"{key}_{unit}"] = round(float(np.clip(value * size, least, high)), 2)
    return found, rest / max(float(np.std(did - sent)), float(np.mean(np.abs(did - sent))), 1e-9)


def _rms(did: np.ndarray, slope: float, offset: float, sent: np.ndarray) -> float:
    return float(np.sqrt(np.mean((did - slope * sent - offset) ** 2)))
