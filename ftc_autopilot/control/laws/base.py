"""Input and output of every control law."""

from collections.abc import Iterator
from typing import ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field

from ftc_autopilot.common.motion import Motion
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.synchronisation_errors import FormationErrors
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity
from sitl_plant.config import Aircraft
from sitl_plant.hardware import ActuatorServos
from sitl_plant.vec3 import Vec3


class LawParameters(Model):
    """Parameters of any control law; a law adds its own parameters, and its `kind`.

    Attributes:
        STATE: The law's memory between steps, all zero before the first step.
        DERIVED: Fields of its record that `derive` fills.
        CHOOSES: Whether the law itself chooses which channels are sent, and when, as trigger mode
            `consequence` needs it. Such a law may be sent by the clock, too.
    """

    STATE: ClassVar[np.dtype] = np.dtype([])
    DERIVED: ClassVar[tuple[tuple[str, str, tuple[int, ...]], ...]] = ()
    CHOOSES: ClassVar[bool] = False

    def derive(self, aircraft: Aircraft, record: np.void) -> None:
        """Compute what the law needs of the nominal aircraft beside its numbers: nothing.

        Args:
            aircraft: The nominal aircraft.
            record: The law's parameters, whose fields `DERIVED` are written.
        """

    def misfits(self, aircraft: Aircraft) -> Iterator[str]:
        """Yield why the law cannot fly a nominal aircraft: nothing."""
        yield from ()

    kind: str = Field(description="Name of the law.")

    lambda1: float = quantity("", gt=0.0, default=0.46, doc="Weight of the own speed error (31).")
    lambda2: float = quantity("", ge=0.0, default=0.17, doc="Weight of speed differences (31).")
    lambda3: float = quantity("", gt=0.0, default=5.0, doc="Weight of the own attitude error (32).")
    lambda4: float = quantity("", ge=0.0, default=0.2, doc="Weight of attitude differences (32).")
    neighbour_speed_limit_m_s: float = quantity(
        "m/s", gt=0.0, default=1e3, doc="Largest speed difference to a neighbour that counts."
    )
    neighbour_acceleration_limit_m_s2: float = quantity(
        "m/s^2", gt=0.0, default=1e6, doc="Largest acceleration of a neighbour's error that counts."
    )
    neighbour_angle_limit_deg: float = quantity(
        "deg", gt=0.0, le=180.0, default=180.0, doc="Largest angle to a neighbour that counts."
    )
    neighbour_rate_limit_deg_s: float = quantity(
        "deg/s", gt=0.0, default=1e6, doc="Largest angle rate of a neighbour's error that counts."
    )
    reference_bandwidth_rad_s: float = quantity(
        "rad/s", gt=0.0, default=2.5, doc="Triple pole of the reference filter (Assumption 4)."
    )
    delay_s: float = quantity(
        "s", ge=0.0, le=0.1, default=0.0, doc="Known delay of sensors and servos, predicted over."
    )

    @classmethod
    def goes_with(cls, mode: str) -> bool:
        """Return whether a trigger can send the law: by the clock any law, else who chooses."""
        return mode == "periodic" or (mode == "consequence") == cls.CHOOSES

    def by_clock(self) -> tuple[Self, ...]:
        """Return parameters to try where every channel is sent by the clock: these alone.

        A comparison with a clock takes those that track best, so that the clock is not judged by
        parameters that were chosen for events.
        """
        return (self,)

    def with_servos(self, servos: ActuatorServos) -> Self:
        """Return the parameters of an aircraft with these servos: the same.

        A law that has a model of the servos takes what its own parameters leave open.
        """
        return self


class Instant(NamedTuple):
    """One control step, as a law sees it."""

    t: float  # time that schedules run on [s]
    dt: float  # control period [s]
    first: bool  # whether this is the law's first step
    motion: Motion  # own motion
    command: np.ndarray  # unfiltered reference: airspeed [m/s], roll, pitch, yaw [rad]
    reference: Reference  # filtered reference
    errors: FormationErrors  # errors against reference and neighbours, (31), (32)
    held: np.ndarray  # commands in force: aileron, elevator, rudder [rad], thrust [N]; read only
    a: tuple[float, float]  # thresholds a1 [-], a2 [N] of (25)
    b: tuple[float, float]  # thresholds b1 [-], b2 [rad] of (29)
    due: int  # mask of the channels that the trigger sends now by the clock
    clock_s: tuple[float, float, float, float]  # its period by channel [s]; 0: no clock


class Demand(NamedTuple):
    """Commands of a law, before saturation and trigger."""

    delta_hat: Vec3  # aileron, elevator, rudder [rad]
    T_hat: float  # thrust [N]
