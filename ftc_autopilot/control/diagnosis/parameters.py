"""Parameters of the diagnosis."""

import math
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np
from pydantic import Field

from mavlink_defs.config.models import Model, Renaming
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import RUDDER, THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.actuators.config import ActuatorServos, EngineServo

_Angle = Annotated[float, quantity("deg", gt=0.0, doc="Of one surface.")]
_Time = Annotated[float, quantity("s", gt=0.0, doc="Of one surface.")]
_Angles = tuple[_Angle, _Angle, _Angle]
_Times = tuple[_Time, _Time, _Time]

_M = TypeVar("_M", bound=Model)

_UNLIMITED_DEG_S = 1e6
_MAX_DEAD_TIME_S = 0.1


def _time(default: float, doc: str) -> Any:
    return quantity("s", gt=0.0, default=default, doc=doc)


def _number(default: float, doc: str) -> Any:
    return quantity("", gt=0.0, default=default, doc=doc)


def _force(default: float, doc: str) -> Any:
    return quantity("N", gt=0.0, default=default, doc=doc)


class ThrottleDiagnosis(Model):
    """Parameters of the diagnosis of the throttle, by the names of the surfaces' own."""

    lag_s: float | None = quantity(
        "s", ge=0.0, le=10.0, default=None, doc="Lag of the thrust; from `servos` unless given."
    )
    dead_time_s: float | None = quantity(
        "s", ge=0.0, le=_MAX_DEAD_TIME_S, default=None, doc="Dead time of the thrust; the same."
    )
    window_s: float = _time(0.06, "Window of the regression.")
    jump_n: float = _force(120.0, "Jump of the residual that raises suspicion.")
    excitation_n: float = _force(50.0, "Standard deviation of the command that a decision needs.")
    prior_n: float = _force(
        10.0, "Standard deviation that counts as evidence of full effectiveness."
    )
    confirm_s: float = _time(0.008, "Time for which a loss must be seen.")
    offset_s: float = _time(0.3, "Filter of the offset.")
    dither_n: float = _force(120.0, "Movements of a suspect throttle, up and down.")
    dither_half_s: float = _time(0.06, "Half period of this dither.")
    suspicion_s: float = _time(0.6, "Time for which a suspicion lasts.")
    probe_n: float = _force(100.0, "Movements of a lost throttle.")
    check_s: float = _time(0.3, "Control check: time since the start at which it is moved.")
    return_start_s: float = _time(0.3, "Return test: inhibited until the probe has moved.")

    def with_servo(self, servo: EngineServo) -> Self:
        """Return the parameters with lag and dead time of the servo, where none are given."""
        return _completed(
            self, lag_s=servo.lag_s, dead_time_s=min(servo.dead_time_s, _MAX_DEAD_TIME_S)
        )


class DiagnosisParameters(Renaming):
    """Parameters of the diagnosis; triples are aileron, elevator, rudder.

    Where no other reason is given, a value was found on the scenarios of `scenarios/faults`, ideal,
    realistic and turbulent, and on the random aircraft of the campaign `stuck_surface`: no healthy
    actuator is blamed there, and losses are found soonest.
    """

    SECTION: ClassVar[str] = "controller.diagnosis"

    servo_lag_s: float | None = quantity(
        "s",
        ge=0.0,
        le=10.0,
        default=None,
        doc="Lag of the surfaces' servos, as modelled here; from `servos` unless given.",
    )
    servo_rate_limit_deg_s: float | None = quantity(
        "deg/s", gt=0.0, le=_UNLIMITED_DEG_S, default=None, doc="Their rate limit; the same."
    )
    filter_s: float = quantity(
        "s", gt=0.0, le=1.0, default=0.01, doc="Filter of measurement and command."
    )
    window_s: _Times = Field(
        default=(0.06, 0.06, 0.15), description="Windows of the regression [s]."
    )
    jump_deg: _Angles = Field(
        default=(1.5, 2.0, 3.0), description="Jumps of the residual that raise suspicion [deg]."
    )
    smooth_jump_deg: _Angles = Field(
        default=(0.6, 0.15, 3.0),
        description="Jumps of the smoothed residual that raise suspicion [deg].",
    )
    excitation_deg: _Angles = Field(
        default=(1.0, 1.2, 2.0),
        description="Standard deviations of the command that a decision needs [deg].",
    )
    prior_deg: _Angles = Field(
        default=(0.3, 0.4, 1.0),
        description="Standard deviations that count as evidence of full effectiveness [deg].",
    )
    confirm_s: _Times = Field(
        default=(0.008, 0.005, 0.015), description="Times for which a loss must be seen [s]."
    )
    jump_sigma: float = quantity(
        "", ge=0.0, default=5.0, doc="Jumps are at least this many standard deviations of noise."
    )
    smooth_jump_sigma: float = quantity(
        "", ge=0.0, default=3.5, doc="The same of the smoothed residual."
    )
    lost_effectiveness: float = quantity(
        "", gt=0.0, lt=0.5, default=0.2, doc="An actuator with less is lost."
    )
    offset_s: float = _time(0.06, "Filter of the surfaces' offsets.")
    dither_deg: _Angles = Field(
        default=(4.0, 10.0, 12.0), description="Movements of a suspect surface [deg]."
    )
    dither_half_s: _Times = Field(
        default=(0.035, 0.035, 0.05), description="Half periods of the surfaces' dither [s]."
    )
    dither_ahead_s: float = _time(
        0.005, "Before the end of the blanking time, when a dither begins; the rudder's at once."
    )
    suspicion_s: _Times = Field(
        default=(0.6, 0.6, 0.9), description="Times for which a suspicion lasts [s]."
    )
    probe_deg: _Angles = Field(
        default=(2.0, 2.5, 4.0), description="Movements of a lost surface [deg]."
    )
    trial_deg: _Angles = Field(
        default=(10.0, 10.0, 12.0),
        description="Movements of a surface that has just been lost, to either side [deg].",
    )
    trial_least_s: float = _time(0.2, "Return test: inhibited until it has moved to and fro twice.")
    trial_s: float = _time(0.6, "How long it is moved so.")
    probe_s: float = _time(0.5, "Half period of these movements.")

    check_s: _Times = Field(
        default=(0.06, 0.06, 0.15),
        description="Control check: times since the start at which the surfaces are moved [s].",
    )
    jump_start_s: float = _time(
        0.1, "Jump test: inhibited at first, while the aircraft is trimmed."
    )
    mean_s: float = _time(0.15, "Jump test: memory of the residual's mean (EWMA).")
    smooth_s: float = _time(
        0.015, "Jump test: filter of the smoothed residual, against gyro noise."
    )
    sigma_s: float = _time(5.0, "Jump test: memory of the residual's variance (EWMA).")
    explained_start_s: float = _time(
        2.0, "Jump test: before, nothing that the command explains is subtracted."
    )
    first_sigma_s: float = _time(0.1, "Jump test: memory of the variance at first; it then grows.")
    slight: float = _number(2.0, "Jump test: a jump below this many thresholds is slight.")
    blanking: float = _number(1.5, "Blanking time, in `filter_s`: most of a step has passed then.")
    slight_blanking: float = _number(0.5, "Blanking time after a slight jump, in `filter_s`.")
    holdoff_s: float = _time(0.25, "Hold-off: no second jump counts for this time.")
    cleared_holdoff_s: float = _time(
        0.05, "Hold-off of a cleared suspicion: the dither's way back."
    )
    cooldown_s: float = _time(2.5, "Cooldown after a suspicion, which its dither would renew.")
    early_s: float = _time(0.5, "Cooldown: this much less for a jump that is not slight.")
    remembered: float = _number(0.1, "Share of the long memory that a jump leaves: a reset.")
    drift: float = _number(1.6, "Drift test: threshold, relative to the jump test's.")
    drift_mean_s: float = _time(4.0, "Drift test: memory of the residual's slower mean (EWMA).")
    drift_start_s: float = _time(1.5, "Drift test: inhibited at first, while that mean settles.")
    swings_s: float = _time(1.5, "Swings: memory of the changes to the other side.")
    swing: float = _number(0.75, "Swings: least residual, relative to the jump test's threshold.")
    stop_s: float = _time(0.1, "Stop test: the command at its stop, the residual large, so long.")
    stop_holdoff_s: float = _time(0.2, "Stop test: hold-off after a suspicion that it has raised.")
    stop_swings: float = _number(0.5, "Stop test: more swings, and to have followed says nothing.")
    loss_start_s: float = _time(0.06, "Loss: inhibited at first, while the filters settle.")
    excitation_sigma: float = _number(2.1, "Persistent excitation: least, relative to noise.")
    least_window_s: float = _time(0.006, "Persistent excitation: shortest window.")
    min_response_ratio: float = _number(0.4, "Loss: variance of response over command below this.")
    flat: float = _number(0.17, "Loss: a flat response, relative to the command's movement.")
    flat_sigma: float = _number(2.5, "Loss: the same, in standard deviations of the noise.")
    flat_noise: float = _number(0.25, "Loss: most noise there, relative to the jump threshold.")
    runaway_deg: _Angles = Field(
        default=(12.0, 12.0, 12.0),
        description="Loss: residuals that no working surface has that moves against its command "
        "[deg].",
    )
    runaway_against: float = _number(0.2, "Loss: the same, least slope against the command.")
    lost_margin: float = _number(0.4, "Loss: room for standard errors of the effectiveness.")
    lost_command_sigma: float = _number(1.5, "Loss: these, of the regression on the command.")
    lost_sigma: float = _number(2.5, "Loss: these, of the regression on the dither.")
    dither_memory_s: float = _time(0.15, "Regression on the dither: memory of a suspicion.")
    cleared_sigma: float = _number(2.0, "Cleared: standard errors of that regression.")
    cleared_excitation: float = _number(0.7, "Cleared: excitation, relative to a loss's.")
    cleared_swings: float = _number(1.5, "Cleared: more swings, and the command says nothing.")
    following: float = _number(0.5, "Cleared: effectiveness less its standard error above this.")
    return_start_s: float = _time(0.25, "Return test: inhibited until the probe has moved.")
    return_confirm_s: float = _time(0.05, "Return test: confirmation time.")
    quiet: float = _number(0.75, "Return test: a small residual, relative to the jump threshold.")
    return_effectiveness: float = _number(0.6, "Return test: least effectiveness, long memory.")
    return_way: float = _number(
        2.0, "Return test: a command far from where a surface was, in jump thresholds."
    )
    weak_effectiveness: float = _number(0.13, "Return test: an actuator with less stays lost.")
    weak_sigma: float = _number(5.5, "Return test: standard errors between it and none.")
    relapse_s: float = _time(
        1.0,
        "Relapse: an actuator that is lost again within two cooldowns of its return stays lost "
        "until it has been well for so long, a period of the probe; after each further one twice "
        "as long.",
    )
    relapse_weight: float = _number(10.0, "Relapse: what is not well counts so many times as much.")
    return_r2: float = _number(0.6, "Return test: least coefficient of determination.")

    offset_start_s: float = _time(0.05, "Offsets: none earlier, while the filters fill.")
    transient_s: float = _time(
        0.25, "Blanking time of the other surfaces after a decision about one."
    )
    effectiveness_s: float = _time(0.2, "Filter of an effectiveness that is clearly below 1.")
    long_s: float = _time(0.3, "Longer memory of the regression.")
    throttle: ThrottleDiagnosis = Field(
        default=ThrottleDiagnosis(), description="Of the throttle alone."
    )

    def with_servos(self, servos: ActuatorServos) -> Self:
        """Return the parameters with the slowest of the servos, where none are given."""
        surfaces = (servos.aileron, servos.elevator, servos.rudder)
        limits = [s.rate_limit_deg_s for s in surfaces if s.rate_limit_deg_s is not None]
        return _completed(
            self.model_copy(update={"throttle": self.throttle.with_servo(servos.throttle)}),
            servo_lag_s=max(servo.lag_s for servo in surfaces),
            servo_rate_limit_deg_s=min(limits, default=_UNLIMITED_DEG_S),
        )


def _completed(model: _M, **known: float) -> _M:
    """Return a model with these values where it has none."""
    left_open = {key: value for key, value in known.items() if getattr(model, key) is None}
    return model.model_copy(update=left_open)


class Limits(NamedTuple):
    """The numbers of one actuator, in rad or N and s."""

    jump: float
    smooth_jump: float
    swing: float  # residual of an actuator that swings, to either side
    excitation: float
    runaway: float  # residual of a surface that runs away
    prior: float
    window: float
    confirm: float
    offset: float
    suspicion: float  # how long one lasts
    ahead: float  # of the end of the blanking time, when the dither of a suspect surface begins
    quiet: float  # for which a small residual has lasted through a movement of the probe
    check: float  # time since the start at which it is checked


_MORE_THAN_HALF = 1.04  # a period of the probe


@compiled
def limits_of(gains: np.void, j: int) -> Limits:
    """Return the limits of actuator j from a record made of `DiagnosisParameters`."""
    if j == THROTTLE:
        throttle = gains["throttle"]
        return Limits(
            jump=throttle["jump_n"],
            smooth_jump=math.inf,
            swing=math.inf,
            excitation=throttle["excitation_n"],
            runaway=math.inf,
            prior=throttle["prior_n"],
            window=throttle["window_s"],
            confirm=throttle["confirm_s"],
            offset=throttle["offset_s"],
            suspicion=throttle["suspicion_s"],
            ahead=0.0,
            quiet=math.inf,
            check=throttle["check_s"],
        )
    return Limits(
        jump=gains["jump_rad"][j],
        smooth_jump=gains["smooth_jump_rad"][j],
        swing=gains["swing"] * gains["jump_rad"][j],
        excitation=gains["excitation_rad"][j],
        runaway=gains["runaway_rad"][j],
        prior=gains["prior_rad"][j],
        window=gains["window_s"][j],
        confirm=gains["confirm_s"][j],
        offset=gains["offset_s"],
        suspicion=gains["suspicion_s"][j],
        ahead=math.inf if j == RUDDER else gains["dither_ahead_s"],
        quiet=_MORE_THAN_HALF * gains["probe_s"],
        check=gains["check_s"][j],
    )
