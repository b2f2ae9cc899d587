"""Surfaces proportional to attitude error and body rate; thrust to the speed error, integrated."""

from typing import ClassVar

import numpy as np

from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command, Step
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import clamp


class Law(LawParameters):
    """Proportional surfaces, and a thrust that finds its trim.

    The keys of `controller` in a scenario are the fields, and so are the vehicle's parameters.
    """

    STATE: ClassVar[np.dtype] = np.dtype([("thrust_integral", "f8")])  # N; 0 before the first step

    attitude_gain: float = quantity("", "Deflection per error.", 2.0, gt=0.0)
    rate_gain_s: float = quantity("s", "Deflection per body rate.", 0.5, ge=0.0)
    limit_deg: float = quantity("deg", "Largest deflection.", 40.0, gt=0.0, le=90.0)
    speed_gain_n_s_m: float = quantity("N s/m", "Thrust per error.", 300.0, gt=0.0)
    speed_integral_n_m: float = quantity("N/m", "Gain of its integral.", 100.0, ge=0.0)
    thrust_trim_n: float = quantity("N", "Thrust in cruise.", 900.0, ge=0.0)

    @staticmethod
    @compiled
    def step(now: Step, aircraft: np.void, gains: np.void, state: np.void) -> Command:
        """Evaluate the law once in each control step; a positive deflection makes a negative moment.

        Args:
            now: Time, own motion, reference, errors, held commands.
            aircraft: The nominal aircraft, SI units and radians.
            gains: The parameters, SI units and radians: `limit_deg` is `limit_rad`.
            state: `STATE`, updated in place.
        """
        e, omega, limit = now.errors.e, now.motion.omega, gains["limit_rad"]
        k, d = gains["attitude_gain"], gains["rate_gain_s"]
        slow = -now.errors.V_tilde
        thrust = gains["thrust_trim_n"] + gains["speed_gain_n_s_m"] * slow
        thrust += state["thrust_integral"]
        if 0.0 < thrust < aircraft["thrust_limit"]:
            state["thrust_integral"] += now.dt * gains["speed_integral_n_m"] * slow
        delta = (
            clamp(k * e[0] + d * omega[0], -limit, limit),
            clamp(k * e[1] + d * omega[1], -limit, limit),
            clamp(k * e[2] + d * omega[2], -limit, limit),
        )
        return Command(delta, thrust, ALL)
