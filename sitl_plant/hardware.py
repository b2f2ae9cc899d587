"""Configuration of servos, engine and sensors: what is between a control law and the aircraft.

Everything is ideal by default. Delays and sampling periods are whole numbers of control periods,
so that nothing changes its value within an integration step but what is solved exactly.
"""

from collections.abc import Iterator
from typing import TypeAlias

from pydantic import Field

from mavlink_defs.config.models import Loc, Model
from mavlink_defs.config.quantity import quantity
from sitl_plant.navigation_sensors import NavigationSensors
from sitl_plant.observability import fitted, unobservable

_Found: TypeAlias = Iterator[tuple[Loc, str]]


class Servo(Model):
    """What a servo of either kind has."""

    lag_s: float = quantity(
        "s", ge=0.0, le=10.0, default=0.0, doc="Time constant of the first-order lag; 0: none."
    )
    dead_time_s: float = quantity(
        "s", ge=0.0, le=1.0, default=0.0, doc="Delay of every command, whole control periods."
    )


class SurfaceServo(Servo):
    """Servo of a control surface; angles are the surface's."""

    rate_limit_deg_s: float | None = quantity(
        "deg/s", gt=0.0, default=None, doc="Highest rate; without it, unlimited."
    )
    backlash_deg: float = quantity(
        "deg", ge=0.0, le=45.0, default=0.0, doc="Full width of the play between servo and surface."
    )
    resolution_deg: float = quantity(
        "deg", ge=0.0, le=45.0, default=0.0, doc="Step to which commands are rounded; 0: none."
    )


class EngineServo(Servo):
    """Throttle, engine and propeller, from the commanded thrust to the real one.

    The lag is the larger one of this and the aircraft's own, `propulsion.lag_s`.
    """

    rate_limit_n_s: float | None = quantity(
        "N/s", gt=0.0, default=None, doc="Highest rate of thrust; without it, unlimited."
    )
    resolution_n: float = quantity(
        "N", ge=0.0, default=0.0, doc="Step to which commands are rounded; 0: none."
    )


class ActuatorServos(Model):
    """The servos of one aircraft, by actuator."""

    aileron: SurfaceServo = Field(default=SurfaceServo(), description="Of the aileron.")
    elevator: SurfaceServo = Field(default=SurfaceServo(), description="Of the elevator.")
    rudder: SurfaceServo = Field(default=SurfaceServo(), description="Of the rudder.")
    throttle: EngineServo = Field(default=EngineServo(), description="Of the throttle.")

    def with_engine_lag(self, lag_s: float) -> "ActuatorServos":
        """Return the servos with an engine's own lag [s], of which and theirs the larger counts."""
        if lag_s <= self.throttle.lag_s:
            return self
        throttle = self.throttle.model_copy(update={"lag_s": lag_s})
        return self.model_copy(update={"throttle": throttle})


class Servos(Model):
    """The servos of an aircraft as a scenario has them: one for all surfaces, or by surface."""

    surfaces: SurfaceServo = Field(
        default=SurfaceServo(), description="Of every surface that has no servo of its own here."
    )
    aileron: SurfaceServo | None = Field(
        default=None, description="Of the aileron, in place of `surfaces`."
    )
    elevator: SurfaceServo | None = Field(
        default=None, description="Of the elevator, in place of `surfaces`."
    )
    rudder: SurfaceServo | None = Field(
        default=None, description="Of the rudder, in place of `surfaces`."
    )
    throttle: EngineServo = Field(default=EngineServo(), description="Of the throttle.")

    def by_actuator(self) -> ActuatorServos:
        """Return the servo of each actuator."""
        return ActuatorServos(
            aileron=self.aileron or self.surfaces,
            elevator=self.elevator or self.surfaces,
            rudder=self.rudder or self.surfaces,
            throttle=self.throttle,
        )


class Sensor(Model):
    """Errors of one sensor, the same for each of its axes, in the unit of the sensor's key."""

    noise_rms: float = quantity(
        "", ge=0.0, default=0.0, doc="Standard deviation of the white noise of a sample."
    )
    bias: float = quantity("", default=0.0, doc="Constant error.")
    bias_drift: float = quantity(
        "", ge=0.0, default=0.0, doc="Random walk of the bias: its standard deviation after 1 s."
    )
    resolution: float = quantity(
        "", ge=0.0, default=0.0, doc="Step to which samples are rounded; 0: none."
    )
    rate_hz: float | None = quantity(
        "Hz", gt=0.0, default=None, doc="Samples per second; without it, one each control period."
    )
    latency_s: float = quantity(
        "s", ge=0.0, le=1.0, default=0.0, doc="Age of a sample, whole control periods."
    )


class Sensors(Model):
    """The sensors of an aircraft.

    Those of `navigation` are what it estimates its state from. The others are on top of the true
    state that it is handed instead; its position and velocity over ground have no error.
    """

    gyro_deg_s: Sensor = Field(default=Sensor(), description="Angular velocity [deg/s].")
    accelerometer_m_s2: Sensor = Field(default=Sensor(), description="Specific force [m/s^2].")
    attitude_deg: Sensor = Field(default=Sensor(), description="Roll, pitch, yaw [deg].")
    airspeed_m_s: Sensor = Field(
        default=Sensor(), description="Airspeed [m/s]; the direction of the air has no error."
    )
    navigation: NavigationSensors = Field(
        default=NavigationSensors(), description="What an estimated state comes from."
    )

    @property
    def of_true_state(self) -> dict[str, Sensor]:
        """The sensors on top of the true state, by key."""
        return {name: value for name, value in self if isinstance(value, Sensor)}

    @property
    def exact(self) -> bool:
        """Whether those on top of the true state have no error."""
        return all(sensor == Sensor() for sensor in self.of_true_state.values())


def servo_problems(servos: Servos | ActuatorServos, step_us: int) -> _Found:
    """Yield place and text of what servos cannot do at a control period [µs]."""
    for name in type(servos).model_fields:
        servo = getattr(servos, name)
        if servo is not None:
            yield from period_problems((name, "dead_time_s"), servo.dead_time_s, step_us)


def sensor_problems(sensors: Sensors, step_us: int) -> _Found:
    """Yield place and text of what sensors on top of the true state cannot do at a period [µs]."""
    for name, sensor in sensors.of_true_state.items():
        yield from period_problems((name, "latency_s"), sensor.latency_s, step_us)
        yield from rate_problems((name, "rate_hz"), sensor.rate_hz, step_us)


def navigation_problems(sensors: Sensors, step_us: int) -> _Found:
    """Yield place and text of why nobody can navigate by sensors at a control period [µs]."""
    for name, sensor in sensors.of_true_state.items():
        if sensor != Sensor():
            text = "is of the true state, and the flight is by an estimated one: leave it out, or"
            yield (name,), f"{text} set the errors of sensors.navigation"
    navigation = sensors.navigation
    for name in fitted(navigation):
        sensor = getattr(navigation, name)
        loc: Loc = ("navigation", name)
        yield from period_problems((*loc, "latency_s"), sensor.latency_s, step_us)
        yield from rate_problems((*loc, "rate_hz"), sensor.rate_hz, step_us)
    for at, text in unobservable(navigation):
        yield ("navigation", *at), text


def rate_problems(loc: Loc, rate_hz: float | None, step_us: int) -> _Found:
    """Yield place and text if a rate is no whole number of control periods [µs] from the next."""
    if rate_hz is None:
        return
    periods = 1e6 / (rate_hz * step_us)
    if round(periods) < 1 or not _is_whole(periods):
        fewer = max(int(periods), 1)
        near = " or ".join(f"{1e6 / (n * step_us):.6g}" for n in (fewer, fewer + 1))
        text = f"expected a sample every 1, 2, 3, ... control periods of {step_us} us, such as"
        yield loc, f"{text} {near} Hz, got {rate_hz!r}"


def period_problems(loc: Loc, delay_s: float, step_us: int) -> _Found:
    """Yield place and text if a time [s] is no whole number of control periods [µs]."""
    if not _is_whole(delay_s * 1e6 / step_us):
        text = f"expected a whole number of control periods of {step_us} us, got {delay_s!r} s"
        yield loc, text


def _is_whole(number: float) -> bool:
    return abs(number - round(number)) < 1e-6
