"""Parameters and state of the surviving law."""

import warnings
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, Self

import numpy as np

from ftc_autopilot.control.diagnosis import DIAGNOSIS, DiagnosisParameters
from ftc_autopilot.control.heading import needs_bank, weathercock_problem
from ftc_autopilot.control.inversion import inversion_problem
from ftc_autopilot.control.laws.base import Gains, LawParameters
from ftc_autopilot.control.laws.surviving.gains import (
    AIRSPEEDS,
    LATERAL,
    LONGITUDINAL,
    LoopWeights,
    gains_of,
)
from mavlink_defs.config.quantity import quantity
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.airframe.config import Aircraft

_RateLimit = Annotated[float, quantity("deg/s", "Limit of an Euler angle's rate.", gt=0.0)]
_AccelerationLimit = Annotated[
    float, quantity("rad/s^2", "Limit of a commanded rate's derivative.", gt=0.0)
]


class FaultTolerant(LawParameters):
    """Parameters of the surviving law, or of it as a fallback; triples are roll, pitch, yaw.

    Attributes:
        neighbour_speed_limit_m_s: Largest speed difference to a neighbour that counts.
        neighbour_acceleration_limit_m_s2: Largest acceleration of a neighbour's error that counts.
        neighbour_angle_limit_deg: Largest angle to a neighbour that counts.
        neighbour_rate_limit_deg_s: Largest angle rate of a neighbour's error that counts.
        K1: Gains of the attitude errors [1/s].
        K2: Gains of the rate errors [1/s].
        rate_limit_deg_s: Limits of the Euler angle rates that errors ask for [deg/s].
        full_gain_airspeed_m_s: Airspeed below which the gains decrease.
        tau_omega_d_s: Filter of the commanded rates.
        acceleration_limit_rad_s2: Limits of the commanded rates' derivatives [rad/s^2].
        c_v: Gain of the speed error.
        alpha_limit_deg: Angle of attack above which the nose is lowered.
        pitch_lowering_1_s: Rate at which the nose is lowered, by that excess.
        pitch_rate_1_s: Largest pitch rate, by the distance from that limit.
        stop_memory_s: Memory of a rudder that is at its stop without the aileron.
        driving_deg_s: Rate at which a lost aileron is then driven to help.
        roll_room_deg: Healthy aileron's deflection that the sideslip of turns leaves to the roll.
        pitch_error_limit_deg: With the elevator lost, the speed is held up to this error.
        pitch_integral_limit_rad_s: Limit of the pitch error's integral in that loop.
        loops: Weights of the loops without a surface, whose gains follow at the start.
        heading: What holds the heading; auto: bank, if there is no rudder or sideslip grows while
            it holds the heading.
        heading_gain_1_s: Gain of the heading by bank; 0: the largest without overshoot.
        bank_limit_deg: Largest bank that the heading asks for.
        reconfigure: Whether the other actuators take over from a lost one; false only corrects
            offset and effectiveness.
        diagnosis: Diagnosis of the actuators.
    """

    STATE: ClassVar[np.dtype] = np.dtype(
        [
            ("diagnosis", DIAGNOSIS),
            ("omega_d_filtered", "f8", (3,)),  # rad/s
            ("pitch_lowered", "f8"),  # of the reference, for the angle of attack, <= 0 [rad]
            ("slows_turn", "i8"),  # 1: the aileron cannot hold the roll in the turn asked for
            ("gave_up_speed", "i8"),  # 1: the thrust holds the pitch angle
            ("pitch_integral", "f8"),  # rad s
            ("rudder_mean", "f8"),  # rad
            ("aileron_driven", "f8"),  # rad
            ("aileron_tried", "f8"),  # about which it is moved while it may be only weak [rad]
        ]
    )
    DERIVED: ClassVar[tuple[tuple[str, str, tuple[int, ...]], ...]] = (
        ("airspeeds", "f8", (AIRSPEEDS,)),  # m/s
        ("rudder_gains", "f8", (AIRSPEEDS, LATERAL)),
        ("thrust_gains", "f8", (AIRSPEEDS, LONGITUDINAL)),
        ("by_bank", "i8", ()),  # 1: heading is held by bank
    )

    neighbour_speed_limit_m_s: float = quantity("m/s", default=2.0, gt=0.0)
    neighbour_acceleration_limit_m_s2: float = quantity("m/s^2", default=2.0, gt=0.0)
    neighbour_angle_limit_deg: float = quantity("deg", default=5.0, gt=0.0, le=180.0)
    neighbour_rate_limit_deg_s: float = quantity("deg/s", default=20.0, gt=0.0)

    K1: Gains = (11.5, 10.5, 5.2)
    K2: Gains = (25.0, 24.0, 18.0)
    rate_limit_deg_s: tuple[_RateLimit, _RateLimit, _RateLimit] = (
        60.0,
        40.0,
        12.0,
    )  # wings level, 60 deg/s of yaw would be -50 deg of sideslip
    full_gain_airspeed_m_s: float = quantity("m/s", default=37.0, gt=0.0)
    tau_omega_d_s: float = quantity("s", default=0.015, gt=0.0)
    acceleration_limit_rad_s2: tuple[_AccelerationLimit, _AccelerationLimit, _AccelerationLimit] = (
        20.0,
        20.0,
        10.0,
    )
    c_v: float = quantity("1/s", default=10.5, gt=0.0, le=100.0)
    alpha_limit_deg: float = quantity("deg", default=33.0, gt=0.0, lt=90.0)
    pitch_lowering_1_s: float = quantity("1/s", default=2.0, gt=0.0)
    pitch_rate_1_s: float = quantity("1/s", default=3.0, gt=0.0)
    stop_memory_s: float = quantity("s", default=0.7, gt=0.0)
    driving_deg_s: float = quantity("deg/s", default=40.0, gt=0.0)
    roll_room_deg: float = quantity(
        "deg", default=1.5, gt=0.0
    )  # K1 K2 ask for it at 0.6 deg of roll error
    pitch_error_limit_deg: float = quantity("deg", default=3.0, ge=0.0)
    pitch_integral_limit_rad_s: float = quantity("rad s", default=0.6, gt=0.0)
    loops: LoopWeights = LoopWeights()
    heading: Literal["auto", "rudder", "bank"] = "auto"
    heading_gain_1_s: float = quantity("1/s", default=0.0, ge=0.0, le=10.0)
    bank_limit_deg: float = quantity("deg", default=40.0, gt=0.0, le=70.0)
    reconfigure: bool = True
    diagnosis: DiagnosisParameters = DiagnosisParameters()

    def misfits(self, aircraft: Aircraft) -> Iterator[str]:
        """Yield why the law cannot fly a nominal aircraft: neither inversion nor gains exist."""
        problem = inversion_problem(aircraft, needs_rudder=False) or weathercock_problem(aircraft)
        if problem is not None:
            yield problem
            return
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
                gains_of(aircraft, self.loops)
        except ValueError:  # of the linear algebra, which names neither aircraft nor cause
            yield "rudder or thrust alone cannot hold it, so that the loops without a surface fail"

    def holds_heading_by_bank(self, aircraft: Aircraft) -> str | None:
        """Return why the heading of an aircraft is held by bank; None if the rudder holds it."""
        if self.heading == "auto":
            return needs_bank(aircraft)
        return "chosen" if self.heading == "bank" else None

    def derive(self, aircraft: Aircraft, record: np.void) -> None:
        """Compute the gains of the reconfigured loops, and choose what holds the heading."""
        record["by_bank"] = self.holds_heading_by_bank(aircraft) is not None
        gains = gains_of(aircraft, self.loops)
        record["airspeeds"] = gains.airspeeds
        record["rudder_gains"], record["thrust_gains"] = gains.rudder, gains.thrust

    def with_servos(self, servos: ActuatorServos) -> Self:
        """Return the parameters with a diagnosis that knows the servos."""
        diagnosis = self.diagnosis.with_servos(servos)
        return super().with_servos(servos).model_copy(update={"diagnosis": diagnosis})


class Surviving(FaultTolerant):
    """Diagnoses its own actuators, and flies on with one of them lost.

    Choose it wherever actuators or sensors may fail: first, if you are in doubt. Its trigger is
    `scaled`, unless a scenario names another.

    Attributes:
        kind: Name of the law.
    """

    PAGE: ClassVar[str] = "explanation/surviving.md"
    TRIGGER: ClassVar[str] = "scaled"
    kind: Literal["surviving"] = "surviving"
