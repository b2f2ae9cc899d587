"""What one control step computes, as it is recorded."""

import numpy as np

from mavlink_defs.constants import N_CHANNELS

_ESTIMATES = ("Phi_v", "g_v", "beta_v", "Phi_omega", "beta_omega")

SIGNALS = np.dtype(
    [
        ("V", "f8"),  # m/s
        ("V_dot", "f8"),  # m/s²
        ("attitude", "f8", (3,)),  # rad
        ("command", "f8", (4,)),  # unfiltered reference
        ("reference", "f8", (4,)),  # filtered
        ("reference_dot", "f8", (4,)),
        ("error", "f8", (4,)),  # Ṽ and e
        ("sync_error", "f8", (4,)),  # Ṽ' and e', eqs. (31), (32)
        ("demand", "f8", (N_CHANNELS,)),  # δ̂ and T̂ before saturation
        ("held", "f8", (N_CHANNELS,)),  # δ_0 and T_x0
        ("path_position", "f8"),  # path parameter [m], NaN unless a path is flown
        ("report_size", "u1"),  # bytes of FTC_NEIGHBOUR from report on, less zeros at the end
        ("slot", "f8", (3,)),  # in force: ahead, to the right, up [m], NaN in the same way
        ("events", "u1"),  # bit per channel
        ("not_finite", "u1"),  # bit per channel: its demand was not finite, and not sent
        ("neighbour_message", "u1"),  # 1: sent in this step, which is not the first
        *((name, "f8") for name in _ESTIMATES),
        *((f"{name}_dot", "f8") for name in _ESTIMATES),
        ("basis", "f8"),  # ςᵀς
        *((name, "f8") for name in ("alpha_v", "r_v", "zeta_v", "B_v")),
        *((name, "f8", (3,)) for name in ("omega_d", "omega_d_dot", "e_omega", "zeta_omega")),
        ("effectiveness", "f8", (N_CHANNELS,)),  # diagnosis: in use
        ("offset", "f8", (N_CHANNELS,)),  # of an actuator in service; where a lost one stands
        ("confidence", "f8", (N_CHANNELS,)),  # 1 - standard error of the effectiveness
        ("predicted_exit", "f8", (N_CHANNELS,)),  # time until its output leaves the tube [s]
        ("dead_steps", "u1"),  # dead time that it has found [control periods]
        ("phase", "u1", (N_CHANNELS,)),  # as `ftc_autopilot.control.diagnosis` numbers them
    ]
)
"""Quantities computed in one control step. Channels of references and errors: airspeed [m/s], roll,
pitch, yaw [rad]; of commands: aileron, elevator, rudder [rad], thrust [N]."""


def no_signals(steps: int) -> np.ndarray:
    """Return `SIGNALS` of steps without control: NaN, no events, no diagnosis, shape (steps,)."""
    signals = np.zeros(steps, SIGNALS)
    for name in SIGNALS.names or ():
        if SIGNALS[name].base.kind == "f":
            signals[name] = np.nan
    return signals
