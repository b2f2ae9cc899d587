"""Configuration of servos and engine: what is between a control law and the aircraft.

Everything is ideal by default. Delays and sampling periods are whole numbers of control periods,
so that nothing changes its value within an integration step but what is solved exactly.
"""

from mavlink_defs.config.models import Model
from mavlink_defs.config.periods import Found, period_problems
from mavlink_defs.config.quantity import quantity


class Servo(Model):
    """What a servo of either kind has.

    Attributes:
        lag_s: Time constant of the first-order lag; 0: none.
        dead_time_s: Delay of every command, whole control periods.
    """

    lag_s: float = quantity("s", default=0.0, ge=0.0, le=10.0)
    dead_time_s: float = quantity("s", default=0.0, ge=0.0, le=1.0)


class SurfaceServo(Servo):
    """Servo of a control surface; angles are the surface's.

    Attributes:
        rate_limit_deg_s: Highest rate; without it, unlimited.
        backlash_deg: Full width of the play between servo and surface.
        resolution_deg: Step to which commands are rounded; 0: none.
    """

    rate_limit_deg_s: float | None = quantity("deg/s", default=None, gt=0.0)
    backlash_deg: float = quantity("deg", default=0.0, ge=0.0, le=45.0)
    resolution_deg: float = quantity("deg", default=0.0, ge=0.0, le=45.0)


class EngineServo(Servo):
    """Throttle, engine and propeller, from the commanded thrust to the real one.

    The lag is the larger one of this and the aircraft's own, `propulsion.lag_s`.

    Attributes:
        rate_limit_n_s: Highest rate of thrust; without it, unlimited.
        resolution_n: Step to which commands are rounded; 0: none.
    """

    rate_limit_n_s: float | None = quantity("N/s", default=None, gt=0.0)
    resolution_n: float = quantity("N", default=0.0, ge=0.0)


class ActuatorServos(Model):
    """The servos of one aircraft, by actuator.

    Attributes:
        aileron: Of the aileron.
        elevator: Of the elevator.
        rudder: Of the rudder.
        throttle: Of the throttle.
    """

    aileron: SurfaceServo = SurfaceServo()
    elevator: SurfaceServo = SurfaceServo()
    rudder: SurfaceServo = SurfaceServo()
    throttle: EngineServo = EngineServo()

    def with_engine_lag(self, lag_s: float) -> "ActuatorServos":
        """Return the servos with an engine's own lag [s], of which and theirs the larger counts."""
        if lag_s <= self.throttle.lag_s:
            return self
        throttle = self.throttle.model_copy(update={"lag_s": lag_s})
        return self.model_copy(update={"throttle": throttle})


class Servos(Model):
    """The servos of an aircraft as a scenario has them: one for all surfaces, or by surface.

    Attributes:
        surfaces: Of every surface that has no servo of its own here.
        aileron: Of the aileron, in place of `surfaces`.
        elevator: Of the elevator, in place of `surfaces`.
        rudder: Of the rudder, in place of `surfaces`.
        throttle: Of the throttle.
    """

    surfaces: SurfaceServo = SurfaceServo()
    aileron: SurfaceServo | None = None
    elevator: SurfaceServo | None = None
    rudder: SurfaceServo | None = None
    throttle: EngineServo = EngineServo()

    def by_actuator(self) -> ActuatorServos:
        """Return the servo of each actuator."""
        return ActuatorServos(
            aileron=self.aileron or self.surfaces,
            elevator=self.elevator or self.surfaces,
            rudder=self.rudder or self.surfaces,
            throttle=self.throttle,
        )


def servo_problems(servos: Servos | ActuatorServos, step_us: int) -> Found:
    """Yield place and text of what servos cannot do at a control period [µs]."""
    for name in type(servos).model_fields:
        servo = getattr(servos, name)
        if servo is not None:
            yield from period_problems((name, "dead_time_s"), servo.dead_time_s, step_us)
