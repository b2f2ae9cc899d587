"""A guidance law of nine arguments."""

from ftc_autopilot.guidance.laws.base import GuidanceParameters
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled


class Gentle(GuidanceParameters):
    """Half the bank, and some airspeed on top."""

    faster_m_s: float = quantity("m/s", default=2.0, doc="Added to the airspeed.")

    @staticmethod
    @compiled
    def step(now, path, s, coordination, aircraft, limits, gains, state, command):
        """Return airspeed [m/s], roll, pitch, yaw [rad]."""
        airspeed, roll, pitch, yaw = command
        faster = gains["faster_m_s"] + 0.0 * (path["height"][0] + s + limits["airspeed_max_m_s"])
        return airspeed + faster, 0.5 * roll, pitch, yaw
