"""What the estimator assumes of its sensors, the air and the aircraft, as compiled code sees it."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.estimation.parameters import EstimatorParameters
from mavlink_defs.origin import Origin
from sitl_plant.airframe.aerodynamics import carried_linearly, lateral
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.sensing.errors import gauss_markov, white_noise
from sitl_plant.sensing.geomagnetism import magnetic_field

_DEGREE = math.radians(1.0)
_CM, _DEGE7_M = 0.01, 0.011
"""Resolutions of HIL_GPS: of the velocity [m/s], of the position [m]."""
_PA_PER_M = 11.3
"""Change of the static pressure with altitude, at 600 m in the standard atmosphere [Pa/m]."""
_FORCE_CHANGE = 0.3
"""Of the specific force along an axis [m/s²/sqrt(s)]: its scale error then is another bias."""
_USUAL_DEFLECTION = math.radians(5.0)
"""Of aileron and rudder, which the estimator does not know."""
_MARGIN = 1.5
"""Of variances of errors that turn with the aircraft, for what a linear filter makes of them."""
_UNTIMELY_M = 0.1
"""Of the barometer's altitude, by the age of a fix with which it is compared [m]."""
_MIN_GYRO, _MIN_ACCELEROMETER = 2e-3, 2e-2
"""Noise that samples have at least, in the tests of it [rad/s, m/s²]: float32, and the motion."""

PARAMETERS = np.dtype(
    [
        ("step_us", "i8"),
        ("gravity", "f8"),  # m/s²
        ("density", "f8"),  # of the air [kg/m³]
        ("field", "f8", (3,)),  # magnetic, NED [gauss]
        ("latitude", "f8"),  # of the origin [deg]
        ("longitude", "f8"),
        ("altitude", "f8"),  # m
        # sensors: variances of noise
        ("gyro_density", "f8"),  # angle random walk² [rad²/s]
        ("force_density", "f8"),  # velocity random walk² [m²/s³]
        ("gyro_noise", "f8"),  # standard deviation of a sample [rad/s]
        ("force_noise", "f8"),  # [m/s²]
        ("turning", "f8"),  # scale and misalignment of the gyro, variance per rad turned [rad]
        ("gyros_apart", "f8"),  # what two of them differ by, over what they measure: 4 σ
        ("forces_apart", "f8"),  # the same of accelerometers
        ("gyro_bias", "f8"),  # turn-on variance
        ("force_bias", "f8"),
        ("gyro_walk", "f8"),  # variance per second
        ("force_walk", "f8"),
        ("magnetometer", "f8"),  # gauss²
        ("magnetometer_bias", "f8"),
        ("barometer", "f8"),  # m²
        ("barometer_bias", "f8"),
        ("barometer_walk", "f8"),
        ("pitot", "f8"),  # Pa²
        ("pitot_bias", "f8"),  # Pa²
        ("pitot_scale", "f8"),
        ("gnss_position", "f8", (3,)),  # m²
        ("gnss_error", "f8", (3,)),  # variance of the correlated error [m²]
        ("gnss_correlation", "f8"),  # s
        ("gnss_velocity", "f8", (3,)),  # m²/s²
        ("has_magnetometer", "i8"),
        ("has_pitot", "i8"),
        ("imus", "i8"),
        # the aircraft: side force and lift over mass and dynamic pressure
        ("side", "f8"),  # by a sideslip that the surfaces balance [m²/kg]
        ("side_error", "f8"),  # standard deviation of that, relative: surfaces may not balance it
        ("side_by_surfaces", "f8"),  # the same of usual deflections
        ("lift0", "f8"),  # S cL0 / m: of the force along -z, in which thrust has no part
        ("cruise", "f8"),  # airspeed that is assumed where no pitot tube shows it [m/s]
        ("slowest", "f8"),  # lowest airspeed command [m/s]
        ("lift", "f8"),  # S (cL_alpha + cD0) / m: at an angle of attack, drag has one
        # of what the receiver's place and the barometer moved beyond the velocity [m]
        ("receiver_moved", "f8", (4,)),  # largest sum: north, east, down; barometer
        ("receiver_jump", "f8", (3,)),  # largest difference between two fixes
        # from the parameters
        ("wind_walk", "f8"),  # m²/s³
        ("gate", "f8"),  # largest squared normalised innovation that is fused
        ("rate_filter", "f8"),  # gain of a step of the low pass of the rates
        ("force_filter", "f8"),
        *record_dtype(EstimatorParameters).descr,
    ]
)
"""What the filter assumes, and its parameters, in SI units and rad."""


class EstimatorConfig(NamedTuple):
    """What an estimator needs to know.

    Attributes:
        sensors: The sensors, with their errors.
        origin: Where north = east = down = 0 lies.
        step_us: Control period [µs].
        aircraft: The nominal aircraft: gravity, density of the air, lift and side force.
        parameters: Its parameters.
    """

    sensors: NavigationSensors
    origin: Origin
    step_us: int
    aircraft: Aircraft
    parameters: EstimatorParameters = EstimatorParameters()


def parameters_of(config: EstimatorConfig) -> np.ndarray:
    """Return what the filter assumes, one record of dtype `PARAMETERS`, shape (1,)."""
    record = np.zeros(1, PARAMETERS)
    own = record[0]
    period_s = config.step_us / 1e6
    own["step_us"] = config.step_us
    own["gravity"] = config.aircraft.gravity_m_s2
    own["density"] = config.aircraft.air_density_kg_m3
    own["field"] = magnetic_field(config.origin)
    own["latitude"] = config.origin.latitude_deg
    own["longitude"] = config.origin.longitude_deg
    own["altitude"] = config.origin.altitude_m
    _imu(own, config.sensors, period_s)
    _air_data(own, config.sensors)
    parameters = config.parameters
    _gnss(own, config.sensors)
    _moves(own, config.sensors, parameters)
    _aircraft(own, config.aircraft, parameters.side_model)
    fill(own, parameters)
    own["wind_walk"] = parameters.wind_walk_m_s_sqrt_s**2
    own["gate"] = parameters.gate_sigma**2
    for name, cutoff in (
        ("rate_filter", parameters.rate_cutoff_hz),
        ("force_filter", parameters.force_cutoff_hz),
    ):
        own[name] = -math.expm1(-2.0 * math.pi * cutoff * period_s)
    return record


def _imu(own: np.void, sensors: NavigationSensors, period_s: float) -> None:
    gyro, force = sensors.gyro, sensors.accelerometer
    gyro_noise = white_noise(gyro.noise_density_deg_s_sqrt_hz * _DEGREE, period_s)
    gyro_noise = math.hypot(gyro_noise, _rounding(gyro.resolution_deg_s * _DEGREE))
    force_noise = white_noise(force.noise_density_m_s2_sqrt_hz, period_s)
    force_noise = math.hypot(force_noise, _rounding(force.resolution_m_s2))
    own["imus"] = sensors.imus
    own["gyro_noise"] = math.hypot(gyro_noise, _MIN_GYRO)
    own["force_noise"] = math.hypot(force_noise, _MIN_ACCELEROMETER)
    own["gyro_density"] = gyro_noise**2 * period_s + 1e-12
    own["force_density"] = force_noise**2 * period_s + 1e-8
    own["turning"] = _MARGIN * (gyro.scale_error**2 + 2.0 * (gyro.misalignment_deg * _DEGREE) ** 2)
    own["gyros_apart"] = _apart(gyro.scale_error, gyro.misalignment_deg)
    own["forces_apart"] = _apart(force.scale_error, force.misalignment_deg)
    own["gyro_bias"] = (gyro.turn_on_bias_deg_s * _DEGREE) ** 2 + 1e-10
    g = own["gravity"]
    own["force_bias"] = (
        force.turn_on_bias_m_s2**2
        + (force.scale_error * g) ** 2
        + (force.misalignment_deg * _DEGREE * g) ** 2
        + 1e-8
    )
    walk = gauss_markov(gyro.bias_instability_deg_h * _DEGREE / 3600.0)
    own["gyro_walk"] = 2.0 * walk**2 / gyro.correlation_s + 1e-14
    walk = gauss_markov(force.bias_instability_m_s2)
    own["force_walk"] = 2.0 * walk**2 / force.correlation_s + 1e-10
    own["force_walk"] += (force.scale_error * _FORCE_CHANGE) ** 2


def _apart(scale: float, misalignment_deg: float) -> float:
    """Return what two sensors of three axes differ by at most, over what they measure."""
    misalignment = misalignment_deg * _DEGREE
    return max(4.0 * math.sqrt(2.0 * (scale**2 + 2.0 * misalignment**2)), 0.01)


def _air_data(own: np.void, sensors: NavigationSensors) -> None:
    magnetometer, barometer, pitot = sensors.magnetometer, sensors.barometer, sensors.pitot
    field = float(np.linalg.norm(own["field"]))
    own["has_magnetometer"], own["has_pitot"] = magnetometer.fitted, pitot.fitted
    own["magnetometer"] = (
        magnetometer.noise_gauss**2 + _rounding(magnetometer.resolution_gauss) ** 2 + 1e-8
    )
    misaligned = field * magnetometer.misalignment_deg * _DEGREE
    own["magnetometer_bias"] = _MARGIN * (
        magnetometer.hard_iron_gauss**2
        + magnetometer.bias_instability_gauss**2
        + (field * magnetometer.scale_error) ** 2 / 3.0
        + misaligned**2
        + 1e-8
    )
    own["barometer"] = (barometer.noise_pa**2 + 0.1) / _PA_PER_M**2
    own["barometer_bias"] = (
        barometer.turn_on_bias_pa**2 + barometer.bias_instability_pa**2 + 0.1
    ) / _PA_PER_M**2
    own["barometer_walk"] = (
        2.0 * barometer.bias_instability_pa**2 / barometer.correlation_s / _PA_PER_M**2 + 1e-8
    )
    own["pitot"] = pitot.noise_pa**2 + _rounding(pitot.resolution_pa) ** 2 + 0.01
    own["pitot_bias"] = pitot.turn_on_bias_pa**2 + pitot.bias_instability_pa**2
    own["pitot_scale"] = pitot.scale_error**2 + 1e-8


def _gnss(own: np.void, sensors: NavigationSensors) -> None:
    gnss = sensors.gnss
    flat, high = gnss.horizontal_noise_m**2, gnss.vertical_noise_m**2
    own["gnss_position"] = [flat + _DEGE7_M**2, flat + _DEGE7_M**2, high + _DEGE7_M**2]
    flat, high = gnss.horizontal_error_m**2, gnss.vertical_error_m**2
    own["gnss_error"] = [flat + 1e-4, flat + 1e-4, high + 1e-4]
    own["gnss_correlation"] = gnss.correlation_s
    flat = gnss.horizontal_velocity_noise_m_s**2 + _rounding(_CM) ** 2
    high = gnss.vertical_velocity_noise_m_s**2 + _rounding(_CM) ** 2
    own["gnss_velocity"] = [flat, flat, high]


def _moves(own: np.void, sensors: NavigationSensors, parameters: EstimatorParameters) -> None:
    """Write how far a place may move beyond the velocity, by the errors of both.

    A sum that forgets with time constant T is a high pass of the place: of a first-order
    Gauss-Markov error with time constant t it leaves T / (T + t) of the variance, of white noise
    all; the noise of the velocity, a sample each period, adds (variance) (period) T / 2.
    """
    gnss, barometer, memory_s = sensors.gnss, sensors.barometer, parameters.receiver_memory_s
    period_s = 1.0 / (gnss.rate_hz or 1e3)
    left = memory_s / (memory_s + gnss.correlation_s)
    summed = own["gnss_velocity"] * period_s * memory_s / 2.0
    places = own["gnss_error"] * left + own["gnss_position"] + summed
    left = memory_s / (memory_s + barometer.correlation_s)
    drift = (barometer.bias_instability_pa / _PA_PER_M) ** 2
    pressure = drift * left + own["barometer"] + summed[2] + _UNTIMELY_M**2
    own["receiver_moved"] = parameters.gate_sigma * np.sqrt([*places, pressure])
    steps = 2.0 * own["gnss_position"] + own["gnss_velocity"] * period_s**2
    steps += 2.0 * own["gnss_error"] * period_s / gnss.correlation_s
    own["receiver_jump"] = parameters.gate_sigma * np.sqrt(steps)


def _aircraft(own: np.void, aircraft: Aircraft, model: float) -> None:
    """Write slopes of lift and side force, by mass and dynamic pressure, and airspeeds.

    A sideslip that lasts is held by aileron and rudder, whose moments balance its own; so of its
    side force, S (cY_beta - cD0) β, these leave a share, in which the rudder's is the largest: of a
    PC-7 an eighth, of a PA-28 less than nothing. A gust's has no such share yet.
    """
    record, V = aircraft_record(aircraft), aircraft.design_airspeed
    side, _, rolling, yawing = lateral(V, record)
    per = 0.5 * aircraft.air_density_kg_m3 * V * V * aircraft.mass_kg  # of N: m²/kg
    by_surfaces = [[rolling.aileron, rolling.rudder], [yawing.aileron, yawing.rudder]]
    held = -np.linalg.lstsq(np.array(by_surfaces), [rolling.beta, yawing.beta], rcond=None)[0]
    balanced = side.beta + float(held @ [side.aileron, side.rudder])
    own["side"] = balanced / per
    error = math.hypot(model * side.beta, balanced - side.beta)
    own["side_error"] = error / abs(balanced) if balanced != 0.0 else 0.0
    own["side_by_surfaces"] = math.hypot(side.aileron, side.rudder) / per * _USUAL_DEFLECTION
    area = aircraft.wing_area_m2 / aircraft.mass_kg
    across, by_alpha = carried_linearly(record)
    own["lift0"], own["lift"] = area * across, area * by_alpha
    own["cruise"], own["slowest"] = V, aircraft.airspeed_min_m_s


def _rounding(resolution: float) -> float:
    """Return the standard deviation of the error of rounding to a resolution."""
    return resolution / math.sqrt(12.0)
