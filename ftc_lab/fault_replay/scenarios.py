"""The fault of a log as ordinary scenario files, one for each law."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ftc_lab.design.airframe import airframe_of, cruise_of
from ftc_lab.design.rules import Conditions
from ftc_lab.design.scenario import design_of, plain, tree_of
from ftc_lab.fault_replay.found import FoundFault
from ftc_lab.fault_replay.replay import LogMotion, Replayed
from gcs.api.flying import fly
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario, read_scenario, scenario_of
from mavlink_defs.config.files import dump
from sitl_plant.airframe.level_flight import level_flight

LEAD_S = 2.0
"""Flown before the fault, so that a law is in its flight [s]."""
_LEAST_S, _MOST_S = 20.0, 60.0
_MOST_ROLL_DEG, _MOST_PITCH_DEG = 60.0, 30.0
_LOWEST_M = 5.0


class FlownLaw(NamedTuple):
    """A flight by a law.

    Attributes:
        law: Its name.
        scenario: The file that was flown.
        loss: Why it was lost; None: it was not.
        flown: What it did, time as the log's.
    """

    law: str
    scenario: Path
    loss: str | None
    flown: Replayed


def scenario_for(log: LogMotion, fault: FoundFault, law: str, title: str) -> Scenario:
    """Return a flight by a law that begins as the log does before the fault, and holds level.

    Its parameters are of a design for the aircraft.

    Args:
        log: The log.
        fault: What failed.
        law: Name of the law.
        title: Of the log.

    Raises:
        BadInput: The law cannot fly the aircraft, and why.
    """
    aircraft, k = log.aircraft, log.index(fault.onset_s - LEAD_S)
    lag = round(float(np.mean(log.servos.lags_s[:3])), 4)
    made = design_of(airframe_of("aircraft", aircraft, cruise_of(aircraft)), law, Conditions(lag))
    tree = plain(tree_of(made))
    V = float(np.clip(log.airspeed[k], aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s))
    roll, pitch, yaw = np.degrees(log.attitude[k]).tolist()
    yaw = (yaw + 180.0) % 360.0 - 180.0
    level = level_flight(aircraft, V)
    hold = {
        "start_s": 0.0,
        "airspeed_m_s": round(V, 2),
        "pitch_deg": round(made.airframe.flight.alpha_deg if level is None else level.alpha_deg, 2),
        "yaw_deg": round(yaw, 1),
    }
    ground = float(np.nanmin(log.height))
    begin_s = float(log.time_s[k])
    initial = {
        "north_m": 0.0,
        "east_m": 0.0,
        "altitude_m": round(max(float(log.height[k]) - ground, _LOWEST_M), 1),
        "airspeed_m_s": round(V, 2),
        "roll_deg": round(float(np.clip(roll, -_MOST_ROLL_DEG, _MOST_ROLL_DEG)), 1),
        "pitch_deg": round(float(np.clip(pitch, -_MOST_PITCH_DEG, _MOST_PITCH_DEG)), 1),
        "yaw_deg": round(yaw, 1),
    }
    wind: list[float] = np.asarray(np.mean(log.wind[k:], axis=0)).round(2).tolist()
    rest_s = float(log.time_s[-1]) - begin_s
    tree |= {
        "name": f"{title}, {law}",
        "description": f"What failed in {title}: {fault}, {begin_s:.2f} s of the log being 0.",
        "duration_s": round(min(max(rest_s, _LEAST_S), _MOST_S), 1),
        "aircraft": aircraft.model_dump(exclude_none=True),
        "wind": {"steady": dict(zip(("north_m_s", "east_m_s", "down_m_s"), wind, strict=True))},
        "profile": [hold],
        "uavs": [{"id": 1, "name": "as in the log", "initial": initial}],
        "faults": [_entry(fault, 1, fault.onset_s - begin_s)],
    }
    return scenario_of("the replay", tree)


def scenario_of_run(run: Path, fault: FoundFault, uav: int, law: str) -> Scenario:
    """Return a flight of ours by another law, with the fault that its recording shows.

    Raises:
        BadInput: The law does not fit the scenario.
    """
    entry = _entry(fault, uav, fault.onset_s)
    changes = {"controller": {"kind": law}, "faults": [entry]}
    return with_changes(read_scenario(run / "scenario.yaml"), values=changes)


def _entry(fault: FoundFault, uav: int, start_s: float) -> dict[str, Any]:
    start = round(max(start_s, 0.0), 2)
    return {"uav": uav, "actuator": fault.actuator, **fault.values, "start_s": start}


def fly_law(scenario: Scenario, law: str, uav: int, folder: Path, zero_s: float) -> FlownLaw:
    """Write a scenario file, fly it, and return what happened.

    Args:
        scenario: What is flown.
        law: Its law.
        uav: The aircraft with the fault.
        folder: Where the file and the run go.
        zero_s: Time of the log at which it begins.
    """
    file = folder / f"{law}.yaml"
    dump(scenario, file)
    flight = fly(file, out=folder / "runs" / law)
    frame = flight.frame()
    own = frame[frame["uav"] == uav] if "uav" in frame.columns else frame.xs(uav, level="uav")
    time_s = own["time_s"].to_numpy() if "time_s" in own.columns else own.index.to_numpy(float)
    values = {name: np.degrees(own[name].to_numpy()) for name in ("roll", "pitch", "yaw")}
    values |= {"airspeed": own["V"].to_numpy(), "height": -own["down"].to_numpy()}
    return FlownLaw(law, file, flight.loss, Replayed(time_s + zero_s, values))
