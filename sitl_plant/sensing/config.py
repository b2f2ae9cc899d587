"""Configuration of the sensors that an autopilot navigates by, and their named classes.

The defaults are the class `consumer`. A turn-on error is drawn once for each axis and each sensor,
from the seed; its standard deviation is given here. `docs/explanation/sensors.md` has the model,
and the source of every number.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, model_validator

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity, whole

Navigation = Annotated[
    Literal["true_state", "estimated"],
    Field(description="Whether an aircraft is handed its true state, or estimates it."),
]

Grade: TypeAlias = Literal["consumer", "tactical", "ideal"]

MAX_IMUS = 3

_RATE = "Samples per second; without it, one each control period."
_LATENCY = "Age of a sample when it is reported, whole control periods."
_CORRELATION = "Time constant of the first-order Gauss-Markov process."
_SCALE = "Turn-on error of the scale factor, as a ratio."


def _rate(default: float | None) -> Any:
    return quantity("Hz", _RATE, default, gt=0.0)


def _latency(default: float) -> Any:
    return quantity("s", _LATENCY, default, ge=0.0, le=1.0)


def _correlation(default: float) -> Any:
    return quantity("s", _CORRELATION, default, gt=0.0, le=1e6)


def _scale(default: float) -> Any:
    return quantity("", _SCALE, default, ge=0.0, le=0.5)


def _size(unit: str, default: float, doc: str) -> Any:
    return quantity(unit, doc, default, ge=0.0)


def _fitted() -> Any:
    return Field(default=True, strict=True, description="Whether there is one.")


def _density(unit: str, default: float) -> Any:
    return _size(unit, default, "One-sided density of the white noise.")


def _noise(unit: str, default: float) -> Any:
    return _size(unit, default, "Standard deviation of the noise of a sample.")


def _instability(unit: str, default: float) -> Any:
    return _size(unit, default, "Peak of the Allan deviation of the bias that changes in flight.")


def _wander(unit: str, default: float) -> Any:
    return _size(unit, default, "Standard deviation of the bias that changes in flight.")


def _turn_on(unit: str, default: float) -> Any:
    return _size(unit, default, "Turn-on bias.")


def _misalignment(default: float) -> Any:
    return _size("deg", default, "Turn-on misalignment of the axes.")


def _range(unit: str, default: float) -> Any:
    return quantity(unit, "Largest value, of either sign.", default, gt=0.0)


def _resolution(unit: str, default: float) -> Any:
    return _size(unit, default, "Step to which samples are rounded; 0: none.")


class Gyro(Model):
    """A gyro of three axes."""

    noise_density_deg_s_sqrt_hz: float = _density("deg/s/sqrt(Hz)", 0.014)
    bias_instability_deg_h: float = _instability("deg/h", 10.0)
    correlation_s: float = _correlation(1000.0)
    turn_on_bias_deg_s: float = _turn_on("deg/s", 0.15)
    scale_error: float = _scale(0.0033)
    misalignment_deg: float = _misalignment(0.19)
    range_deg_s: float = _range("deg/s", 2000.0)
    resolution_deg_s: float = _resolution("deg/s", 0.061)
    rate_hz: float | None = _rate(None)
    latency_s: float = _latency(0.0)


class Accelerometer(Model):
    """An accelerometer of three axes."""

    noise_density_m_s2_sqrt_hz: float = _density("m/s^2/sqrt(Hz)", 0.0019)
    bias_instability_m_s2: float = _instability("m/s^2", 0.0003)
    correlation_s: float = _correlation(300.0)
    turn_on_bias_m_s2: float = _turn_on("m/s^2", 0.02)
    scale_error: float = _scale(0.0017)
    misalignment_deg: float = _misalignment(0.095)
    range_m_s2: float = _range("m/s^2", 235.0)
    resolution_m_s2: float = _resolution("m/s^2", 0.0072)
    rate_hz: float | None = _rate(None)
    latency_s: float = _latency(0.0)


class Magnetometer(Model):
    """A magnetometer of three axes."""

    fitted: bool = _fitted()
    noise_gauss: float = _noise("gauss", 0.003)
    bias_instability_gauss: float = _wander("gauss", 0.0001)
    correlation_s: float = _correlation(600.0)
    hard_iron_gauss: float = _size("gauss", 0.003, "Bias that its calibration has left.")
    scale_error: float = _scale(0.0033)
    misalignment_deg: float = _misalignment(0.5)
    range_gauss: float = _range("gauss", 16.0)
    resolution_gauss: float = _resolution("gauss", 0.003)
    rate_hz: float | None = _rate(100.0)
    latency_s: float = _latency(0.0)


class Barometer(Model):
    """A barometer at an undisturbed static port."""

    fitted: bool = _fitted()
    noise_pa: float = _noise("Pa", 1.0)
    bias_instability_pa: float = _wander("Pa", 2.3)
    correlation_s: float = _correlation(300.0)
    turn_on_bias_pa: float = _turn_on("Pa", 8.0)
    range_pa: float = _range("Pa", 125_000.0)
    resolution_pa: float = _resolution("Pa", 0.016)
    rate_hz: float | None = _rate(50.0)
    latency_s: float = _latency(0.0)


class Pitot(Model):
    """A pitot tube along the x axis, and its differential pressure sensor."""

    fitted: bool = _fitted()
    noise_pa: float = _noise("Pa", 1.0)
    bias_instability_pa: float = _wander("Pa", 0.5)
    correlation_s: float = _correlation(300.0)
    turn_on_bias_pa: float = _turn_on("Pa", 1.0)
    scale_error: float = _scale(0.0033)
    range_pa: float = _range("Pa", 6900.0)
    resolution_pa: float = _resolution("Pa", 1.05)
    rate_hz: float | None = _rate(100.0)
    latency_s: float = _latency(0.0)


class Gnss(Model):
    """A GNSS receiver; errors are the same to the north and to the east.

    Attributes:
        hdop: Dilution of precision, reported.
        vdop: The same of the height.
        satellites: Visible satellites, reported.
    """

    fitted: bool = _fitted()
    horizontal_error_m: float = _size(
        "m", 0.82, "Standard deviation of the correlated error, of each axis."
    )
    vertical_error_m: float = _size("m", 1.24, "The same of the height.")
    correlation_s: float = _correlation(60.0)
    horizontal_noise_m: float = _size("m", 0.2, "Standard deviation of the noise, of each axis.")
    vertical_noise_m: float = _size("m", 0.3, "The same of the height.")
    horizontal_velocity_noise_m_s: float = _size(
        "m/s", 0.05, "Standard deviation of the noise of the velocity, of each axis."
    )
    vertical_velocity_noise_m_s: float = _size("m/s", 0.075, "The same of the vertical velocity.")
    hdop: float = quantity("", default=0.8, ge=0.0, le=99.0)
    vdop: float = quantity("", default=1.2, ge=0.0, le=99.0)
    satellites: int = whole("", default=14, ge=4, le=254)
    rate_hz: float | None = _rate(10.0)
    latency_s: float = _latency(0.2)


_TACTICAL: Mapping[str, Mapping[str, float]] = {
    "gyro": {
        "noise_density_deg_s_sqrt_hz": 0.0035,
        "bias_instability_deg_h": 2.0,
        "turn_on_bias_deg_s": 0.001,
        "scale_error": 0.0009,
        "misalignment_deg": 0.05,
        "range_deg_s": 500.0,
        "resolution_deg_s": 0.0,
    },
    "accelerometer": {
        "noise_density_m_s2_sqrt_hz": 0.001,
        "bias_instability_m_s2": 0.00013,
        "turn_on_bias_m_s2": 0.0086,
        "scale_error": 0.0009,
        "misalignment_deg": 0.05,
        "range_m_s2": 392.0,
        "resolution_m_s2": 0.0,
    },
    "magnetometer": {
        "noise_gauss": 0.00015,
        "hard_iron_gauss": 0.0008,
        "scale_error": 0.0017,
        "misalignment_deg": 0.1,
        "range_gauss": 8.0,
        "resolution_gauss": 0.00013,
    },
    "barometer": {"bias_instability_pa": 1.8, "turn_on_bias_pa": 3.0},
    "pitot": {
        "bias_instability_pa": 0.1,
        "turn_on_bias_pa": 0.2,
        "scale_error": 0.0017,
        "resolution_pa": 0.017,
    },
    "gnss": {
        "horizontal_error_m": 0.4,
        "vertical_error_m": 0.6,
        "horizontal_noise_m": 0.1,
        "vertical_noise_m": 0.15,
        "horizontal_velocity_noise_m_s": 0.03,
        "vertical_velocity_noise_m_s": 0.045,
    },
}

_ERRORS = ("noise", "bias", "error", "misalignment", "hard_iron", "resolution")
"""What is in the name of an error: an ideal sensor has none."""


class NavigationSensors(Model):
    """The sensors that an autopilot navigates by, of every aircraft.

    The grade fills in what is not given of a sensor.

    Attributes:
        grade: Class of the sensors: consumer, tactical, or ideal, which have no errors.
        imus: IMUs, each a gyro and accelerometer.
        gyro: The gyro of each IMU.
        accelerometer: The accelerometer of each IMU.
        magnetometer: The magnetometer.
        barometer: The barometer.
        pitot: The pitot tube.
        gnss: The GNSS receiver.
    """

    grade: Grade = "consumer"
    imus: int = whole("", default=2, ge=1, le=MAX_IMUS)
    gyro: Gyro = Gyro()
    accelerometer: Accelerometer = Accelerometer()
    magnetometer: Magnetometer = Magnetometer()
    barometer: Barometer = Barometer()
    pitot: Pitot = Pitot()
    gnss: Gnss = Gnss()

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, data: Any) -> Any:
        """Fill in what the grade says of each sensor."""
        if not isinstance(data, dict):
            return data
        filled = dict(data)
        for name, of_grade in _grade(data.get("grade")).items():
            given = data.get(name, {})
            if isinstance(given, dict):
                filled[name] = {**of_grade, **given}
        return filled


def _grade(grade: object) -> Mapping[str, Mapping[str, float]]:
    """Return what a grade has otherwise than the defaults, by sensor and key."""
    if grade == "tactical":
        return _TACTICAL
    if grade != "ideal":
        return {}
    sensors = (Gyro, Accelerometer, Magnetometer, Barometer, Pitot, Gnss)
    return {
        model.__name__.lower(): {
            key: 0.0 for key in model.model_fields if any(word in key for word in _ERRORS)
        }
        for model in sensors
    }


class Sensor(Model):
    """Errors of one sensor, the same for each of its axes, in the unit of the sensor's key.

    Attributes:
        noise_rms: Standard deviation of the white noise of a sample.
        bias: Constant error.
        bias_drift: Random walk of the bias: its standard deviation after 1 s.
        resolution: Step to which samples are rounded; 0: none.
        rate_hz: Samples per second; without it, one each control period.
        latency_s: Age of a sample, whole control periods.
    """

    noise_rms: float = quantity("", default=0.0, ge=0.0)
    bias: float = quantity("", default=0.0)
    bias_drift: float = quantity("", default=0.0, ge=0.0)
    resolution: float = quantity("", default=0.0, ge=0.0)
    rate_hz: float | None = quantity("Hz", default=None, gt=0.0)
    latency_s: float = quantity("s", default=0.0, ge=0.0, le=1.0)


class Sensors(Model):
    """The sensors of an aircraft.

    From the ones in `navigation` it estimates its state. The others are on top of the true
    state that it is handed instead; its position and velocity over ground have no error.

    Attributes:
        gyro_deg_s: Angular velocity [deg/s].
        accelerometer_m_s2: Specific force [m/s^2].
        attitude_deg: Roll, pitch, yaw [deg].
        airspeed_m_s: Airspeed [m/s]; the direction of the air has no error.
        navigation: What an estimated state comes from.
    """

    gyro_deg_s: Sensor = Sensor()
    accelerometer_m_s2: Sensor = Sensor()
    attitude_deg: Sensor = Sensor()
    airspeed_m_s: Sensor = Sensor()
    navigation: NavigationSensors = NavigationSensors()

    @property
    def of_true_state(self) -> dict[str, Sensor]:
        """The sensors on top of the true state, by key."""
        return {name: value for name, value in self if isinstance(value, Sensor)}

    @property
    def exact(self) -> bool:
        """Whether those on top of the true state have no error."""
        return all(sensor == Sensor() for sensor in self.of_true_state.values())
