"""A scenario for an aircraft: scenario 1 of the paper in the aircraft's units, all parameters."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from ftc_autopilot.control.airframe_checks import AREA, PAIRING, SIDESLIP, airframe_checks
from ftc_autopilot.control.heading import remaining_side_force
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.pairing import is_coupled, surfaces_by_sideslip
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_lab.design.airframe import Airframe, home
from ftc_lab.design.parameters import Line, Tree, parameters_of
from ftc_lab.design.rules import Conditions, Rules
from ftc_lab.design.similarity import Similarity, similarity
from gcs.console.errors import BadInput
from mavlink_defs.config.yaml_text import yaml_of
from sitl_plant.airframe.aerodynamics import Lateral, lateral
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.level_flight import level_flight

_TRIGGERS = {"pid": "periodic"}
"""Trigger that a law is designed with where it is not its own: a PID is flown by the clock."""
_MAX_TIME_SCALE = 4.0
_STEPS_DEG = {"roll": 5.0, "pitch": 5.0, "yaw": 10.0}
"""Steps of scenario 1."""
_YAW, _ROLL = 0.45, 0.3  # of the largest sideslip by rudder
_CLIMB = 0.5  # of what the thrust to spare can climb
_APART = 10.0  # spans between neighbours, along and across
_ALTITUDE_M = 1000.0


@dataclass(frozen=True)
class Design:
    """What a scenario is made of.

    Attributes:
        airframe: The aircraft.
        aircraft_key: What the scenario has at `aircraft`: a bundled name, or a file.
        similar: The aircraft's units.
        law: Name of the law.
        given: What flies with the aircraft.
        uavs: Number of UAVs.
        plant: Section `plant` of the scenario; none: our own equations.
        warnings: What is not as it should be, but can be flown.
    """

    airframe: Airframe
    aircraft_key: str
    similar: Similarity
    law: str
    given: Conditions
    uavs: int
    plant: dict[str, Any] | None
    warnings: tuple[str, ...]

    @property
    def heading_by_bank(self) -> str | None:
        """Why the law holds the heading by bank; None: by the rudder."""
        return LAWS[self.law](kind=self.law).holds_heading_by_bank(self.airframe.aircraft)


def design_of(
    airframe: Airframe,
    law: str,
    given: Conditions,
    *,
    aircraft_key: str = "",
    uavs: int = 1,
    plant: dict[str, Any] | None = None,
) -> Design:
    """Return the design of a law for an aircraft.

    Args:
        airframe: The aircraft at its cruising speed.
        law: Name of the law.
        given: What flies with it.
        aircraft_key: As of `Design`; the airframe's name by default.
        uavs: Number of UAVs.
        plant: As of `Design`.

    Raises:
        BadInput: No law can fly it as scenario 1 is flown, or this one cannot, and why.
    """
    warnings = tuple(_warnings(airframe, law))
    similar = similarity(airframe)
    if similar.time > _MAX_TIME_SCALE:
        able = ", ".join(f"{x:.2g}" for x in airframe.authority)
        raise BadInput(
            f"{airframe.name} is {similar.time:g} times slower than the laws' home aircraft, "
            f"expected at most {_MAX_TIME_SCALE:g}: its surfaces make [{able}] rad/s^2",
            "choose a higher --airspeed, or more thrust or control authority",
        )
    problems = list(LAWS[law](kind=law).misfits(airframe.aircraft))
    if problems:
        raise BadInput(f"{law} cannot fly {airframe.name}: {problems[0]}")
    key = aircraft_key or airframe.name
    return Design(airframe, key, similar, law, given, uavs, plant, warnings=warnings)


def _warnings(airframe: Airframe, law: str) -> Iterator[str]:
    """Yield what is not as it should be, but can be flown.

    Raises:
        BadInput: Something cannot be; all that is not as it should be is named, as one wrong number
            may fail several checks.
    """
    by_bank = LAWS[law](kind=law).holds_heading_by_bank(airframe.aircraft)
    can_be_flown = {AREA: True, PAIRING: True, SIDESLIP: by_bank is not None}
    checks = airframe_checks(airframe.aircraft, airframe.flight)
    unmet = [check for check in checks if not check.is_met]
    texts = [f"{check.name}: {check.value}: {check.otherwise}" for check in unmet]
    if not all(can_be_flown.get(check.name, False) for check in unmet):
        text = f"{airframe.name}: {'; and '.join(texts)}"
        raise BadInput(text, f"see gcs aircraft {airframe.name}")
    yield from (f"{airframe.name}: {text}" for text in texts)


class Sections(NamedTuple):
    """The parameters of a design, by section of the scenario."""

    controller: Tree
    trigger: Tree
    guidance: Tree


def sections_of(design: Design) -> Sections:
    """Return every parameter of law, trigger and guidance, with its rule."""
    mode = _TRIGGERS.get(design.law, LAWS[design.law].TRIGGER)
    trigger = TRIGGERS[mode](mode=mode)
    least = min(value for _, value in trigger.b2_deg.windows())
    rules = Rules(design.airframe, design.similar, design.given, least)
    law = LAWS[design.law](kind=design.law)
    controller, of_trigger, guidance = (
        parameters_of(model, design.similar, rules.rule_of)
        for model in (law, trigger, PathFollowing())
    )
    controller["kind"] = Line(design.law, "asked for")
    of_trigger["mode"] = Line(trigger.mode, f"what {design.law} is flown with")
    return Sections(controller, of_trigger, guidance)


def tree_of(design: Design) -> Tree:
    """Return the whole scenario, each value with its rule."""
    airframe, s = design.airframe, design.similar.time
    sections = sections_of(design)
    tree: Tree = {
        "name": Line(f"{airframe.name}, {design.law}", ""),
        "description": Line(
            f"Scenario 1 of the paper as {airframe.name} can fly it, every parameter derived.", ""
        ),
        "duration_s": Line(24.0 * s, "24 × s"),
        "step_us": Line(design.given.step_us, ""),
        "aircraft": Line(design.aircraft_key, ""),
    }
    if design.plant is not None:
        tree["plant"] = Line(design.plant, "what flies")
    tree |= _hardware(design.given)
    tree["controller"], tree["trigger"] = sections.controller, sections.trigger
    tree["guidance"] = sections.guidance
    profile, first_pitch = profile_of(design)
    tree["uavs"] = Line(_fleet(design, first_pitch), "")
    star = [{"between": [1, i], "weight": 1.0} for i in range(2, design.uavs + 1)]
    tree["network"] = Line({"leader_access": {1: 1.0}, "edges": star}, "")
    tree["profile"] = Line(profile, "")
    return tree


def _hardware(given: Conditions) -> Tree:
    surfaces: dict[str, float] = {"lag_s": given.servo_lag_s}
    if given.servo_rate_deg_s is not None:
        surfaces["rate_limit_deg_s"] = given.servo_rate_deg_s
    gyro = {"noise_rms": given.gyro_noise_deg_s, "latency_s": given.gyro_delay_s}
    throttle = {"lag_s": given.engine_lag_s}
    return {
        "servos": {"surfaces": Line(surfaces, "given"), "throttle": Line(throttle, "given")},
        "sensors": {"gyro_deg_s": Line(gyro, "given")},
    }


def steps_deg(design: Design) -> dict[str, tuple[float, str]]:
    """Return the steps of roll, pitch and yaw [deg], and why these.

    Heading is turned with wings nearly level, and bank is balanced, by sideslip: both by as much as
    the rudder can hold. Where the heading is held by bank, no roll is commanded. A climb takes
    thrust.
    """
    airframe = design.airframe
    aircraft, V = airframe.aircraft, airframe.airspeed
    weight = aircraft.mass_kg * aircraft.gravity_m_s2
    roll, pitch, yaw = _STEPS_DEG.values()
    climb = math.degrees(math.asin(min(1.0, _CLIMB * airframe.thrust_to_spare / weight)))
    of_pitch = min(pitch, climb), "5 deg, at most half of what the thrust can climb"
    if (why := design.heading_by_bank) is not None:
        return {
            "roll": (0.0, f"what the heading takes, which is held by bank: {why}"),
            "pitch": of_pitch,
            "yaw": (yaw, "10 deg, by a turn"),
        }
    air = lateral(V, aircraft_record(aircraft))
    widest, by, side = _widest_sideslip_deg(airframe, air), "rudder", air.side.beta
    if is_coupled(aircraft):
        by, side = "aileron and rudder", remaining_side_force(aircraft, V)
    held = math.degrees(weight * math.sin(math.radians(roll)) / max(abs(side), 1e-9))
    return {
        "roll": (
            roll * min(1.0, _ROLL * widest / held),
            f"5 deg, at most what sideslip of 0.3 × {widest:.0f} deg balances",
        ),
        "pitch": of_pitch,
        "yaw": (
            min(yaw, _YAW * widest),
            f"10 deg, at most 0.45 × {widest:.0f} deg of sideslip by {by}",
        ),
    }


def _widest_sideslip_deg(airframe: Airframe, air: Lateral) -> float:
    """Return the largest sideslip at which the rudder, coupled or alone, holds the heading."""
    aircraft = airframe.aircraft
    if is_coupled(aircraft):
        pairs = zip(airframe.stops[::2], surfaces_by_sideslip(aircraft), strict=True)
        return math.degrees(min(stop / max(abs(by), 1e-9) for stop, by in pairs))
    stiffness = air.scale * abs(air.yawing.beta) / aircraft.inertia_kg_m2.Jzz
    return math.degrees(airframe.authority[2] / max(stiffness, 1e-9))


def profile_of(design: Design) -> tuple[list[dict[str, float]], float]:
    """Return the segments of scenario 1 in the aircraft's units, and the pitch of the first [deg].

    Pitch is the one of level flight at the airspeed, and a step up from it.
    """
    aircraft, s = design.airframe.aircraft, design.similar.time
    steps = {name: value for name, (value, _) in steps_deg(design).items()}
    low, high = aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s
    speeds = [
        min(max(V * design.similar.velocity, low), high) for V in (40.0, home().airspeed, 50.0)
    ]
    level = [_pitch_deg(design.airframe, V) for V in speeds]
    rows = (
        (0.0, speeds[0], 0.0, level[0], 0.0),
        (4.0 * s, speeds[1], steps["roll"], level[1] + steps["pitch"], steps["yaw"]),
        (15.0 * s, speeds[2], 0.0, level[2], steps["yaw"]),
    )
    keys = ("start_s", "airspeed_m_s", "roll_deg", "pitch_deg", "yaw_deg")
    found = [
        {key: round(value, 2) + 0.0 for key, value in zip(keys, row, strict=True)} for row in rows
    ]
    return found, found[0]["pitch_deg"]


def _pitch_deg(airframe: Airframe, V: float) -> float:
    """Return the pitch angle of level flight at an airspeed [deg]; of cruise if there is none."""
    flight = level_flight(airframe.aircraft, V) or airframe.flight
    return flight.alpha_deg


def _fleet(design: Design, pitch_deg: float) -> list[dict[str, Any]]:
    apart = round(_APART * design.airframe.aircraft.wing_span_m)
    V = profile_of(design)[0][0]["airspeed_m_s"]
    return [
        {
            "id": i + 1,
            "name": "leader" if i == 0 else f"follower {i}",
            "initial": {
                "north_m": float(-apart * ((i + 1) // 2)),
                "east_m": float(apart * ((i + 1) // 2) * (1 if i % 2 else -1)) + 0.0,
                "altitude_m": _ALTITUDE_M,
                "airspeed_m_s": V,
                "pitch_deg": pitch_deg,
            },
        }
        for i in range(design.uavs)
    ]


def plain(tree: Tree) -> dict[str, Any]:
    """Return a scenario without its rules, as `gcs.scenario.model.scenario_of` takes it."""
    return {
        key: part.value if isinstance(part, Line) else plain(part) for key, part in tree.items()
    }


def text_of(design: Design, command: str) -> str:
    """Return the scenario as YAML, each line with the rule that made it.

    Args:
        design: The design.
        command: What was asked for, for its first line.
    """
    similar = design.similar
    axes, authority = (
        ", ".join(f"{x:.3g}" for x in triple)
        for triple in (similar.axes, design.airframe.authority)
    )
    head = [
        f"Written by: {command}",
        "",
        f"Time scale s = {similar.time:g}, of roll, pitch, yaw s_i = {axes}; airspeed v = "
        f"{similar.velocity:.3g},",
        f"mass m = {similar.mass:.4g}, relative to the paper's aircraft at 45 m/s, whose defaults "
        "these were.",
        f"Full aileron, elevator, rudder make {authority} rad/s^2 at "
        f"{design.airframe.airspeed:g} m/s.",
        "Rules: docs/explanation/design-rules.md",
        *(f"Warning: {text}" for text in design.warnings),
    ]
    lines = [f"# {line}".rstrip() for line in head]
    notes = {
        "profile": [f"{name}: {why}" for name, (_, why) in steps_deg(design).items()],
        "uavs": [f"{_APART:g} spans apart" if design.uavs > 1 else "level flight"],
    }
    for key, part in tree_of(design).items():
        if not isinstance(part, Line) or isinstance(part.value, list | dict):
            lines.append("")
        lines += [f"# {note}" for note in notes.get(key, [])]
        lines += _written(key, part)
    return "\n".join(lines) + "\n"


def _written(key: str, part: "Line | Tree", indent: str = "") -> list[str]:
    if isinstance(part, Line):
        rule = f" # {part.rule}" if part.rule else ""
        if isinstance(part.value, list) and part.value and isinstance(part.value[0], dict):
            rows = [f"{indent}  - {_flow(row)}" for row in part.value]
            return [f"{indent}{key}:{rule}", *rows]
        return [f"{indent}{key}: {_flow(part.value)}{rule}"]
    inner = [line for name, one in part.items() for line in _written(name, one, indent + "  ")]
    return [f"{indent}{key}:", *inner]


def _flow(value: Any) -> str:
    """Return a value as YAML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_flow, value)) + "]"
    return yaml_of({"x": value}).removeprefix("x:").strip()
