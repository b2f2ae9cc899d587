"""Our own equations as a simulator like any other: what identification is tested against.

An aircraft given by its coefficients is flown with the same rigid-body motion and aerodynamics as
in the plant, by the classical Runge-Kutta method, its surfaces exactly where they were put.
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aerodynamics import aerodynamics
from sitl_plant.airframe.aircraft import AircraftRecord, aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import (
    R1,
    STILL_AIR,
    Air,
    State,
    advance,
    load_state,
    specific_force,
    state_derivative,
    store_state,
)
from sitl_plant.simulators.base import Body, Motion
from sitl_plant.vec3 import Vec3, mul_t, sub, vec3

STEP_S = 1e-3
"""Step of the integration [s]."""
_NONE = (0.0, 0.0, 0.0)


class OwnSimulator:
    """An aircraft of ours, as `sitl_plant.simulators.base.Simulator`."""

    def __init__(self, aircraft: Aircraft) -> None:
        """Put the aircraft at rest in the origin.

        Args:
            aircraft: The aircraft.
        """
        self.body = Body(
            aircraft.mass_kg,
            aircraft.inertia_kg_m2,
            aircraft.wing_area_m2,
            aircraft.wing_span_m,
            aircraft.mean_chord_m,
            aircraft.air_density_kg_m3,
        )
        self.stops: tuple[tuple[float, float], ...] = tuple(
            (math.radians(low), math.radians(high)) for low, high in aircraft.stops_deg
        )
        self._aircraft = aircraft_record(aircraft)
        self._x = np.zeros(12)
        self._inputs = np.zeros(7)  # aileron, elevator, rudder, thrust, wind
        self._force = np.zeros(3)

    def reset(self, motion: Motion) -> None:
        """Put the aircraft somewhere, its surfaces where `control` last put them."""
        self._x[:] = [*motion.position, *motion.velocity, *motion.attitude, *motion.rates]
        self.advance(0.0)

    def control(self, delta: Vec3, thrust: float) -> None:
        """Put aileron, elevator, rudder [rad] and the thrust along x [N] where they are to be."""
        self._inputs[:4] = [*delta, thrust]

    def set_wind(self, wind: Vec3) -> None:
        """Set the velocity of the air, north, east, down [m/s]."""
        self._inputs[4:] = wind

    def advance(self, dt: float) -> None:
        """Advance by a time [s], a multiple of `STEP_S`."""
        _advance(self._x, self._inputs, round(dt / STEP_S), self._aircraft, self._force)

    def read(self) -> Motion:
        """Return the present motion."""
        p, v, phi, omega, force = (
            (float(a), float(b), float(c)) for a, b, c in (*self._x.reshape(4, 3), self._force)
        )
        return Motion(p, v, phi, omega, force)


@compiled
def _advance(
    x: np.ndarray, inputs: np.ndarray, steps: int, aircraft: AircraftRecord, force: np.ndarray
) -> None:
    """Integrate so many steps in place, and write the specific force at their end [m/s²]."""
    delta, thrust, wind = vec3(inputs[0:3]), inputs[3], vec3(inputs[4:7])
    state = load_state(x)
    for _ in range(steps):
        k1 = _slope(state, delta, thrust, wind, aircraft)
        k2 = _slope(advance(state, 0.5 * STEP_S, k1), delta, thrust, wind, aircraft)
        k3 = _slope(advance(state, 0.5 * STEP_S, k2), delta, thrust, wind, aircraft)
        k4 = _slope(advance(state, STEP_S, k3), delta, thrust, wind, aircraft)
        state = advance(advance(state, STEP_S / 6.0, k1), STEP_S / 3.0, k2)
        state = advance(advance(state, STEP_S / 3.0, k3), STEP_S / 6.0, k4)
    store_state(state, x)
    v = sub(state[1], mul_t(R1(state[2]), wind))
    felt = specific_force(aerodynamics(v, state[3], aircraft), delta, thrust, aircraft)
    for i in range(3):
        force[i] = felt[i]


@compiled
def _slope(state: State, delta: Vec3, thrust: float, wind: Vec3, aircraft: AircraftRecord) -> State:
    air: Air = (mul_t(R1(state[2]), wind), STILL_AIR[1])
    return state_derivative(state, thrust, delta, _NONE, _NONE, air, aircraft)
