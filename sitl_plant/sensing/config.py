"""Configuration of the sensors: it lies below the plant's, which is part of this room's input."""

from sitl_plant.navigation_sensors import NavigationSensors

__all__ = ["NavigationSensors"]
