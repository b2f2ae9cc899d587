"""Backstepping on the nominal model: what compared controller 2 of the paper stands for.

The same errors, virtual control and gains as the proposed law, but the surfaces and the thrust
that the nominal aircraft needs, computed by inverting it: no adaptation, no tolerance of
faults, nothing that depends on a trigger.
"""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ftc_autopilot.common.schedule import Schedule, schedule, scheduled
from ftc_autopilot.control.attitude import filtered_derivative, virtual_control, zeta
from ftc_autopilot.control.inversion import inversion_problem, surfaces_for, thrust_for_speed
from ftc_autopilot.control.laws.base import TABLE_III_K1, TABLE_III_K2, Gains, LawParameters
from ftc_autopilot.control.step import ALL, Command, Step
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import apart
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.airframe.config import Aircraft
from sitl_plant.vec3 import mat3, mul, scale, sub


class Backstepping(LawParameters):
    """Backstepping by the inverse of the nominal model, not adaptive: the paper's comparator.

    Choose it to see what the adaptation of `proposed` is worth; its gains are the same.

    Attributes:
        kind: Name of the law.
        c_v: Gain of the speed error.
        K1: Gains of the attitude errors (57) [1/s].
        K2: Gains of the rate errors [1/s].
        tau_omega_d_s: Filter of omega_d (57).
    """

    PAGE: ClassVar[str] = "explanation/controllers.md"
    STATE: ClassVar[np.dtype] = np.dtype([("omega_d_filtered", "f8", (3,))])  # rad/s

    kind: Literal["backstepping"] = "backstepping"

    c_v: float = quantity("1/s", default=10.0, gt=0.0)
    K1: Schedule[Gains] = schedule(TABLE_III_K1)
    K2: Schedule[Gains] = schedule(TABLE_III_K2)
    tau_omega_d_s: float = quantity("s", default=0.015, gt=0.0)

    def misfits(self, aircraft: Aircraft) -> Iterator[str]:
        """Yield why the law cannot fly a nominal aircraft: its surfaces cannot be inverted."""
        if (problem := inversion_problem(aircraft)) is not None:
            yield problem


@apart(aircraft=AIRCRAFT, gains=Backstepping.record(), state=Backstepping.STATE)
def backstepping_law(
    now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void
) -> Command:
    """Make Ṽ'' = -c_v Ṽ' and ė_ω = -K2 e_ω - λ' R2⁻ᵀ e', if the nominal model were true.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Backstepping`.
        state: Record of dtype `Backstepping.STATE`, updated in place.
    """
    omega_d = virtual_control(now, scheduled(gains["K1"], now.t))
    omega_d_dot = filtered_derivative(
        now, omega_d, gains["tau_omega_d_s"], state["omega_d_filtered"]
    )
    e_omega, K2, none = (
        sub(now.motion.omega, omega_d),
        scheduled(gains["K2"], now.t),
        (0.0, 0.0, 0.0),
    )
    zeta_omega = zeta(now, e_omega, omega_d_dot, K2, none, none, aircraft)
    moment = scale(-1.0, mul(mat3(aircraft["J"]), zeta_omega))
    thrust = thrust_for_speed(now, aircraft, gains["c_v"])
    return Command(surfaces_for(moment, now.motion.air.C), thrust, ALL)
