"""What a set of sensors can observe, and what it cannot."""

from collections.abc import Iterator
from typing import TypeAlias

from mavlink_defs.config.models import Loc
from sitl_plant.navigation_sensors import NavigationSensors

_Found: TypeAlias = Iterator[tuple[Loc, str]]


def fitted(sensors: NavigationSensors) -> list[str]:
    """Return the keys of the sensors that there are."""
    optional = ("magnetometer", "barometer", "pitot", "gnss")
    return [
        "gyro",
        "accelerometer",
        *(name for name in optional if getattr(sensors, name).fitted),
    ]


def unobservable(sensors: NavigationSensors) -> _Found:
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


def observability_warnings(sensors: NavigationSensors) -> _Found:
    """Yield place and text of what a set of sensors observes only at times."""
    if not sensors.magnetometer.fitted:
        text = "without a magnetometer, the heading is observed in motion only, not at rest"
        yield ("magnetometer", "fitted"), text
    if not sensors.pitot.fitted:
        text = "without a pitot tube, airspeed and wind are observed in turns only"
        yield ("pitot", "fitted"), text
