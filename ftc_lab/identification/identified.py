"""An aircraft made of what was identified, and what is to be said of it."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pydantic import ValidationError

from ftc_autopilot.control.airframe_checks import AirframeCheck, airframe_checks
from ftc_lab.design.answers import answers_of, laws_of, sentences_of
from ftc_lab.identification.experiment import experiment, stall_of
from ftc_lab.identification.fit import CoefficientEstimate, Fit, fit
from ftc_lab.identification.log_fit import LogPrediction
from ftc_lab.identification.readings import windows_of
from ftc_lab.identification.segments import LogSegment
from ftc_lab.identification.trim import SimulatorTrim, trim
from gcs.console.errors import BadInput
from mavlink_defs.config.files import problems_of
from mavlink_defs.config.quantity import describe
from mavlink_defs.config.yaml_text import yaml_of
from mavlink_defs.constants import SURFACES
from sitl_plant.airframe.config import TERMS, Aircraft, Coefficients
from sitl_plant.airframe.level_flight import LevelFlight, level_flight
from sitl_plant.simulators.base import Body, Simulator

FORCES = {
    "cL": "lift",
    "cD": "drag",
    "cY": "side force",
    "cl": "rolling moment",
    "cm": "pitching moment",
    "cn": "yawing moment",
}
TIME_NAMES = {
    "delay": "delay of all surfaces",
    "da": "lag of the aileron",
    "de": "lag of the elevator",
    "dr": "lag of the rudder",
    **{axis: f"air, on the {name}" for axis, name in FORCES.items()},
}
"""Times by which a log is behind, as people call them."""
MOMENTS = ("cl", "cm", "cn")
SET_BY_TRIM = {name for terms in TERMS.values() for name, of in terms.items() if of == "1"}
"""Coefficients that are shifted so that the model trims where the plant does."""
WELL_EXPLAINED = 0.05
"""Share of a moment that may be left over, of a simulator or a recording of ours."""
WELL_PREDICTED = 0.7
"""R² with which one half of a log should predict the other."""
_THRUST_SHARE = 0.4  # of the weight, where no limit is given
_MIN_AIRSPEED, _MAX_AIRSPEED = 1.2, 1.3  # of the stall, of the cruise
_MIN_OF_CRUISE = 0.65  # where there is no stall
_DIGITS, _NOTHING = 6, 1e-7  # of a number that is written


@dataclass(frozen=True)
class LogEvidence:
    """What a log was identified from, and how far it goes.

    Attributes:
        segments: Stretches of flight in which surfaces move.
        shifts_s: How much later than the log says surfaces act, and forces and moments answer to
            the air, by `TIME_NAMES`; empty of a recording of ours.
        predictions: How well one half predicts the other, by "cL", ...
        remarks: What the log does not show or tell apart, each a sentence.
    """

    segments: Sequence[LogSegment]
    shifts_s: Mapping[str, float]
    predictions: Mapping[str, LogPrediction]
    remarks: Sequence[str]


@dataclass(frozen=True)
class Identified:
    """What was identified.

    Attributes:
        aircraft: The nominal aircraft.
        fit: Its coefficients with their intervals, before the shift.
        flight: Level flight of the aircraft at the cruising speed.
        level: Level flight of the plant there; None of a log.
        checks: What laws take for granted of an aircraft.
        evidence: What a log shows; None of a simulator.
    """

    aircraft: Aircraft
    fit: Fit
    flight: LevelFlight
    level: SimulatorTrim | None
    checks: list[AirframeCheck]
    evidence: LogEvidence | None = None

    @cached_property
    def answers(self) -> dict[str, str | None]:
        """Why `gcs design` refuses the aircraft, by law; None where it does not."""
        return answers_of(self.aircraft)


@dataclass(frozen=True)
class Choices:
    """What a simulator does not say.

    Attributes:
        cruise: Airspeed [m/s].
        altitude: Where [m].
        thrust_limit: [N]; None: 0.4 of the weight.
        airspeed_min: [m/s]; None: 1.2 times the stall's.
        airspeed_max: [m/s]; None: 1.3 times the cruise.
        seed: Of the experiment.
        source: Where the numbers are from.
    """

    cruise: float
    altitude: float = 0.0
    thrust_limit: float | None = None
    airspeed_min: float | None = None
    airspeed_max: float | None = None
    seed: int = 1
    source: str = ""


def identify(
    simulator: Simulator,
    choices: Choices,
    on_progress: Callable[[int, int], None] = lambda *_: None,
) -> Identified:
    """Identify the aircraft of a simulator about level flight.

    Args:
        simulator: What flies; it is only reset, controlled and read.
        choices: What it does not say.
        on_progress: Called with the segments flown, and all of them.

    Raises:
        BadInput: It cannot be trimmed there, or is nothing that our equations could be.
    """
    level = trim(simulator, choices.cruise, choices.altitude)
    stall = stall_of(simulator, level, choices.altitude)
    readings = experiment(
        simulator,
        level,
        choices.seed,
        altitude=choices.altitude,
        stall=stall,
        on_progress=on_progress,
    )
    found = fit(windows_of(readings, simulator.body))
    values = {name: one.value for name, one in found.estimates.items()}
    values |= constants_at(level, simulator.body, values)
    aircraft = _aircraft(simulator, choices, level, stall, values)
    return finished(aircraft, found, choices.cruise, level)


def finished(
    aircraft: Aircraft, found: Fit, cruise: float, level: SimulatorTrim | None
) -> Identified:
    """Return an identified aircraft with its level flight and its checks.

    Raises:
        BadInput: It has no level flight.
    """
    flight = level_flight(aircraft, cruise)
    if flight is None:
        text = f"the aircraft identified has no straight, level flight at {cruise:g} m/s"
        raise BadInput(text, "choose another --cruise")
    return Identified(aircraft, found, flight, level, airframe_checks(aircraft, flight))


def constants_at(level: SimulatorTrim, body: Body, values: dict[str, float]) -> dict[str, float]:
    """Return the constant coefficients with which a model trims as the plant does."""
    qS = 0.5 * body.air_density_kg_m3 * level.airspeed**2 * body.wing_area_m2
    x, y, z = (body.mass_kg * part for part in level.specific_force)
    x -= level.thrust
    sa, ca = math.sin(level.alpha), math.cos(level.alpha)
    measured = {"cL": (x * sa - z * ca) / qS, "cD": -(x * ca + z * sa) / qS, "cY": y / qS}
    da, de, dr = level.delta
    alpha = level.alpha
    at = {"alpha": alpha, "alpha2": alpha**2, "da": da, "de": de, "de2": de**2, "dr": dr}
    constants = {}
    for axis, terms in TERMS.items():
        rest = sum(values[name] * at.get(of, 0.0) for name, of in terms.items() if of != "1")
        (constant,) = (name for name, of in terms.items() if of == "1")
        constants[constant] = within_bounds(constant, measured.get(axis, 0.0) - rest)
    return constants


def within_bounds(name: str, value: float) -> float:
    """Return a coefficient, or the least that an aircraft may have."""
    declared = describe(Coefficients.model_fields[name])
    least = None if declared is None else declared.ge
    return value if least is None else max(value, least)


def _lift(alpha: float, values: dict[str, float]) -> float:
    """Return the lift coefficient at α [rad], of coefficients."""
    at = {"1": 1.0, "alpha": alpha}
    return sum(values[name] * at.get(of, 0.0) for name, of in TERMS["cL"].items())


def _aircraft(
    simulator: Simulator,
    choices: Choices,
    level: SimulatorTrim,
    stall: float | None,
    values: dict[str, float],
) -> Aircraft:
    body, V = simulator.body, choices.cruise
    limit = choices.thrust_limit or _THRUST_SHARE * body.mass_kg * level.gravity
    slowest = _MIN_OF_CRUISE * V
    if stall is not None:
        qS = 0.5 * body.air_density_kg_m3 * V**2 * body.wing_area_m2
        needed, most = body.mass_kg * level.gravity / qS, _lift(stall, values)
        slowest = _MIN_AIRSPEED * V * math.sqrt(needed / most) if most > needed else 0.9 * V
    tree: dict[str, Any] = {
        "source": choices.source,
        "mass_kg": _short(body.mass_kg),
        "wing_area_m2": _short(body.wing_area_m2),
        "wing_span_m": _short(body.wing_span_m),
        "mean_chord_m": _short(body.mean_chord_m),
        "air_density_kg_m3": _short(body.air_density_kg_m3),
        "gravity_m_s2": level.gravity,
        "inertia_kg_m2": {name: _short(J) for name, J in body.inertia_kg_m2.model_dump().items()},
        "any_inertia": not body.inertia_kg_m2.of_rigid_body,
        "coefficients": {name: _short(value) for name, value in values.items()},
        "stall_deg": None if stall is None else round(math.degrees(stall), 1),
        "thrust_limit_n": float(f"{limit:.4g}"),
        "surface_limits_deg": _stops_deg(simulator),
        "airspeed_min_m_s": choices.airspeed_min or float(f"{min(slowest, 0.9 * V):.3g}"),
        "airspeed_max_m_s": choices.airspeed_max or float(f"{_MAX_AIRSPEED * V:.3g}"),
        "cruise_m_s": V,
    }
    try:
        return Aircraft.model_validate(tree)
    except ValidationError as problem:
        lines = "; ".join(str(line) for line in problems_of(Aircraft, problem))
        raise BadInput(f"what was identified is no aircraft: {lines}") from problem


def _stops_deg(simulator: Simulator) -> dict[str, Any]:
    """Return the stops of each surface [deg], as an aircraft file has them."""
    found: dict[str, Any] = {}
    for name, stops in zip(SURFACES, simulator.stops, strict=True):
        low, high = (round(math.degrees(stop), 2) for stop in stops)
        if low == high:
            found[name] = "none"
        else:
            found[name] = high if low == -high else [low, high]
    return found


def _short(value: float) -> float:
    return 0.0 if abs(value) < _NOTHING else float(f"{value:.{_DIGITS}g}")


def verdict(identified: Identified) -> list[str]:
    """Return sentences: how well the aircraft is known, and what `gcs design` says of it."""
    unmet = [check for check in identified.checks if not check.is_met]
    lines = [f"{check.name}: {check.value}: {check.otherwise}" for check in unmet]
    evidence = identified.evidence
    for axis in MOMENTS if evidence is None or not evidence.shifts_s else ():
        share = identified.fit.residuals[axis].share
        if share > WELL_EXPLAINED:
            lines.append(
                f"{share:.0%} of the {FORCES[axis]} is not explained, expected at most "
                f"{WELL_EXPLAINED:.0%}: the laws, which invert it, will be less exact"
            )
    kept = [name for name, one in identified.fit.estimates.items() if one.is_nominal]
    if kept:
        lines.append(
            f"the flight does not show {', '.join(kept)}: they stay at their nominal values"
        )
    if evidence is not None:
        lines += [*_doubts(evidence), *evidence.remarks]
    designed = sentences_of(identified.answers)
    if not lines and len(laws_of(identified.answers)) == len(identified.answers):
        return [f"nothing speaks against it: {designed[0]}"]
    return [*lines, *designed]


def _doubts(evidence: LogEvidence) -> Iterator[str]:
    """Yield what one half of a flight does not predict of the other."""
    for axis, one in evidence.predictions.items():
        for well, what in ((one.coefficient, FORCES[axis]), (one.rate, f"rate by {FORCES[axis]}")):
            if well is not None and not well >= WELL_PREDICTED:
                yield (
                    f"one half of the flight predicts {max(well, 0.0):.0%} of the {what} in the "
                    f"other, expected {WELL_PREDICTED:.0%}: gusts, noise, or another form of model"
                )


def text_of(identified: Identified, command: str) -> str:
    """Return the aircraft as YAML, coefficients with their intervals.

    Args:
        identified: What was identified.
        command: What was asked for, for its first line.
    """
    flight, residuals = identified.flight, identified.fit.residuals
    shown = {
        axis: name
        for axis, name in FORCES.items()
        if residuals[axis].share == residuals[axis].share
    }
    shares = ", ".join(f"{name} {residuals[axis].share:.1%}" for axis, name in shown.items())
    head = [
        f"# Written by: {command}",
        "#",
        f"# Level flight at {flight.airspeed_m_s:g} m/s: angle of attack {flight.alpha_deg:.2f} "
        f"deg, thrust {flight.thrust_n:.4g} N.",
        f"# Not explained of {shares}.",
        "# Intervals hold the true value in 95 of 100 experiments, if the plant is of our form.",
        *(f"# {line}" for line in verdict(identified)),
        "",
    ]
    tree = identified.aircraft.model_dump(exclude_none=True)
    if not tree["any_inertia"]:
        del tree["any_inertia"]
    del tree["coefficients"]
    lines = yaml_of({key: tree.pop(key) for key in ("source", "mass_kg")}).splitlines()
    lines += yaml_of(tree).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("rate_derivatives"))
    lines[at:at] = ["coefficients:", *_coefficients(identified)]
    return "\n".join([*head, *lines]) + "\n"


def _coefficients(identified: Identified) -> list[str]:
    values = identified.aircraft.coefficients.model_dump()
    return [
        f"  {name}: {values[name]!r} # {_remark(name, one, identified.level is not None)}"
        for name, one in identified.fit.estimates.items()
    ]


def _remark(name: str, one: CoefficientEstimate, is_trimmed: bool) -> str:
    if is_trimmed and name in SET_BY_TRIM:
        return "so that it trims where the plant does"
    if one.is_nominal:
        return "nominal: the flight does not show it"
    if math.isinf(one.half_width):
        return "not shown: its surface does not move"
    return f"± {one.half_width:.2g}"
