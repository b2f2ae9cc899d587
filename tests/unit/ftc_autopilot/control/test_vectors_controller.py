"""One controller step of a fleet of three against the worked values, to 1e-9 relative."""

import math
from typing import Any

import numpy as np
import pytest
from edges import edges_of

from ftc_autopilot.common.motion import fill_neighbour_state, motion_of
from ftc_autopilot.control.controller import (
    Inputs,
    Records,
    control_step,
    new_controller,
    parameter_record,
)
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.step import Seen
from ftc_autopilot.control.triggers.static import PerChannel
from ftc_autopilot.guidance.runway_state import RUNWAY_STATE
from gcs.scenario.model import Scenario
from mavlink_defs.framing.codec import NEIGHBOUR, SIM_STATE
from sitl_plant.airframe.rigid_body import gravity_body

DT = 1e-3
SCALARS = {
    "rbf_sum_sq": "basis",
    "alpha_v": "alpha_v",
    "r_v": "r_v",
    "zeta_v": "zeta_v",
    "B_v": "B_v",
    "Phi_v_dot": "Phi_v_dot",
    "g_v_dot": "g_v_dot",
    "beta_v_dot": "beta_v_dot",
    "omega_d": "omega_d",
    "omega_d_dot": "omega_d_dot",
    "e_omega": "e_omega",
    "zeta_w": "zeta_omega",
    "Phi_w_dot": "Phi_omega_dot",
    "beta_w_dot": "beta_omega_dot",
}


def close(ours: object, expected: object) -> bool:
    expected = np.asarray(expected)
    scale = max(float(np.max(np.abs(expected))), 1e-12)
    return bool(np.max(np.abs(np.asarray(ours) - expected)) <= 1e-9 * scale)


def measured(state: list[float], V_dot: float, nominal: np.void) -> np.void:
    """The FTC_SIM_STATE whose accelerometer gives this V̇."""
    message = np.zeros(1, SIM_STATE)[0]
    x = np.array(state)
    message["velocity"], message["attitude"], message["rates"] = x[3:6], x[6:9], x[9:12]
    gravity = np.array(gravity_body(tuple(x[6:9]), nominal["g"]))
    v = x[3:6]
    message["specific_force"] = -gravity + v / np.linalg.norm(v) * V_dot
    return message


def signals_of(case: Any, vectors: Any, scenario: Scenario, nominal: np.void, i: int) -> np.void:
    """Signals of UAV i's first-window control step, all three UAVs' reports at hand."""
    parameters = parameter_record(scenario.controller, scenario.trigger)
    motions = [
        motion_of(measured(case["states"][k], case["filters"]["V_dot"][k], nominal), nominal)
        for k in range(3)
    ]
    reports = np.zeros(3, NEIGHBOUR)
    for k in range(3):
        fill_neighbour_state(motions[k], 0, reports[k])
    weights = np.array(vectors["adjacency"][i])

    state = new_controller()
    estimates = state["proposed"]
    adaptive, filters, reference = case["adaptive"], case["filters"], case["reference"]
    for ours, theirs in (
        ("Phi_v", "Phi_v"),
        ("g_v", "g_v"),
        ("beta_v", "beta_v"),
        ("Phi_omega", "Phi_w"),
        ("beta_omega", "beta_w"),
    ):
        estimates[ours] = adaptive[theirs][i]
    estimates["omega_d_filtered"] = filters["omega_d_filtered"][i]
    estimates["delta_filtered"] = filters["surface_filtered_rad"][i]
    state["held"][:3] = filters["surface_filtered_rad"][i]  # the filter rests
    state["reference"][0, :2] = reference["V"], reference["V_dot"]
    state["reference"][1:, 0] = reference["attitude_rad"]
    state["reference"][1:, 1] = reference["attitude_rate_rad_s"]
    state["steps"] = state["started"] = 1  # not the first step: filters stand as given
    signals = np.zeros(1, SIGNALS)[0]
    command = state["reference"][:, 0].copy()
    seen = Seen(motions[i], 0, 0, 0, 0)
    inputs = Inputs(0.0, DT, motions[i], seen, command, edges_of(reports, weights), math.inf)
    controls, runway = np.zeros(16, np.float32), np.zeros(1, RUNWAY_STATE)[0]
    control_step(inputs, Records(nominal, parameters, state, controls, signals, runway))
    return signals


@pytest.mark.parametrize("i", range(3))
@pytest.mark.parametrize("number", range(6))
def test_control_step_agrees_with_the_worked_values(
    number: int, i: int, vectors: dict[str, Any], scenario1: Scenario, nominal: np.void
) -> None:
    case = vectors["controller"][number]
    expected = case["expect"][i]
    signals = signals_of(case, vectors, scenario1, nominal, i)
    assert close(signals["sync_error"][0], expected["V_tilde_prime"])
    assert close(signals["sync_error"][1:], expected["e_att_prime"])
    assert close(signals["demand"][3], expected["T_hat"])
    assert close(signals["demand"][:3], expected["delta_hat"])
    for theirs, ours in SCALARS.items():
        assert close(signals[ours], expected[theirs]), theirs


def test_default_parameters_equal_the_worked_values(vectors: dict[str, Any]) -> None:
    p = vectors["controller_parameters"]
    record = parameter_record(Proposed(), PerChannel())
    renamed = {
        "c": "c_v",
        "gamma_w1": "gamma_omega1",
        "gamma_w2": "gamma_omega2",
        "sigma_w1": "sigma_omega1",
        "sigma_w2": "sigma_omega2",
        "h_w1": "h_omega1",
        "h_w2": "h_omega2",
        "eps_w": "eps_omega",
        "tau_omega_d": "tau_omega_d_s",
        "tau_delta": "tau_delta_s",
        "rbf_width": "width",
        "a2": "a2_n",
        "b2": "b2_rad",
    }
    proposed = record["proposed"]
    parts = (record["common"], record["trigger"], proposed, proposed["rbf"])
    ours = {name: part[name] for part in parts for name in part.dtype.names}
    for name, value in p.items():
        if name == "rbf_scale":
            assert ours["speed_scale"] == value[0]
        elif name in {"K1", "K2"}:
            assert list(ours[name][0, 1:]) == value
        else:
            number = np.ravel(ours[renamed.get(name, name)])  # of a schedule the first value
            assert close(number[1] if len(number) > 1 else number[0], value), name
