"""The tube law's adaptation: on made-up moments, and in flights of uncertain aircraft."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from steps import step_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.control.controller import parameter_record
from ftc_autopilot.control.laws.tube import Tube
from ftc_autopilot.control.laws.tube.adaptation import adapt
from ftc_autopilot.control.triggers.static import Consequence
from ftc_lab.campaigns.model import load_campaign
from ftc_lab.campaigns.plan import plan, rows_of
from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import summarise
from gcs.scenario.model import scenario_of
from mavlink_defs.config.inherit import merged
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.actuators.config import ActuatorServos

CAMPAIGN = Path(__file__).parents[5] / "scenarios" / "campaigns" / "tube.yaml"
PERIOD = 0.004
TRUE = np.array([[0.15, -0.18], [-0.1, 0.2], [-0.15, 0.12]])  # relative errors of the derivatives
DAMPING = ("cl_p", "cm_q", "cn_r")
ADAPTED = {"cl_da": (0, 1), "cm_q": (1, 0), "cm_de": (1, 1)}
OTHERS = ("cl_p", "cn_r", "cn_dr", "cl_r", "cm_alpha", "cn_da", "cL_alpha", "cl0", "m")


def learnt(
    nominal: np.void, noise: float = 0.0, suspect: int | None = None, **keys: Any
) -> np.void:
    """State of the law after 10 s of steps of all surfaces, in a slow disturbance."""
    gains = parameter_record(Tube(**keys).with_servos(ActuatorServos()), Consequence())["tube"]
    state = np.zeros(1, Tube.STATE)[0]
    message = np.zeros(1, SIM_STATE)[0]
    message["velocity"] = (45.0, 0.5, 2.5)
    motion = motion_of(message, nominal)
    rng = np.random.default_rng(1)
    C, J = np.array(motion.air.C), nominal["J"].diagonal()
    lengths = np.array([nominal["b"], nominal["c_bar"], nominal["b"]])
    qS = 0.5 * nominal["rho"] * motion.V**2 * nominal["S"]
    damping = np.array([nominal[name] for name in DAMPING]) * qS * lengths**2 / (2.0 * motion.V) / J
    omega, u, diagnosis = np.zeros(3), np.zeros(3), state["fallback"]["diagnosis"]
    for step in range(2500):
        if step % 50 == 0:
            u = rng.uniform(-0.02, 0.02, 3)
        omega += PERIOD * (damping * omega + C.diagonal() / J * u)
        slow = 0.2 * math.sin(math.pi * step * PERIOD)
        effects = np.stack([damping * omega, C.diagonal() / J * u], axis=1)
        unexplained = (TRUE * effects).sum(axis=1) + slow + noise * rng.normal(size=3)
        residual = np.linalg.solve(C, unexplained * J)
        diagnosis["age"] = step * PERIOD
        diagnosis["omega_filtered"] = omega
        for j in range(3):
            diagnosis["actuators"][j]["commanded"] = u[j]
            diagnosis["actuators"][j]["measured"] = u[j] + residual[j]
            diagnosis["actuators"][j]["suspect_s"] = float(j == suspect)
        now = step_of(motion, first=step == 0, held=(*u.tolist(), 900.0))
        adapt(now, nominal, gains, state)
    return state


def test_the_derivatives_are_found_despite_noise_and_a_slow_disturbance(nominal: np.void) -> None:
    state = learnt(nominal, noise=0.2, adaptation_prior=5e-4)
    assert state["derivative_error"] == pytest.approx(TRUE[:2], abs=0.04)
    for name, place in ADAPTED.items():
        error = state["derivative_error"][place]
        assert state["model"][name] == pytest.approx(nominal[name] * (1.0 + error))
    for name in OTHERS:
        assert state["model"][name] == nominal[name]


def test_little_excitation_is_believed_little(nominal: np.void) -> None:
    believed = np.abs(learnt(nominal, adaptation_prior=100.0)["derivative_error"])
    assert np.all(believed < 0.5 * np.abs(TRUE[:2]))


@pytest.mark.parametrize("keys", [{"adapt": False}, {"suspect": 1}])
def test_nothing_is_learnt_without_being_asked_or_of_a_suspect(
    nominal: np.void, keys: dict[str, Any]
) -> None:
    state = learnt(nominal, **keys)
    assert not state["derivative_error"].any()
    assert all(state["model"][name] == nominal[name] for name in ADAPTED)


@pytest.mark.slow
@pytest.mark.parametrize("draw", [50, 55])
def test_an_aircraft_whose_surfaces_are_unlike_the_models_needs_few_messages(draw: int) -> None:
    """The worst of the first 80 draws without adaptation."""
    planned = plan(load_campaign(CAMPAIGN, draw + 1), CAMPAIGN)
    (row,) = [
        row
        for row in rows_of(planned.draws)
        if row["draw"] == draw and row["variant"] == "realistic"
    ]
    mean = []
    for adapted in (True, False):
        tree = merged(planned.flights.tree(row), {"controller": {"adapt": adapted}})
        scenario = scenario_of(str(CAMPAIGN), tree)
        uavs = summarise(fly_in_process(scenario), scenario).uavs
        mean.append(np.mean([uav.events for uav in uavs]))
        assert [uav.false_alarms for uav in uavs] == [0, 0, 0]
    assert mean[0] < 200
    assert mean[0] < 0.85 * mean[1]
