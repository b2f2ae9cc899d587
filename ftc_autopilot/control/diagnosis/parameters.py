"""Parameters of the diagnosis."""

import math
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np

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


def _time(default: float) -> Any:
    return quantity("s", gt=0.0, default=default)


def _number(default: float) -> Any:
    return quantity("", gt=0.0, default=default)


def _force(default: float) -> Any:
    return quantity("N", gt=0.0, default=default)


class ThrottleDiagnosis(Model):
    """Parameters of the diagnosis of the throttle, by the names of the surfaces' own.

    Attributes:
        lag_s: Lag of the thrust; from `servos` unless given.
        dead_time_s: Dead time of the thrust; the same.
        window_s: Window of the regression.
        jump_n: Jump of the residual that raises suspicion.
        excitation_n: Standard deviation of the command that a decision needs.
        prior_n: Standard deviation that counts as evidence of full effectiveness.
        confirm_s: Time for which a loss must be seen.
        offset_s: Filter of the offset.
        dither_n: Movements of a suspect throttle, up and down.
        dither_half_s: Half period of this dither.
        suspicion_s: Time for which a suspicion lasts.
        probe_n: Movements of a lost throttle.
        check_s: Control check: time since the start at which it is moved.
        return_start_s: Return test: inhibited until the probe has moved.
    """

    lag_s: float | None = quantity("s", ge=0.0, le=10.0, default=None)
    dead_time_s: float | None = quantity("s", ge=0.0, le=_MAX_DEAD_TIME_S, default=None)
    window_s: float = _time(0.06)
    jump_n: float = _force(120.0)
    excitation_n: float = _force(50.0)
    prior_n: float = _force(10.0)
    confirm_s: float = _time(0.008)
    offset_s: float = _time(0.3)
    dither_n: float = _force(120.0)
    dither_half_s: float = _time(0.06)
    suspicion_s: float = _time(0.6)
    probe_n: float = _force(100.0)
    check_s: float = _time(0.3)
    return_start_s: float = _time(0.3)

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

    Attributes:
        servo_lag_s: Lag of the surfaces' servos, as modelled here; from `servos` unless given.
        servo_rate_limit_deg_s: Their rate limit; the same.
        filter_s: Filter of measurement and command.
        window_s: Windows of the regression [s].
        jump_deg: Jumps of the residual that raise suspicion [deg].
        smooth_jump_deg: Jumps of the smoothed residual that raise suspicion [deg].
        excitation_deg: Standard deviations of the command that a decision needs [deg].
        prior_deg: Standard deviations that count as evidence of full effectiveness [deg].
        confirm_s: Times for which a loss must be seen [s].
        jump_sigma: Jumps are at least this many standard deviations of noise.
        smooth_jump_sigma: The same of the smoothed residual.
        lost_effectiveness: An actuator with less is lost.
        offset_s: Filter of the surfaces' offsets.
        dither_deg: Movements of a suspect surface [deg].
        dither_half_s: Half periods of the surfaces' dither [s].
        dither_ahead_s: Before the end of the blanking time, when a dither begins; the rudder's at
            once.
        suspicion_s: Times for which a suspicion lasts [s].
        probe_deg: Movements of a lost surface [deg].
        trial_deg: Movements of a surface that has just been lost, to either side [deg].
        trial_least_s: Return test: inhibited until it has moved to and fro twice.
        trial_s: How long it is moved so.
        probe_s: Half period of these movements.
        check_s: Control check: times since the start at which the surfaces are moved [s].
        jump_start_s: Jump test: inhibited at first, while the aircraft is trimmed.
        mean_s: Jump test: memory of the residual's mean (EWMA).
        smooth_s: Jump test: filter of the smoothed residual, against gyro noise.
        sigma_s: Jump test: memory of the residual's variance (EWMA).
        explained_start_s: Jump test: before, nothing that the command explains is subtracted.
        first_sigma_s: Jump test: memory of the variance at first; it then grows.
        slight: Jump test: a jump below this many thresholds is slight.
        blanking: Blanking time, in `filter_s`: most of a step has passed then.
        slight_blanking: Blanking time after a slight jump, in `filter_s`.
        holdoff_s: Hold-off: no second jump counts for this time.
        cleared_holdoff_s: Hold-off of a cleared suspicion: the dither's way back.
        cooldown_s: Cooldown after a suspicion, which its dither would renew.
        early_s: Cooldown: this much less for a jump that is not slight.
        remembered: Share of the long memory that a jump leaves: a reset.
        drift: Drift test: threshold, relative to the jump test's.
        drift_mean_s: Drift test: memory of the residual's slower mean (EWMA).
        drift_start_s: Drift test: inhibited at first, while that mean settles.
        swings_s: Swings: memory of the changes to the other side.
        swing: Swings: least residual, relative to the jump test's threshold.
        stop_s: Stop test: the command at its stop, the residual large, so long.
        stop_holdoff_s: Stop test: hold-off after a suspicion that it has raised.
        stop_swings: Stop test: more swings, and to have followed says nothing.
        loss_start_s: Loss: inhibited at first, while the filters settle.
        excitation_sigma: Persistent excitation: least, relative to noise.
        least_window_s: Persistent excitation: shortest window.
        min_response_ratio: Loss: variance of response over command below this.
        flat: Loss: a flat response, relative to the command's movement.
        flat_sigma: Loss: the same, in standard deviations of the noise.
        flat_noise: Loss: most noise there, relative to the jump threshold.
        runaway_deg: Loss: residuals that no working surface has that moves against its command
            [deg].
        runaway_against: Loss: the same, least slope against the command.
        lost_margin: Loss: room for standard errors of the effectiveness.
        lost_command_sigma: Loss: these, of the regression on the command.
        lost_sigma: Loss: these, of the regression on the dither.
        against_sigma: Loss: these, by which one that is lost may seem to move against its dither.
        dither_memory_s: Regression on the dither: memory of a suspicion.
        cleared_sigma: Cleared: standard errors of that regression.
        cleared_excitation: Cleared: excitation, relative to a loss's.
        cleared_swings: Cleared: more swings, and the command says nothing.
        following: Cleared: effectiveness less its standard error above this.
        return_start_s: Return test: inhibited until the probe has moved.
        return_confirm_s: Return test: confirmation time.
        quiet: Return test: a small residual, relative to the jump threshold.
        return_effectiveness: Return test: least effectiveness, long memory.
        return_way: Return test: a command far from where a surface was, in jump thresholds.
        weak_effectiveness: Return test: an actuator with less stays lost.
        weak_sigma: Return test: standard errors between it and none.
        relapse_s: Relapse: an actuator that is lost again within two cooldowns of its return stays
            lost until it has been well for so long, a period of the probe; after each further one
            twice as long.
        relapse_weight: Relapse: what is not well counts so many times as much.
        return_r2: Return test: least coefficient of determination.
        offset_start_s: Offsets: none earlier, while the filters fill.
        transient_s: Blanking time of the other surfaces after a decision about one.
        effectiveness_s: Filter of an effectiveness that is clearly below 1.
        long_s: Longer memory of the regression.
        throttle: Of the throttle alone.
    """

    SECTION: ClassVar[str] = "controller.diagnosis"

    servo_lag_s: float | None = quantity("s", ge=0.0, le=10.0, default=None)
    servo_rate_limit_deg_s: float | None = quantity(
        "deg/s", gt=0.0, le=_UNLIMITED_DEG_S, default=None
    )
    filter_s: float = quantity("s", gt=0.0, le=1.0, default=0.01)
    window_s: _Times = (0.06, 0.06, 0.15)
    jump_deg: _Angles = (1.5, 2.0, 3.0)
    smooth_jump_deg: _Angles = (0.6, 0.15, 3.0)
    excitation_deg: _Angles = (1.0, 1.2, 2.0)
    prior_deg: _Angles = (0.3, 0.4, 1.0)
    confirm_s: _Times = (0.008, 0.005, 0.015)
    jump_sigma: float = quantity("", ge=0.0, default=5.0)
    smooth_jump_sigma: float = quantity("", ge=0.0, default=3.5)
    lost_effectiveness: float = quantity("", gt=0.0, lt=0.5, default=0.2)
    offset_s: float = _time(0.06)
    dither_deg: _Angles = (4.0, 10.0, 12.0)
    dither_half_s: _Times = (0.035, 0.035, 0.05)
    dither_ahead_s: float = _time(0.005)
    suspicion_s: _Times = (0.6, 0.6, 0.9)
    probe_deg: _Angles = (2.0, 2.5, 4.0)
    trial_deg: _Angles = (10.0, 10.0, 12.0)
    trial_least_s: float = _time(0.2)
    trial_s: float = _time(0.6)
    probe_s: float = _time(0.5)

    check_s: _Times = (0.06, 0.06, 0.15)
    jump_start_s: float = _time(0.1)
    mean_s: float = _time(0.15)
    smooth_s: float = _time(0.015)
    sigma_s: float = _time(5.0)
    explained_start_s: float = _time(2.0)
    first_sigma_s: float = _time(0.1)
    slight: float = _number(2.0)
    blanking: float = _number(1.5)
    slight_blanking: float = _number(0.5)
    holdoff_s: float = _time(0.25)
    cleared_holdoff_s: float = _time(0.05)
    cooldown_s: float = _time(2.5)
    early_s: float = _time(0.5)
    remembered: float = _number(0.1)
    drift: float = _number(1.6)
    drift_mean_s: float = _time(4.0)
    drift_start_s: float = _time(1.5)
    swings_s: float = _time(1.5)
    swing: float = _number(0.75)
    stop_s: float = _time(0.1)
    stop_holdoff_s: float = _time(0.2)
    stop_swings: float = _number(0.5)
    loss_start_s: float = _time(0.06)
    excitation_sigma: float = _number(2.1)
    least_window_s: float = _time(0.006)
    min_response_ratio: float = _number(0.4)
    flat: float = _number(0.17)
    flat_sigma: float = _number(2.5)
    flat_noise: float = _number(0.25)
    runaway_deg: _Angles = (12.0, 12.0, 12.0)
    runaway_against: float = _number(0.2)
    lost_margin: float = _number(0.4)
    lost_command_sigma: float = _number(1.5)
    lost_sigma: float = _number(2.5)
    against_sigma: float = _number(1.5)
    dither_memory_s: float = _time(0.15)
    cleared_sigma: float = _number(2.0)
    cleared_excitation: float = _number(0.7)
    cleared_swings: float = _number(1.5)
    following: float = _number(0.5)
    return_start_s: float = _time(0.25)
    return_confirm_s: float = _time(0.05)
    quiet: float = _number(0.75)
    return_effectiveness: float = _number(0.6)
    return_way: float = _number(2.0)
    weak_effectiveness: float = _number(0.13)
    weak_sigma: float = _number(5.5)
    relapse_s: float = _time(1.0)
    relapse_weight: float = _number(10.0)
    return_r2: float = _number(0.6)

    offset_start_s: float = _time(0.05)
    transient_s: float = _time(0.25)
    effectiveness_s: float = _time(0.2)
    long_s: float = _time(0.3)
    throttle: ThrottleDiagnosis = ThrottleDiagnosis()

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
