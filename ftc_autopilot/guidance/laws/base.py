"""Input and output of every guidance law."""

import math
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import model_validator

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.common.tuples import Four, Rows
from ftc_autopilot.guidance.coordination import Coordination
from ftc_autopilot.guidance.path import PathPoint
from mavlink_defs.config.models import Model, Problems
from mavlink_defs.config.quantity import quantity
from sitl_plant.vec3 import Vec3


class GuidanceParameters(Model):
    """Parameters of any guidance law: its period and the limits of what it may command.

    Attributes:
        STATE: The law's memory between updates, all zero before the first one.
        LIBRARY: Of a plug-in: file of the shared library with its function, beside the class.
        PAGE: Page of the documentation, or address, that has more. The text of the class says what
            it is, and in its second paragraph when to choose it.
        kind: Name of the law.
        period_s: Simulated time between two updates.
        bank_max_deg: Largest bank angle commanded.
        incidence_max_deg: Largest angle of attack that a turn may need; none: 3 deg below the
            aircraft's stall, at most 15.
        climb_max_deg: Steepest climb or descent commanded; none: what 0.9 of the aircraft's thrust
            climbs, at most 20.
        thrust_share_max: Share of the largest thrust that climb and acceleration may take.
        cruise_m_s: Airspeed until a mission sets another; none: 8/9 of the aircraft's cruise_m_s,
            or the geometric mean of its airspeeds.
        wind_max_m_s: Wind that the turns of a path allow for.
        airspeed_min_m_s: Lowest airspeed commanded; none: 3/4 of the aircraft's own cruise here,
            within its limits.
        airspeed_max_m_s: Highest airspeed commanded; none: 3/2 of the aircraft's own cruise here,
            within its limits and its thrust.
        min_altitude_m: Lowest height above home of a place that is flown to.
        max_altitude_m: Greatest height above home of such a place.
        acceleration_max_m_s2: Fastest change of the commanded airspeed; none: by the thrust that
            the aircraft has to spare at its cruise, at most 20.
    """

    STATE: ClassVar[np.dtype] = np.dtype([])
    LIBRARY: ClassVar[str | None] = None
    PAGE: ClassVar[str] = ""

    kind: str

    period_s: float = quantity("s", default=0.02, gt=0.0, le=1.0)
    bank_max_deg: float = quantity("deg", default=40.0, gt=0.0, le=70.0)
    incidence_max_deg: float | None = quantity("deg", default=None, gt=0.0, le=30.0)
    climb_max_deg: float | None = quantity("deg", default=None, gt=0.0, le=45.0)
    thrust_share_max: float = quantity("", default=0.9, gt=0.0, le=1.0)
    cruise_m_s: float | None = quantity("m/s", default=None, gt=0.0)
    wind_max_m_s: float = quantity("m/s", default=5.0, ge=0.0)
    airspeed_min_m_s: float | None = quantity("m/s", default=None, gt=0.0)
    airspeed_max_m_s: float | None = quantity("m/s", default=None, gt=0.0)
    min_altitude_m: float = quantity("m", default=0.0, ge=-10_000.0, le=100_000.0)
    max_altitude_m: float = quantity("m", default=10_000.0, ge=-10_000.0, le=100_000.0)
    acceleration_max_m_s2: float | None = quantity("m/s^2", default=None, gt=0.0)

    @model_validator(mode="after")
    def _ranges_in_order(self) -> "GuidanceParameters":
        ranges = (
            ("airspeed_min_m_s", "airspeed_max_m_s", "m/s"),
            ("min_altitude_m", "max_altitude_m", "m"),
        )
        Problems.check(
            ((least,), f"expected <= {high:g} {unit}, {greatest}, got {low!r}")
            for least, greatest, unit in ranges
            if (low := getattr(self, least)) is not None
            and (high := getattr(self, greatest)) is not None
            and low > high
        )
        return self


class Situation(NamedTuple):
    """What a guidance law, ours or a plug-in's, knows of the flight at an update.

    In memory it begins with struct ftc_guidance_input, which ends with `motion`.
    """

    dt: float  # time since the update before [s]
    s: float  # path parameter [m]
    bandwidth: float  # of the reference filter, its triple pole [rad/s]
    command: Four  # in force; a plug-in gets what `path` commands [m/s, rad]
    position: Vec3  # NED [m]
    velocity: Vec3  # over ground, NED [m/s]
    air_velocity: Vec3  # through the air, NED [m/s]
    reference: Rows  # filtered reference and its two derivatives [m/s, rad]
    coordination: Coordination  # slot and corrections of the formation
    here: PathPoint  # the path at s
    motion: MeasuredMotion  # own motion
    off: float  # how far the UAV is to the right of the path [m]
    level: float = math.nan  # height to climb to in place of the path's [m]; NaN: the path's
    over_ground: int = 0  # 1: the climb is held over the ground, not through the air
    nose: float = math.nan  # heading in place of the one that the course takes [rad]; NaN: none
    glide: float = math.nan  # thrust of a glide, in which pitch holds the airspeed [N]; NaN: none


class Pace(NamedTuple):
    """How a UAV gets on along its path."""

    s: float  # path parameter [m]
    s_dot: float  # its time derivative [m/s]
    speed: float  # over ground, that the path asks for where the formation is [m/s]


class Intention(NamedTuple):
    """Velocity over ground that a guidance law asks for, and where the UAV is beside its slot."""

    course: float  # of the path [rad]
    along: float  # [m/s]
    right: float  # of the path [m/s]
    up: float  # [m/s]
    off_right: float  # of the slot [m]
    off_up: float  # above the slot [m]
