"""What a set of sensors can observe, and what it cannot."""

from mavlink_defs.config.models import Loc
from mavlink_defs.config.periods import Found, period_problems, rate_problems
from sitl_plant.sensing.config import NavigationSensors, Sensor, Sensors
from sitl_plant.sensing.units import periods_between


def fitted(sensors: NavigationSensors) -> list[str]:
    """Return the keys of the sensors that there are."""
    optional = ("magnetometer", "barometer", "pitot", "gnss")
    return ["gyro", "accelerometer", *(name for name in optional if getattr(sensors, name).fitted)]


def unobservable(sensors: NavigationSensors) -> Found:
    """Yield place and text of what no estimator could find from a set of sensors.

    Position and velocity over the ground need a GNSS receiver: without one their errors grow
    without bound. The heading comes from a magnetometer, or from a receiver and motion.
    """
    if sensors.gnss.fitted:
        return
    text = "is needed: without a GNSS receiver, nothing observes position and velocity over ground"
    if not sensors.magnetometer.fitted:
        text += ", and without a magnetometer besides, nothing the heading"
    yield ("gnss", "fitted"), f"true {text}; to lose it in flight, set a fault of the sensor gps"


def observability_warnings(sensors: NavigationSensors) -> Found:
    """Yield place and text of what a set of sensors observes only at times."""
    if not sensors.magnetometer.fitted:
        text = "without a magnetometer, the heading is observed in motion only, not at rest"
        yield ("magnetometer", "fitted"), text
    if not sensors.pitot.fitted:
        text = "without a pitot tube, airspeed and wind are observed in turns only"
        yield ("pitot", "fitted"), text


def rounded_rates(sensors: NavigationSensors, step_us: int) -> Found:
    """Yield place and text of each default rate that control periods [µs] make a different one."""
    for name in fitted(sensors):
        rate_hz = getattr(sensors, name).rate_hz
        for loc, _ in rate_problems((name, "rate_hz"), rate_hz, step_us):
            nearest = 1e6 / (periods_between(rate_hz, step_us) * step_us)
            text = f"{nearest:.4g} Hz in place of {rate_hz:g}, the nearest that"
            yield loc, f"{text} control periods of {step_us} us allow"


def sensor_problems(sensors: Sensors, step_us: int) -> Found:
    """Yield place and text of what sensors on top of the true state cannot do at a period [µs]."""
    for name, sensor in sensors.of_true_state.items():
        yield from period_problems((name, "latency_s"), sensor.latency_s, step_us)
        yield from rate_problems((name, "rate_hz"), sensor.rate_hz, step_us)


def navigation_problems(sensors: Sensors, step_us: int) -> Found:
    """Yield place and text of why nobody can navigate by sensors at a control period [µs]."""
    for name, sensor in sensors.of_true_state.items():
        if sensor != Sensor():
            text = "is of the true state, and the flight is by an estimated one: leave it out, or"
            yield (name,), f"{text} set the errors of sensors.navigation"
    navigation = sensors.navigation
    for name in fitted(navigation):
        sensor = getattr(navigation, name)
        loc: Loc = ("navigation", name)
        for key, problems in (("latency_s", period_problems), ("rate_hz", rate_problems)):
            value = getattr(sensor, key)
            if value != type(sensor).model_fields[key].default:  # which becomes the nearest
                yield from problems((*loc, key), value, step_us)
    for at, text in unobservable(navigation):
        yield ("navigation", *at), text
