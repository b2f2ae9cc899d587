"""An aircraft's gear as the compiled code sees it, how it stands at rest, and how a crash reads."""

import math
from typing import Any

import numpy as np

from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import contact, rigid_body
from sitl_plant.airframe.aircraft import AircraftRecord, aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.contact import (
    BANK,
    BODY,
    DRIFT,
    GEAR,
    N_POINTS,
    NOSE,
    SINK,
    THIRD,
    WHEELS,
    WING,
)
from sitl_plant.airframe.gear import Gear, Ground, Runway

_R1, _load_state = in_python(rigid_body.R1), in_python(rigid_body.load_state)
_ground_reaction, _hold_points = in_python(contact.ground_reaction), in_python(contact.hold_points)
_STRUCK = {WING: "wing tip", NOSE: "nose", BODY: "body"}
_ACCURACY = 0.2
"""Step of the integration by the inverse of the fastest motion on the ground."""


def new_gear(aircraft: Aircraft, ground: Ground, runway: Runway | None) -> np.void:
    """Return the gear of an aircraft above the ground, dtype `GEAR`."""
    record: np.void = np.zeros(1, GEAR)[0]
    record["normal"] = ground.normal
    record["launch_s"] = -1.0
    if runway is not None:
        record["runway"] = runway.north_m, runway.east_m, runway.length_m, runway.width_m / 2.0
        record["runway_heading"] = math.radians(runway.heading_deg)
    gear = aircraft.gear
    if gear is None:
        return record
    model = aircraft_record(aircraft)
    record["has"], record["belly"] = 1, gear.kind == "belly"
    _place(record, gear, float(model["b"]))
    _fill(record, gear, model)
    record["reach"] = np.linalg.norm(record["at"], axis=1).max()
    record["longest_step"] = _ACCURACY / _fastest(record, model)
    weight = aircraft.mass_kg * aircraft.gravity_m_s2
    record["sink_hard"], record["sink_max"] = gear.sinks(weight / aircraft.wing_area_m2)
    record["bank_max"] = math.inf if gear.bank_max_deg is None else math.radians(gear.bank_max_deg)
    record["drift_max"] = math.inf if gear.drift_max_m_s is None else gear.drift_max_m_s
    if gear.launcher is not None:
        record["launch_speed"] = gear.launcher.speed_m_s
        record["launch_length"] = gear.launcher.length_m
    return record


def _place(record: np.void, gear: Gear, span_m: float) -> None:
    main, (tip, nose, tail) = gear.main(span_m), gear.hull(span_m)
    left = np.array([1.0, -1.0, 1.0])
    places = (main, main * left, gear.third(span_m), tip, tip * left, nose, tail, np.zeros(3))
    record["at"] = [np.asarray(place) for place in places]


def _fill(record: np.void, gear: Gear, model: AircraftRecord) -> None:
    """Write springs, dampers and frictions: under the weight all wheels give way alike."""
    span_m = float(model["b"])
    behind, ahead = gear.arms(span_m)
    third = -behind / (ahead - behind)
    masses = np.array([_mass_at(r, model) for r in record["at"]])
    masses[:WHEELS] = np.array([(1.0 - third) / 2.0, (1.0 - third) / 2.0, third]) * model["m"]
    record["stiffness"] = masses * model["g"] / gear.deflection(span_m)
    record["damping"] = 2.0 * gear.damping_ratio * np.sqrt(record["stiffness"] * masses)
    rolling, side, braked = gear.frictions
    record["rolling"], record["side"] = max(rolling, 0.4), max(side, 0.4)
    record["rolling"][:WHEELS], record["side"][:WHEELS] = rolling, side
    record["braked"][:THIRD] = braked - rolling
    record["steer"] = -math.copysign(gear.steer, ahead)


def _mass_at(r: np.ndarray, model: AircraftRecord) -> float:
    """Return the mass that a force along z at a place of the aircraft moves [kg]."""
    arm = np.cross(r, (0.0, 0.0, 1.0))
    return float(1.0 / (1.0 / model["m"] + arm @ model["J_inv"] @ arm))


def _fastest(record: np.void, model: AircraftRecord) -> float:
    """Return the fastest motion of the aircraft with all its points on the ground [1/s]."""
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = model["m"] * np.eye(3), model["J"]
    stiffness, damping = np.zeros((6, 6)), np.zeros((6, 6))
    for i in range(N_POINTS):
        x, y, z = record["at"][i]
        crossed = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        moved = np.hstack([np.eye(3), -crossed])
        stiffness += record["stiffness"][i] * moved.T @ moved
        damping += record["damping"][i] * moved.T @ moved
    below = np.linalg.solve(mass, np.hstack([-stiffness, -damping]))
    motion = np.vstack([np.hstack([np.zeros((6, 6)), np.eye(6)]), below])
    return float(np.abs(np.linalg.eigvals(motion)).max())


def stand(
    gear: np.void, model: AircraftRecord, north_m: float, east_m: float, yaw_rad: float
) -> np.ndarray:
    """Return the state, shape (12,), of an aircraft at rest on its wheels; it touches the ground.

    On a slope it stands as on a plain, which is turned: what is left is for friction to hold.

    Args:
        gear: Its gear, in which the points that touch are noted.
        model: The aircraft.
        north_m: Place [m].
        east_m: Place [m].
        yaw_rad: Heading.
    """
    flat = gear.copy()
    flat["normal"] = 0.0, 0.0, 1.0
    weight = float(model["m"] * model["g"])

    def standing(x: np.ndarray) -> np.ndarray:
        state = np.zeros(12)
        state[2], state[6], state[7] = x
        return state

    def unrest(x: np.ndarray) -> np.ndarray:
        force, moment = _ground_reaction(_load_state(standing(x)), 0.0, flat)
        down = float((_R1((x[1], x[2], 0.0)) @ np.array(force))[2])
        return np.array([down + weight, moment[0], moment[1]])

    x = _unloaded(gear)
    for _ in range(50):
        steps = 1e-7 * np.eye(3)
        slopes = np.array([(unrest(x + h) - unrest(x - h)) / 2e-7 for h in steps]).T
        change = np.linalg.solve(slopes, unrest(x))
        x = x - change
        if np.abs(change).max() < 1e-14:
            break
    state = _turned(standing(x), gear["normal"], yaw_rad)
    at = np.array([north_m, east_m, 0.0])
    at[2] = -(gear["normal"] @ at) / gear["normal"][2]
    state[:3] = at + state[2] * gear["normal"]
    gear["load"] = _hold_points(_load_state(state), 0.0, gear) / weight
    gear["near"] = 1
    return state


def _unloaded(gear: np.void) -> np.ndarray:
    """Return down [m], roll and pitch [rad] at which three wheels have the static deflection."""
    main, third = gear["at"][0], gear["at"][THIRD]
    pitch = math.atan((main[2] - third[2]) / (main[0] - third[0]))
    below = -math.sin(pitch) * main[0] + math.cos(pitch) * main[2]
    return np.array([-0.99 * below, 0.0, pitch])


def _turned(state: np.ndarray, normal: np.ndarray, yaw_rad: float) -> np.ndarray:
    """Return a state on a plain as one on a plane with a normal, with a heading [rad]."""
    ahead = np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
    along = ahead - (ahead @ normal) * normal
    along /= np.linalg.norm(along)
    plane = np.column_stack([along, np.cross(normal, along), normal])
    R = plane @ np.array(_R1((float(state[6]), float(state[7]), 0.0)))
    state[6] = math.atan2(R[2, 1], R[2, 2])
    state[7] = -math.asin(min(max(R[2, 0], -1.0), 1.0))
    state[8] = math.atan2(R[1, 0], R[0, 0])
    return state


def describe_crash(gear: np.void) -> str:
    """Describe why a contact with the ground was a crash."""
    worst, code = gear["worst"], int(gear["crash"])
    limits = {
        SINK: ("sinking at", worst["sink"], gear["sink_max"], "m/s"),
        BANK: ("banked by", math.degrees(worst["bank"]), math.degrees(gear["bank_max"]), "deg"),
        DRIFT: ("drifting at", worst["drift"], gear["drift_max"], "m/s"),
    }
    if code in limits:
        text, value, most, unit = limits[code]
        return f"it hit the ground, {text} {abs(value):.1f} {unit} (limit {most:.1f} {unit})"
    return f"it hit the ground with its {_STRUCK[code]}"


def contact_facts(gear: np.void) -> dict[str, Any] | None:
    """Return what became of an aircraft on the ground, as plain data; None of one without gear.

    Its keys are as in `gcs.results.ground.GroundSummary`.
    """
    if not gear["has"]:
        return None
    worst, landed = gear["worst"], bool(gear["touchdowns"])
    outcome = "in the air"
    if gear["launch_s"] >= 0.0:
        outcome = "on the launcher"
    elif gear["load"] > 0.0:
        outcome = "landed" if gear["flew"] and landed else "on the ground"
        if outcome == "landed" and worst["sink"] > gear["sink_hard"]:
            outcome = "landed hard"
        outcome = "off the runway" if gear["off_runway"] else outcome
    touchdown = {
        "time_s": float(worst["time"]),
        "sink_m_s": float(worst["sink"]),
        "bank_deg": math.degrees(worst["bank"]),
        "pitch_deg": math.degrees(worst["pitch"]),
        "drift_m_s": float(worst["drift"]),
        "speed_m_s": float(worst["speed"]),
        "north_m": float(worst["position"][0]),
        "east_m": float(worst["position"][1]),
    }
    return {
        "outcome": "crashed" if gear["crash"] else outcome,
        "reason": describe_crash(gear) if gear["crash"] else None,
        "touchdowns": int(gear["touchdowns"]),
        "worst": touchdown if landed else None,
        "off_centre_m": float(gear["off_centre"]) if gear["runway"][2] else None,
    }
