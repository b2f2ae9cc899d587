"""Recordings and scenarios for the tests of the theory's checks."""

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ftc_autopilot.control.laws as all_laws
from ftc_autopilot.control import controller, stepping
from ftc_autopilot.control.signals import SIGNALS
from gcs.fleet import in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario, scenario_of, scenario_tree

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SCENARIO_1 = SCENARIOS / "paper" / "scenario1.yaml"
SHORT = {"duration_s": 0.4}
DT = 1e-3  # control period [s]


def scenario_with(**changes: Any) -> Scenario:
    return scenario_of("scenario1 changed", scenario_tree(SCENARIO_1) | changes)


def synthetic(steps: int, uavs: int = 1, loss: str | None = None) -> Recording:
    """A recording of zeros at a safe airspeed."""
    states = np.zeros((steps, uavs, 12))
    states[:, :, 3] = 40.0
    signals = np.zeros((steps, uavs), SIGNALS)
    signals["V"] = 40.0
    return Recording(
        mode="in_process",
        step_us=1000,
        uav_ids=tuple(range(1, uavs + 1)),
        states=states,
        wind=np.zeros((steps, uavs, 3)),
        applied=np.zeros((steps, uavs, 4)),
        signals=signals,
        repeats=np.zeros((uavs, 4), np.int64),
        wall_s=0.0,
        loss=loss,
    )


def python_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the loop and what calls the laws run as plain Python, and all else as compiled."""
    chain = (
        (in_process, "run_steps"),
        (in_process, "controller_step"),
        (in_process, "broadcast_if_triggered"),
        (in_process, "_deliver"),
        (in_process, "hear"),
        (stepping, "_note_known"),
        (stepping, "_control"),
        (stepping, "control_step"),
        (controller, "_step"),
        (controller, "evaluate"),
        (all_laws, "proposed_law"),
    )
    for module, name in chain:
        monkeypatch.setattr(module, name, inspect.unwrap(getattr(module, name)))
    plain = {"borrowed": lambda arrays: arrays, "copy_record": _copy}
    for module in {module for module, _ in chain}:
        for name in plain.keys() & vars(module).keys():
            monkeypatch.setattr(module, name, plain[name])


def _copy(target: np.void, source: np.void) -> None:
    for name in target.dtype.names or ():
        target[name] = source[name]
