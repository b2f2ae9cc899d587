"""Configuration of an ArduPilot SITL that flies the aircraft: which output moves which actuator.

Output channels are numbered as SERVO1_FUNCTION and the like number them. The defaults are
ArduPlane's without mixers: aileron, elevator, throttle, rudder on 1 to 4; 1000 to 2000 µs, as its
own model of a plane (SIM_Plane.cpp) takes them.
"""

from typing import Annotated, Any

from pydantic import Field, model_validator

from mavlink_defs.config.models import Model, Problems, repeated
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.faults.sensors import SensorName

CHANNELS = (16, 32)
"""Outputs in a packet of ArduPilot, without and with SERVO_32_ENABLE."""
PORT = 9002
"""UDP port of the physics for the first instance of ArduPilot."""
PORTS_APART = 10
"""Instance k of ArduPilot (its option -I k) sends to the port so many times k higher."""
_BEFORE = {"hold", "launch_throttle"}
"""Keys of earlier versions, which run folders have."""

JSON_INSTRUMENTS: tuple[SensorName, ...] = ("gyro", "accelerometer", "gps", "airspeed")
"""What the JSON interface shows: all else ArduPilot makes of position and attitude."""

Channel = Annotated[int, whole("", "Output channel.", ge=1, le=CHANNELS[-1])]
Pulse = Annotated[float, quantity("us", "Length of a pulse.", ge=500.0, le=2500.0)]


class ThrottleOutput(Model):
    """The output that commands the thrust, from none to full.

    Attributes:
        min_us: Pulse of no thrust, as SERVO3_MIN.
        max_us: Pulse of full thrust, as SERVO3_MAX.
    """

    channel: Channel = 3
    min_us: Pulse = 1000.0
    max_us: Pulse = 2000.0

    @model_validator(mode="after")
    def _in_order(self) -> "ThrottleOutput":
        if self.max_us <= self.min_us:
            text = f"expected > min_us = {self.min_us:g} us, got {self.max_us:g}"
            raise Problems([(("max_us",), text)])
        return self


class SurfaceOutput(Model):
    """An output that moves a surface; longer pulses turn the aircraft right, or its nose up.

    Attributes:
        min_us: Pulse at one stop, as SERVOn_MIN.
        trim_us: Pulse in the middle, as SERVOn_TRIM.
        max_us: Pulse at the other stop, as SERVOn_MAX.
        reversed: Longer pulses turn left, or the nose down.
    """

    channel: Channel
    min_us: Pulse = 1000.0
    trim_us: Pulse = 1500.0
    max_us: Pulse = 2000.0
    reversed: bool = Field(default=False, strict=True)

    @model_validator(mode="after")
    def _in_order(self) -> "SurfaceOutput":
        if not self.min_us < self.trim_us < self.max_us:
            limits = f"between min_us = {self.min_us:g} and max_us = {self.max_us:g} us"
            raise Problems([(("trim_us",), f"expected {limits}, got {self.trim_us:g}")])
        return self


class ArduPilot(Model):
    """What an ArduPilot SITL needs to fly the aircraft in place of the scenario's law.

    Attributes:
        aileron: Output of the aileron.
        elevator: Output of the elevator.
        rudder: Output of the rudder.
        throttle: Output of the throttle.
        launch_acceleration_m_s2: Acceleration of the launch.
    """

    aileron: SurfaceOutput = SurfaceOutput(channel=1)
    elevator: SurfaceOutput = SurfaceOutput(channel=2)
    rudder: SurfaceOutput = SurfaceOutput(channel=4)
    throttle: ThrottleOutput = ThrottleOutput()
    launch_acceleration_m_s2: float = quantity("m/s^2", default=15.0, gt=0.0, le=1000.0)

    @model_validator(mode="before")
    @classmethod
    def _of_before(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        return {key: value for key, value in data.items() if key not in _BEFORE}

    @property
    def surfaces(self) -> tuple[SurfaceOutput, SurfaceOutput, SurfaceOutput]:
        """Outputs of aileron, elevator, rudder."""
        return self.aileron, self.elevator, self.rudder

    @model_validator(mode="after")
    def _channels_differ(self) -> "ArduPilot":
        names = ("aileron", "elevator", "rudder", "throttle")
        channels = [getattr(self, name).channel for name in names]
        Problems.check(((names[i], "channel"), text) for i, text in repeated(channels))
        return self
