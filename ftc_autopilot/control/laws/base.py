"""Parameters of every control law."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Self, TypeAlias

import numpy as np

from ftc_autopilot.common.records import fill, in_si, record_dtype
from ftc_autopilot.control.triggers import trigger_of
from mavlink_defs.config import renamed
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.airframe.config import Aircraft

_Gain = Annotated[float, quantity("1/s", "Gain of one axis.", gt=0.0, le=500.0)]
Gains: TypeAlias = tuple[_Gain, _Gain, _Gain]

TABLE_III_K1 = (
    {"until_s": 5.0, "value": (50.0, 50.0, 51.0)},
    {"until_s": 15.0, "value": (45.0, 45.0, 45.0)},
    {"value": (40.0, 40.0, 40.0)},
)
TABLE_III_K2 = (
    {"until_s": 5.0, "value": (50.0, 50.0, 51.0)},
    {"until_s": 15.0, "value": (45.0, 45.0, 46.0)},
    {"value": (40.0, 40.0, 40.0)},
)


class LawParameters(Model):
    """Parameters of any control law; a law adds its own parameters, and its `kind`.

    Attributes:
        STATE: The law's memory between steps, all zero before the first step.
        DERIVED: Fields of its record that `derive` fills.
        SELECTS_CHANNELS: Whether the law itself selects which channels are sent, and when: it goes
            with a trigger that leaves this to the law, or one by the clock.
        TRIGGER: Mode of the trigger that it is flown with where a scenario names none.
        FALLBACK: Parameters of a law that it may hand over to, all among its own; in its record
            they are a field `fallback`, as that law's own record.
        LIBRARY: Of a plug-in: file of the shared library with its function, beside the class.
        PAGE: Page of the documentation, or address, that has more. The text of the class says what
            it is, and in its second paragraph when to choose it.
        kind: Name of the law.
        lambda1: Weight of the own speed error (31).
        lambda2: Weight of speed differences (31).
        lambda3: Weight of the own attitude error (32).
        lambda4: Weight of attitude differences (32).
        neighbour_speed_limit_m_s: Largest speed difference to a neighbour that counts.
        neighbour_acceleration_limit_m_s2: Largest acceleration of a neighbour's error that counts.
        neighbour_angle_limit_deg: Largest angle to a neighbour that counts.
        neighbour_rate_limit_deg_s: Largest angle rate of a neighbour's error that counts.
        reference_bandwidth_rad_s: Triple pole of the reference filter (Assumption 4).
        gyro_filter_s: Low-pass of the angular velocities; 0: none.
        delay_s: Known delay of sensors and servos, predicted over.
        predicted_lag_s: Lag of the servos in that prediction; from `servos` unless given.
    """

    STATE: ClassVar[np.dtype] = np.dtype([])
    DERIVED: ClassVar[tuple[tuple[str, str, tuple[int, ...]], ...]] = ()
    SELECTS_CHANNELS: ClassVar[bool] = False
    TRIGGER: ClassVar[str] = "per_channel"
    FALLBACK: ClassVar[type["LawParameters"] | None] = None
    LIBRARY: ClassVar[str | None] = None
    PAGE: ClassVar[str] = ""

    @classmethod
    def record(cls) -> np.dtype:
        """Return the record of the law's own parameters and of what it derives.

        A law that extends one of ours may read renamed fields by their names of before.
        """
        own = record_dtype(cls, cls.FALLBACK or LawParameters)
        section = "" if "SECTION" in cls.__dict__ else getattr(cls, "SECTION", "")
        names = renamed.names_of(section) if section else {}
        before = {in_si(now)[0]: in_si(one)[0] for one, now in names.items()}
        fallback = () if cls.FALLBACK is None else (("fallback", cls.FALLBACK.record()),)
        fields = (((before[n], n) if n in before else n, own[n]) for n in own.names or ())
        return np.dtype([*fallback, *fields, *cls.DERIVED])

    def write_to(self, record: np.void) -> None:
        """Write the parameters to a record of `record`, but for what `derive` computes."""
        fill(record, self)
        if self.FALLBACK is not None:
            fill(record["fallback"], self)

    def derive(self, aircraft: Aircraft, record: np.void) -> None:
        """Compute what the law needs of the nominal aircraft beside its numbers: nothing.

        Args:
            aircraft: The nominal aircraft.
            record: The law's parameters, whose fields `DERIVED` are written.
        """

    def misfits(self, aircraft: Aircraft) -> Iterator[str]:
        """Yield why the law cannot fly a nominal aircraft: nothing."""
        yield from ()

    def holds_heading_by_bank(self, _aircraft: Aircraft) -> str | None:
        """Return why the law holds the heading of an aircraft by bank; None: by the rudder."""
        return None

    kind: str

    lambda1: float = quantity("", default=0.46, gt=0.0)
    lambda2: float = quantity("", default=0.17, ge=0.0)
    lambda3: float = quantity("", default=5.0, gt=0.0)
    lambda4: float = quantity("", default=0.2, ge=0.0)
    neighbour_speed_limit_m_s: float = quantity("m/s", default=1e3, gt=0.0)
    neighbour_acceleration_limit_m_s2: float = quantity("m/s^2", default=1e6, gt=0.0)
    neighbour_angle_limit_deg: float = quantity("deg", default=180.0, gt=0.0, le=180.0)
    neighbour_rate_limit_deg_s: float = quantity("deg/s", default=1e6, gt=0.0)
    reference_bandwidth_rad_s: float = quantity("rad/s", default=2.5, gt=0.0)
    gyro_filter_s: float = quantity("s", default=0.0, ge=0.0, le=1.0)
    delay_s: float = quantity("s", default=0.0, ge=0.0, le=0.1)
    predicted_lag_s: float | None = quantity("s", default=None, ge=0.0, le=10.0)

    @classmethod
    def goes_with(cls, mode: str) -> bool:
        """Return whether a trigger can send the law: by the clock, or if both agree who selects."""
        trigger = trigger_of(mode)
        return trigger.BY_CLOCK or trigger.LAW_SELECTS == cls.SELECTS_CHANNELS

    def by_clock(self) -> tuple[Self, ...]:
        """Return parameters to try where every channel is sent by the clock: these alone.

        A comparison with a clock takes those that track best, so that the clock is not judged by
        parameters that were chosen for events.
        """
        return (self,)

    def with_servos(self, servos: ActuatorServos) -> Self:
        """Return the parameters of an aircraft with these servos, where none are given."""
        if self.predicted_lag_s is not None:
            return self
        surfaces = (servos.aileron, servos.elevator, servos.rudder)
        return self.model_copy(update={"predicted_lag_s": max(one.lag_s for one in surfaces)})
