"""A controller's parameters as the compiled code sees them: one flat record."""

import math
from typing import Any

import numpy as np

from ftc_autopilot.config import MAX_NEURONS, MAX_WINDOWS, ControllerParameters, Schedule, Trigger
from ftc_autopilot.trigger import JOINT, PER_CHANNEL
from mavlink_defs.jit import compiled
from sitl_plant.vec3 import Vec3

__all__ = ["PARAMETERS", "parameter_record", "scheduled"]


_SCHEDULE = (MAX_WINDOWS, 4)  # per window: last time [s], then the value, one number or three

_PLAIN = (
    "lambda1", "lambda2", "lambda3", "lambda4",
    "c_v", "eps_v", "gamma_v1", "gamma_v2", "gamma_v3", "sigma_v1", "sigma_v2", "sigma_v3",
    "h_v1", "h_v2",
    "eps_omega", "gamma_omega1", "gamma_omega2", "sigma_omega1", "sigma_omega2",
    "h_omega1", "h_omega2",
    "phi_v0", "g_v0", "beta_v0", "phi_omega0", "beta_omega0",
)  # fmt: skip

PARAMETERS = np.dtype(
    [
        *((name, "f8") for name in _PLAIN),
        ("tau_omega_d", "f8"),  # s
        ("tau_delta", "f8"),  # s
        ("bandwidth", "f8"),  # of the reference filter [rad/s]
        ("a1", "f8", _SCHEDULE),
        ("a2", "f8", _SCHEDULE),  # N
        ("b1", "f8", _SCHEDULE),
        ("b2", "f8", _SCHEDULE),  # rad
        ("K1", "f8", _SCHEDULE),
        ("K2", "f8", _SCHEDULE),
        ("neurons", "i8"),
        ("centres", "f8", (MAX_NEURONS,)),
        ("rbf_width", "f8"),
        ("speed_scale", "f8"),  # s/m
        ("trigger_mode", "i8"),
    ]
)


def parameter_record(controller: ControllerParameters, trigger: Trigger) -> np.void:
    """Turn a controller's and its trigger's configuration into a record of `PARAMETERS`."""
    record: np.void = np.zeros(1, PARAMETERS)[0]
    for name in _PLAIN:
        record[name] = getattr(controller, name)
    record["tau_omega_d"] = controller.tau_omega_d_s
    record["tau_delta"] = controller.tau_delta_s
    record["bandwidth"] = controller.reference_bandwidth_rad_s
    record["a1"] = _schedule_table(trigger.a1)
    record["a2"] = _schedule_table(trigger.a2_n)
    record["b1"] = _schedule_table(trigger.b1)
    record["b2"] = _schedule_table(trigger.b2_deg, math.radians(1.0))
    record["K1"] = _schedule_table(controller.K1)
    record["K2"] = _schedule_table(controller.K2)
    rbf = controller.rbf
    record["neurons"] = rbf.neurons
    record["centres"][: rbf.neurons] = np.linspace(-rbf.span, rbf.span, rbf.neurons)
    record["rbf_width"] = rbf.width
    record["speed_scale"] = rbf.speed_scale
    record["trigger_mode"] = {"per_channel": PER_CHANNEL, "joint": JOINT}[trigger.mode]
    return record


def _schedule_table(schedule: Schedule[Any], unit: float = 1.0) -> np.ndarray:
    table = np.full(_SCHEDULE, math.inf)
    for i, (until, value) in enumerate(schedule.windows()):
        table[i, 0] = until
        table[i, 1:] = np.asarray(value) * unit
    return table


@compiled
def scheduled(table: np.ndarray, t: float) -> Vec3:
    """The value of a schedule at time t [s]; each window includes its last instant."""
    i = 0
    while table[i, 0] < t:
        i += 1
    return table[i, 1], table[i, 2], table[i, 3]
