"""Parameters and state of the tube law."""

from typing import Annotated, ClassVar, Literal, Self

import numpy as np

from ftc_autopilot.control.laws.base import Gains, LawParameters
from ftc_autopilot.control.laws.surviving.parameters import FaultTolerant, Surviving
from ftc_autopilot.control.pairing import is_coupled, joint_moves
from ftc_autopilot.control.triggers.scaled import Scaled
from mavlink_defs.config.models import Renaming
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from sitl_plant.airframe.aircraft import AIRCRAFT
from sitl_plant.airframe.config import Aircraft

OUTPUTS = 4
"""Outputs that have a tube: airspeed [m/s], roll, pitch, yaw [rad]."""
AIRSPEED, ROLL, PITCH, YAW = range(OUTPUTS)
CHANNELS = (THROTTLE, AILERON, ELEVATOR, RUDDER)
"""By output: the channel that is its own."""

_Width = Annotated[float, quantity("deg", gt=0.0, doc="Half the width of an angle's tube.")]
_Share = Annotated[float, quantity("", ge=0.0, doc="Of one output.")]
_Time = Annotated[float, quantity("s", ge=0.0, doc="Of one output.")]
_Rate = Annotated[float, quantity("deg/s", gt=0.0, doc="Of one angle.")]
_Shares = tuple[_Share, _Share, _Share, _Share]
_Times = tuple[_Time, _Time, _Time, _Time]


class Tube(Renaming, FaultTolerant):
    """Predicts what follows from not sending, and sends only where the aircraft would leave a tube.

    Choose it where messages are dear; it goes with the trigger `consequence`, and `surviving` is
    its fallback.

    Lists of three are roll, pitch, yaw; of four, airspeed, roll, pitch, yaw.

    Attributes:
        kind: Name of the law.
        K1: Gains of the attitude errors [1/s].
        K2: Gains of the rate errors [1/s].
        tube_scale: Width of all tubes, relative: messages against error.
        survive: Whether the surviving law takes over when an actuator is lost; false: its diagnosis
            only reports.
        width_m_s: Half the width of the airspeed's tube.
        width_deg: Half the widths of the angles' tubes [deg].
        widening: Widening of a tube by the distance of reference from command.
        funnel_s: Time in which an error outside its tube must shrink to 1/e.
        return_m_s2: Fastest return of the airspeed from outside.
        return_deg_s: Fastest return of the angles from outside [deg/s].
        check_s: Time between two checks.
        lead_s: Times before the predicted exit at which a channel is sent [s]; the servos' lag
            comes on top.
        dwell_s: Shortest time between two events of a channel.
        gain_s: Least delay of the exit that is worth an event.
        prediction_step_s: Step of the prediction.
        prediction_steps: Steps of the prediction that plans a command.
        settle_s: Times after an event from which on the plan keeps an error in its tube [s].
        plan_share: Share of its tube that a plan uses.
        force_observer_s: Memory of the observer of the specific force.
        rates_observer_s: Memory of the observer of the angular velocity.
        persistence_s: Time for which a disturbance is expected to keep changing.
        adapt: Whether the strength of aileron and elevator and the damping of pitch are identified
            in flight; false: the nominal ones.
        adaptation_memory_s: Memory of the identification.
        adaptation_prior: Integral of the squared excitation at which half of an error is believed.
        adaptation_smooth_s: Band-pass filter of its signals: memory of the low pass.
        adaptation_slow_s: The same: memory of the means that are subtracted.
        adaptation_residual_rad_s2: Residual from which on Huber's weights decrease.
        fallback_s: Time for which the surviving law flies after the last loss.
        fallback_threshold: Thresholds of (25) and (29) while the surviving law flies, relative to
            the trigger's.
        fallback_error_deg: Roll or pitch error at which it takes over as well.
        event_rate_limit: Events of a channel in about a second at which it does, too.
        event_rate_cooldown_s: For how long it does then; twice as long each further time.
    """

    SECTION: ClassVar[str] = "controller"
    PAGE: ClassVar[str] = "explanation/tube.md"
    SELECTS_CHANNELS: ClassVar[bool] = True
    TRIGGER: ClassVar[str] = "consequence"
    FALLBACK: ClassVar[type[LawParameters] | None] = Surviving
    DERIVED: ClassVar[tuple[tuple[str, str, tuple[int, ...]], ...]] = (
        ("coupled", "i8", ()),  # 1: aileron and rudder go together
        ("moves", "f8", (OUTPUTS, N_CHANNELS)),  # then, of channels by the plan of an output
    )
    STATE: ClassVar[np.dtype] = np.dtype(
        [
            ("fallback", Surviving.STATE),
            # disturbance observer
            ("v", "f8", (3,)),  # velocity through the air a step ago [m/s]
            ("omega", "f8", (3,)),  # estimate of the angular velocity [rad/s]
            ("disturbance", "f8", (6,)),  # of v̇ [m/s²] and ω̇ [rad/s²]
            ("disturbance_slope", "f8", (6,)),  # per s
            # adaptation
            ("model", AIRCRAFT),  # the nominal aircraft with the derivatives found
            ("means", "f8", (3, 2, 3)),  # of the band-pass filter [rad/s²]
            ("information", "f8", (2, 2, 2)),  # ∑ x xᵀ dt of every axis [rad²/s³]
            ("evidence", "f8", (2, 2)),  # ∑ x y dt [rad²/s³]
            ("derivative_error", "f8", (2, 2)),  # by the nominal derivative
            # of one step; here, since an array made in each takes time
            ("positions", "f8", (N_CHANNELS,)),  # of the servos [rad, N]
            ("commands", "f8", (N_CHANNELS,)),  # in force [rad, N]
            # events
            ("step", "i8"),  # steps made
            ("sent", "i8", (N_CHANNELS,)),  # step of a channel's last event
            ("exit", "f8", (N_CHANNELS,)),  # time until the output's predicted exit [s]
            # the fallback
            ("dither", "f8", (N_CHANNELS,)),  # in the commands in force
            ("fallback_left", "f8"),  # time for which it still flies [s]
            ("event_rate", "f8", (N_CHANNELS,)),  # events that are forgotten within a second
            ("rate_exceeded", "i8"),  # times that there were too many
            ("noise", Scaled.STATE),  # of the fallback's commands
        ]
    )

    def by_clock(self) -> tuple[Self, ...]:
        """Return the parameters with three widths of the tube: the best depends on the period."""
        scales = (self.tube_scale * share for share in (1.0, 0.5, 0.25))
        return tuple(self.model_copy(update={"tube_scale": scale}) for scale in scales)

    def derive(self, aircraft: Aircraft, record: np.void) -> None:
        """Compute the gains of the fallback's loops, and how coupled surfaces go together."""
        super().derive(aircraft, record["fallback"])
        moves = np.zeros((OUTPUTS, N_CHANNELS))
        moves[range(OUTPUTS), CHANNELS] = 1.0
        if is_coupled(aircraft):
            moves[np.ix_((ROLL, YAW), (AILERON, RUDDER))] = joint_moves(aircraft)
        record["coupled"], record["moves"] = is_coupled(aircraft), moves

    kind: Literal["tube"] = "tube"

    K1: Gains = (8.0, 8.0, 4.0)
    K2: Gains = (20.0, 20.0, 15.0)

    tube_scale: float = quantity("", gt=0.0, default=1.0)
    survive: bool = True

    width_m_s: float = quantity("m/s", gt=0.0, default=0.22)
    width_deg: tuple[_Width, _Width, _Width] = (0.30, 0.14, 1.22)
    widening: _Shares = (0.18, 0.135, 0.06, 0.07)
    funnel_s: float = quantity("s", gt=0.0, default=0.37)
    return_m_s2: float = quantity("m/s^2", gt=0.0, default=100.0)
    return_deg_s: tuple[_Rate, _Rate, _Rate] = (60.0, 40.0, 12.0)

    check_s: float = quantity("s", gt=0.0, le=0.1, default=0.004)
    lead_s: _Times = (0.105, 0.06, 0.09, 0.15)
    dwell_s: float = quantity("s", ge=0.0, default=0.05)
    gain_s: float = quantity("s", ge=0.0, default=0.02)

    prediction_step_s: float = quantity("s", gt=0.0, le=0.1, default=0.015)
    prediction_steps: int = whole("steps", ge=2, le=400, default=40)
    settle_s: _Times = (0.195, 0.075, 0.075, 0.435)
    plan_share: _Shares = (0.51, 0.897, 0.757, 0.85)

    force_observer_s: float = quantity("s", gt=0.0, le=10.0, default=0.03)
    rates_observer_s: float = quantity("s", gt=0.0, le=10.0, default=0.06)
    persistence_s: float = quantity("s", gt=0.0, default=0.13)

    adapt: bool = True
    adaptation_memory_s: float = quantity("s", gt=0.0, default=20.0)
    adaptation_prior: float = quantity("rad^2/s^3", gt=0.0, default=0.1)

    adaptation_smooth_s: float = quantity("s", gt=0.0, default=0.03)
    adaptation_slow_s: float = quantity("s", gt=0.0, default=0.09)
    adaptation_residual_rad_s2: float = quantity("rad/s^2", gt=0.0, default=0.15)

    fallback_s: float = quantity("s", gt=0.0, default=0.5)
    fallback_threshold: float = quantity("", gt=0.0, default=2.0)
    fallback_error_deg: float = quantity("deg", gt=0.0, default=15.0)
    event_rate_limit: float = quantity("", gt=0.0, default=17.0)
    event_rate_cooldown_s: float = quantity("s", ge=0.0, default=5.0)
