"""Parameters of the diagnosis."""

import math
from typing import Annotated, NamedTuple, Self

import numpy as np
from pydantic import Field

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import RUDDER, THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.hardware import ActuatorServos

_Angle = Annotated[float, quantity("deg", gt=0.0, doc="Of one surface.")]
_Time = Annotated[float, quantity("s", gt=0.0, doc="Of one surface.")]
_Angles = tuple[_Angle, _Angle, _Angle]
_Times = tuple[_Time, _Time, _Time]

_UNLIMITED_DEG_S = 1e6


class DiagnosisParameters(Model):
    """Parameters of the diagnosis; triples are aileron, elevator, rudder.

    Where no other reason is given, a value was found on the scenarios of `scenarios/faults`, ideal,
    realistic and turbulent, and on the random aircraft of the campaign `stuck_surface`: no healthy
    actuator is blamed there, and losses are found soonest.
    """

    servo_lag_s: float | None = quantity(
        "s",
        ge=0.0,
        le=10.0,
        default=None,
        doc="Lag of the servos, as the diagnosis models them; from `servos` unless given.",
    )
    servo_rate_limit_deg_s: float | None = quantity(
        "deg/s", gt=0.0, le=_UNLIMITED_DEG_S, default=None, doc="Their rate limit; the same."
    )
    throttle_lag_s: float | None = quantity(
        "s", ge=0.0, le=10.0, default=None, doc="Lag of the thrust; the same."
    )
    filter_s: float = quantity(
        "s", gt=0.0, le=1.0, default=0.01, doc="Filter of measurement and command."
    )
    window_s: _Times = Field(
        default=(0.06, 0.06, 0.15), description="Windows of the regression [s]."
    )
    throttle_window_s: float = quantity(
        "s", gt=0.0, default=0.06, doc="Window of the throttle's regression."
    )
    jump_deg: _Angles = Field(
        default=(1.5, 2.0, 3.0), description="Jumps of the residual that raise suspicion [deg]."
    )
    jump_n: float = quantity("N", gt=0.0, default=120.0, doc="The throttle's.")
    smooth_jump_deg: _Angles = Field(
        default=(0.6, 0.15, 3.0),
        description="Jumps of the smoothed residual that raise suspicion [deg].",
    )
    excitation_deg: _Angles = Field(
        default=(1.0, 1.2, 2.0),
        description="Standard deviations of the command that a decision needs [deg].",
    )
    excitation_n: float = quantity("N", gt=0.0, default=50.0, doc="The throttle's.")
    prior_deg: _Angles = Field(
        default=(0.3, 0.4, 1.0),
        description="Standard deviations that count as evidence of full effectiveness [deg].",
    )
    prior_n: float = quantity("N", gt=0.0, default=10.0, doc="The throttle's.")
    confirm_s: _Times = Field(
        default=(0.008, 0.005, 0.015), description="Times for which a loss must be seen [s]."
    )
    throttle_confirm_s: float = quantity("s", gt=0.0, default=0.008, doc="The throttle's.")
    jump_sigma: float = quantity(
        "", ge=0.0, default=5.0, doc="Jumps are at least this many standard deviations of noise."
    )
    smooth_jump_sigma: float = quantity(
        "", ge=0.0, default=3.5, doc="The same of the smoothed residual."
    )
    lost_effectiveness: float = quantity(
        "", gt=0.0, lt=0.5, default=0.2, doc="An actuator with less is lost."
    )
    offset_s: float = quantity("s", gt=0.0, default=0.06, doc="Filter of the surfaces' offsets.")
    throttle_offset_s: float = quantity("s", gt=0.0, default=0.3, doc="The throttle's.")
    dither_deg: _Angles = Field(
        default=(4.0, 10.0, 12.0), description="Movements of a suspect surface [deg]."
    )
    probe_deg: _Angles = Field(
        default=(2.0, 2.5, 4.0), description="Movements of a lost surface [deg]."
    )
    probe_s: float = quantity("s", gt=0.0, default=0.5, doc="Half period of the latter.")

    jump_start_s: float = quantity(
        "s", ge=0.0, default=0.3, doc="Jump test: start-up inhibit, while the aircraft is trimmed."
    )
    mean_s: float = quantity(
        "s", gt=0.0, default=0.15, doc="Jump test: memory of the residual's mean (EWMA)."
    )
    smooth_s: float = quantity(
        "s",
        gt=0.0,
        default=0.015,
        doc="Jump test: filter of the smoothed residual, against gyro noise.",
    )
    sigma_s: float = quantity(
        "s", gt=0.0, default=5.0, doc="Jump test: memory of the residual's variance (EWMA)."
    )
    first_sigma_s: float = quantity(
        "s",
        gt=0.0,
        default=0.1,
        doc="Jump test: memory of the variance at first, which then grows.",
    )
    slight: float = quantity(
        "", ge=1.0, default=2.0, doc="Jump test: a jump below this many thresholds is slight."
    )
    blanking: float = quantity(
        "", ge=0.0, default=1.5, doc="Blanking time by `filter_s`: most of a step has passed it."
    )
    slight_blanking: float = quantity(
        "", ge=0.0, default=0.5, doc="Blanking time after a slight jump, by `filter_s`."
    )
    holdoff_s: float = quantity(
        "s", ge=0.0, default=0.25, doc="Hold-off: no second jump counts for this time."
    )
    cleared_holdoff_s: float = quantity(
        "s", ge=0.0, default=0.05, doc="Hold-off after a cleared suspicion: the dither's way back."
    )
    cooldown_s: float = quantity(
        "s", ge=0.0, default=2.5, doc="Cooldown after a suspicion, which its dither would renew."
    )
    early_s: float = quantity(
        "s", ge=0.0, default=0.5, doc="Cooldown: this much less for a jump that is not slight."
    )
    remembered: float = quantity(
        "", ge=0.0, le=1.0, default=0.1, doc="Share of the long memory that a jump leaves (reset)."
    )
    drift: float = quantity(
        "", gt=0.0, default=1.6, doc="Drift test: threshold by that of the jump test."
    )
    drift_mean_s: float = quantity(
        "s", gt=0.0, default=4.0, doc="Drift test: memory of the residual's slower mean (EWMA)."
    )
    drift_start_s: float = quantity(
        "s", ge=0.0, default=1.5, doc="Drift test: start-up inhibit, while that mean settles."
    )
    loss_start_s: float = quantity(
        "s", ge=0.0, default=0.5, doc="Loss: start-up inhibit of the decision."
    )
    excitation_sigma: float = quantity(
        "", ge=0.0, default=2.1, doc="Persistent excitation: least, by the residual's deviation."
    )
    least_window_s: float = quantity(
        "s", ge=0.0, default=0.006, doc="Persistent excitation: shortest window."
    )
    min_response_ratio: float = quantity(
        "", gt=0.0, default=0.4, doc="Loss: variance of the response by the command's below this."
    )
    lost_margin: float = quantity(
        "", ge=0.0, default=0.4, doc="Loss: room of 1.5 standard errors above `lost_effectiveness`."
    )
    following: float = quantity(
        "", gt=0.0, lt=1.0, default=0.5, doc="Cleared: effectiveness less its error above this."
    )
    return_start_s: float = quantity(
        "s", ge=0.0, default=0.25, doc="Return test: none sooner, the probe has to move first."
    )
    throttle_return_start_s: float = quantity(
        "s", ge=0.0, default=0.3, doc="Return test: the same of the throttle's long memory."
    )
    return_confirm_s: float = quantity(
        "s", ge=0.0, default=0.05, doc="Return test: confirmation time."
    )
    quiet: float = quantity(
        "", gt=0.0, default=0.75, doc="Return test: a small residual, by the threshold of a jump."
    )
    return_effectiveness: float = quantity(
        "",
        gt=0.0,
        lt=1.0,
        default=0.6,
        doc="Return test: least effectiveness over the long memory.",
    )
    return_r2: float = quantity(
        "", gt=0.0, lt=1.0, default=0.6, doc="Return test: least coefficient of determination R²."
    )

    def with_servos(self, servos: ActuatorServos) -> Self:
        """Return the parameters with the slowest of the servos, where none are given."""
        surfaces = (servos.aileron, servos.elevator, servos.rudder)
        limits = [s.rate_limit_deg_s for s in surfaces if s.rate_limit_deg_s is not None]
        known = {
            "servo_lag_s": max(servo.lag_s for servo in surfaces),
            "servo_rate_limit_deg_s": min(limits, default=_UNLIMITED_DEG_S),
            "throttle_lag_s": servos.throttle.lag_s,
        }
        left_open = {key: value for key, value in known.items() if getattr(self, key) is None}
        return self.model_copy(update=left_open)


class Limits(NamedTuple):
    """The numbers of one actuator, in rad or N and s."""

    jump: float
    smooth_jump: float
    excitation: float
    prior: float
    window: float
    confirm: float
    offset: float
    suspicion: float  # how long one lasts
    ahead: float  # of the end of the blanking time, when the dither of a suspect surface begins
    quiet: float  # for which a small residual has lasted through a movement of the probe


_MORE_THAN_HALF = 1.04  # a period of the probe
_SUSPICION_S, _RUDDER_SUSPICION_S = 0.6, 0.9
_AHEAD_S = 0.005  # most of the movement comes after the blanking time; the rudder's begins at once


@compiled
def limits_of(gains: np.void, j: int) -> Limits:
    """Return the limits of actuator j from a record made of `DiagnosisParameters`."""
    if j == THROTTLE:
        return Limits(
            gains["jump_n"],
            math.inf,
            gains["excitation_n"],
            gains["prior_n"],
            gains["throttle_window_s"],
            gains["throttle_confirm_s"],
            gains["throttle_offset_s"],
            _SUSPICION_S,
            0.0,
            math.inf,
        )
    return Limits(
        gains["jump_rad"][j],
        gains["smooth_jump_rad"][j],
        gains["excitation_rad"][j],
        gains["prior_rad"][j],
        gains["window_s"][j],
        gains["confirm_s"][j],
        gains["offset_s"],
        _RUDDER_SUSPICION_S if j == RUDDER else _SUSPICION_S,
        math.inf if j == RUDDER else _AHEAD_S,
        _MORE_THAN_HALF * gains["probe_s"],
    )
