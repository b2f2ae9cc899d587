"""Configuration of a PX4 SITL that flies the aircraft: which output moves which actuator.

Outputs are numbered as PWM_MAIN_FUNC1 and the like number them: output 1 is controls[0] of
HIL_ACTUATOR_CONTROLS. The defaults are of PX4's plane in simulation (airframe 1030, as 1033, 1036
and 1039): rudder on 3, motor on 5, left and right aileron on 6 and 7, elevator on 8.
"""

from typing import Annotated

from pydantic import Field, model_validator

from mavlink_defs.config.models import AtMost, Model, Problems
from mavlink_defs.config.quantity import quantity, whole

OUTPUTS = 16
"""Of HIL_ACTUATOR_CONTROLS."""

Output = Annotated[int, whole("", "Output.", ge=1, le=OUTPUTS)]


class MotorOutput(Model):
    """The output that commands the thrust, from none to full.

    Attributes:
        output: Number of the output.
        off: Value of no thrust.
        full: Value of full thrust.
    """

    output: Output = 5
    off: float = quantity("", default=0.0, ge=-1.0, le=1.0)
    full: float = quantity("", default=1.0, ge=-1.0, le=1.0)

    @model_validator(mode="after")
    def _in_order(self) -> "MotorOutput":
        if self.full <= self.off:
            raise Problems([(("full",), f"expected > off = {self.off:g}, got {self.full:g}")])
        return self


class ServoOutput(Model):
    """An output that moves a surface; greater values turn the aircraft right, or its nose up.

    Attributes:
        output: Number of the output.
        least: Value at one stop.
        middle: Value in the middle.
        greatest: Value at the other stop.
        reversed: Greater values turn left, or the nose down.
    """

    output: Output
    least: float = quantity("", default=-1.0, ge=-1.0, le=1.0)
    middle: float = quantity("", default=0.0, ge=-1.0, le=1.0)
    greatest: float = quantity("", default=1.0, ge=-1.0, le=1.0)
    reversed: bool = Field(default=False, strict=True)

    @model_validator(mode="after")
    def _in_order(self) -> "ServoOutput":
        if not self.least < self.middle < self.greatest:
            limits = f"between least = {self.least:g} and greatest = {self.greatest:g}"
            raise Problems([(("middle",), f"expected {limits}, got {self.middle:g}")])
        return self


ServoOutputs = Annotated[tuple[ServoOutput, ...], AtMost(OUTPUTS), Field(min_length=1)]


class Px4Outputs(Model):
    """What moves the actuators of an aircraft that PX4 flies.

    A surface that several outputs move, as two ailerons, is commanded by their mean. An output may
    move several: elevons are two outputs of aileron and elevator, one of them reversed in the
    aileron.

    Attributes:
        aileron: Outputs of the ailerons.
        elevator: Outputs of the elevator.
        rudder: Outputs of the rudder; none: nothing moves it.
        throttle: Output of the motor.
    """

    aileron: ServoOutputs = (ServoOutput(output=6, reversed=True), ServoOutput(output=7))
    elevator: ServoOutputs = (ServoOutput(output=8),)
    rudder: Annotated[tuple[ServoOutput, ...], AtMost(OUTPUTS)] = (ServoOutput(output=3),)
    throttle: MotorOutput = MotorOutput()

    @property
    def surfaces(self) -> tuple[tuple[ServoOutput, ...], ...]:
        """Outputs of aileron, elevator, rudder."""
        return self.aileron, self.elevator, self.rudder

    @model_validator(mode="after")
    def _motor_is_alone(self) -> "Px4Outputs":
        motor = self.throttle.output
        names = "aileron", "elevator", "rudder"
        Problems.check(
            ((name, i, "output"), f"expected another one than the throttle's, got {motor}")
            for name, outputs in zip(names, self.surfaces, strict=True)
            for i, one in enumerate(outputs)
            if one.output == motor
        )
        return self
