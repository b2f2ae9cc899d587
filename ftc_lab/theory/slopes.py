"""Right-hand sides of the equations of motion along a recorded flight, one UAV at a time."""

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.air.disturbance import disturbances
from sitl_plant.airframe.rigid_body import STILL_AIR, load_state, state_derivative
from sitl_plant.vec3 import vec3


@compiled
def slopes(
    states: np.ndarray,
    applied: np.ndarray,
    time_s: np.ndarray,
    disturbance: np.ndarray,
    aircraft: np.void,
) -> np.ndarray:
    """Return v̇ [m/s²] and ω̇ [rad/s²] of (2), (4) at each step, shape (steps, 6), body axes.

    Args:
        states: Shape (steps, 12).
        applied: Aileron, elevator, rudder [rad], thrust [N], as applied; (steps, 4).
        time_s: Shape (steps,).
        disturbance: As `sitl_plant.air.disturbance.disturbance_table` returns it.
        aircraft: Record of dtype `sitl_plant.airframe.aircraft.AIRCRAFT`.
    """
    out = np.empty((len(states), 6))
    for k in range(len(states)):
        d_v, d_omega = disturbances(disturbance, time_s[k])
        thrust, delta = applied[k, 3], vec3(applied[k, 0:3])
        state = load_state(states[k])
        slope = state_derivative(state, thrust, delta, d_v, d_omega, STILL_AIR, aircraft)
        for j in range(3):
            out[k, j] = slope[1][j]
            out[k, 3 + j] = slope[3][j]
    return out
