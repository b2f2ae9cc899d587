"""Steps of a controller along a given course of motions, and recorded courses.

A recorded course holds what the code did when it was recorded: it shows that something has changed,
and the tests beside it whether that is right. `FTC_SITL_RECORD=1` records again what is run.
"""

import json
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from edges import edges_of

from ftc_autopilot.common.motion import MeasuredMotion, fill_neighbour_state, motion_of
from ftc_autopilot.control.controller import (
    Inputs,
    Records,
    control_step,
    new_controller,
    parameter_record,
)
from ftc_autopilot.control.controllers import GUIDANCE
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.step import Seen
from gcs.scenario.model import Scenario
from mavlink_defs.framing.codec import ACTUATORS, NEIGHBOUR, SIM_STATE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.loop.fleet import PlantState, fly, new_plant_state, observe

_RECORDED_AS = {"stops": "surface_limit"}
"""Names of fields when courses were recorded; the stops of all surfaces were one number."""
FOLDER = Path(__file__).parents[1] / "data" / "courses"


class Pilot:
    """A controller with two neighbours, along a course."""

    def __init__(self, law: Any, trigger: Any, aircraft: Aircraft, dt: float = 1e-3) -> None:
        self.nominal, self.dt, self.law = aircraft_record(aircraft), dt, law.kind
        self.parameters = parameter_record(law, trigger)
        law.derive(aircraft, self.parameters[law.kind])
        self.state = new_controller()
        self.signals: np.void = np.zeros(1, SIGNALS)[0]
        self.guidance: np.void = np.zeros(1, GUIDANCE)[0]
        self.edges = edges_of(np.zeros(2, NEIGHBOUR), np.array([1.0, 0.5]))
        self.actuators: np.void = np.zeros(1, ACTUATORS)[0]
        self.step_number = 0

    def step(
        self,
        motion: MeasuredMotion,
        command: tuple[float, ...],
        seen: tuple[int, int, bool] = (0, 0, False),
    ) -> np.void:
        """Make one step; gives its signals."""
        self.guidance["command"] = command
        t = self.step_number * self.dt
        self.step_number += 1
        _step(
            motion,
            *seen,
            (t, self.dt),
            self.guidance,
            self.edges,
            self.nominal,
            self.parameters,
            self.state,
            self.actuators,
            self.signals,
        )
        return self.signals


@compiled
def _step(
    motion: MeasuredMotion,
    ahead: int,
    links: int,
    after_gap: bool,
    time: tuple[float, float],
    guidance: np.void,
    edges: np.ndarray,
    aircraft: np.void,
    parameters: np.void,
    state: np.void,
    actuators: np.void,
    signals: np.void,
) -> None:
    """Call `control_step` with the types that a flight has: its machine code is in the cache."""
    seen = Seen(motion, ahead, links, int(after_gap), 0)
    inputs = Inputs(time[0], time[1], motion, seen, guidance["command"], edges, math.inf)
    records = Records(
        aircraft, parameters, state, actuators["controls"], signals, guidance["runway"]
    )
    control_step(inputs, records, True)


def motion_at(t: float, nominal: np.void, swing: float = 1.0) -> MeasuredMotion:
    """A motion that turns about all axes, as no aircraft would fly it."""
    message = np.zeros(1, SIM_STATE)[0]
    s = np.sin(np.array([3.1, 4.3, 5.7, 7.1, 8.3, 9.7, 11.3, 12.1]) * t + np.arange(8))
    message["velocity"] = 44.0 + 3.0 * swing * s[0], 1.5 * swing * s[1], 3.0 + swing * s[2]
    message["attitude"] = 0.2 * swing * s[3], 0.1 + 0.1 * swing * s[4], 3.0 + 0.3 * swing * s[5]
    message["rates"] = swing * np.array([0.3 * s[6], 0.2 * s[7], 0.1 * s[0]])
    message["specific_force"] = 0.5 + swing * s[1], 0.3 * swing * s[3], -9.5 + swing * s[5]
    return motion_of(message, nominal)


def neighbours_at(t: float, nominal: np.void, neighbours: np.ndarray) -> None:
    """Write the messages of two neighbours, one of them against a reference of its own."""
    for j in range(2):
        fill_neighbour_state(motion_at(t + 0.5 + j, nominal), 0, neighbours[j])
    own = neighbours[1]
    own["frame"] = 1
    own["airspeed"] -= 44.0
    own["attitude"][2] -= 3.0


def digest(record: np.void | np.ndarray, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield a number of each field, in which each of its elements has another weight."""
    for field in record.dtype.names or ():
        part, path = record[field], f"{name}{_RECORDED_AS.get(field, field)}"
        if field == "stops":
            part = part[0, 1]
        if part.dtype.names:
            yield from digest(part, f"{path}.")
        elif part.dtype.kind in "fiub":
            x = np.nan_to_num(np.ravel(part).astype(float), nan=-7.0, posinf=1e3, neginf=-1e3)
            yield path, float(x @ np.sqrt(1.0 + np.arange(len(x))))


class Course:
    """Numbers along a course, to be compared with the recorded ones."""

    def __init__(self, name: str) -> None:
        self.path, self.found = FOLDER / f"{name}.json", dict[str, list[float]]()

    def note(self, record: np.void | np.ndarray, name: str = "") -> None:
        """Note what a record holds now."""
        for field, number in digest(record, name):
            self.found.setdefault(field, []).append(float(f"{number:.9g}"))

    def check(self) -> None:
        """Compare what was noted, to 1e-7 of each field's largest number."""
        found = {field: row for field, row in self.found.items() if any(row)}
        if os.environ.get("FTC_SITL_RECORD"):
            rows = (f"{json.dumps(field)}: {json.dumps(row)}" for field, row in found.items())
            self.path.parent.mkdir(exist_ok=True)
            self.path.write_text("{\n" + ",\n".join(rows) + "\n}\n")
        recorded = json.loads(self.path.read_text())
        assert found.keys() == recorded.keys()
        for field, row in recorded.items():
            scale = max(np.max(np.abs(row)), 1e-9)
            away = np.abs(np.subtract(found[field], row)) / scale
            assert away.max() < 1e-7, (field, int(away.argmax()))


STEP_US = 4000
SERVOS = ActuatorServos.model_validate(
    {name: {"lag_s": 0.01, "rate_limit_deg_s": 300.0} for name in ("aileron", "elevator", "rudder")}
    | {"throttle": {"lag_s": 0.05}}
)


def plant_of(scenario: Scenario, **changes: Any) -> PlantState:
    """A plant with servos and without faults."""
    keys = {"faults": (), "step_us": STEP_US, "servos": SERVOS.model_dump()} | changes
    return new_plant_state(Scenario.model_validate(scenario.model_dump() | keys).plant_config())


def fly_along(
    course: Course,
    pilot: Pilot,
    plant: PlantState,
    seconds: float,
    gap_s: float = math.inf,
    delay: int = 0,
) -> None:
    """Fly turns with the first aircraft of a plant; one measurement comes after a gap."""
    pilot.edges["weight"] = 0.0
    steps = round(seconds * 1e6 / STEP_US)
    for k in range(steps):
        t = k * STEP_US / 1e6
        observe(plant, 0, k, STEP_US)
        gap = t <= gap_s < t + STEP_US / 1e6
        roll, pitch = 0.1 * math.sin(4.0 * t), 0.08 + 0.05 * math.sin(7.0 * t)
        motion = motion_of(plant.uavs[0]["message"], plant.uavs[0]["aircraft"])
        signals = pilot.step(motion, (45.0, roll, pitch, 0.0), (delay, delay, gap))
        plant.uavs[0]["controls"] = pilot.state["held"]
        assert fly(plant, k, STEP_US) < 0
        if (k + 1) % (steps // 6) == 0 or k == 2 or gap:
            course.note(signals)
            course.note(pilot.state[pilot.law], "law.")
    course.check()
