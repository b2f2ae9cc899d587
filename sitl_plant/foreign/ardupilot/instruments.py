"""What an ArduPilot is shown of the motion: the JSON interface's instruments, and their faults.

They have no errors of their own: ArduPilot adds its own sensors' errors. An instrument that is
slow or late shows its last value in between, as each frame has one.
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import in_python
from sitl_plant.foreign.ardupilot.config import JSON_INSTRUMENTS
from sitl_plant.foreign.ardupilot.protocol import Measured
from sitl_plant.sensing import failures as sensor_failures
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.sensing.failures import VALUES, Failures, new_failures
from sitl_plant.sensing.sense import range_of
from sitl_plant.sensing.units import units_of
from sitl_plant.vec3 import Vec3

_HPA = 0.01  # of one Pa
_fail = in_python(sensor_failures.fail)


class JsonInstruments:
    """The instruments of one aircraft.

    Attributes:
        failures: Their faults.
    """

    def __init__(
        self, sensors: NavigationSensors, density_kg_m3: float, system: int, seed: int, step_us: int
    ) -> None:
        """Begin without faults.

        Args:
            sensors: What the aircraft carries; noise and ranges that faults know are theirs.
            density_kg_m3: Of the air that it flies in.
            system: Its system id.
            seed: Of the faults' random numbers.
            step_us: Control period [µs].
        """
        ranges = [range_of(unit) for unit in units_of(sensors, step_us)]
        shown = [one for one in ranges if one.sensor in JSON_INSTRUMENTS and one.instance == 1]
        self._names = [one.sensor for one in shown]
        self.failures: Failures = new_failures(shown, [system], seed, step_us)
        self._density = density_kg_m3
        self._last = np.zeros((len(shown), VALUES))
        self._has_last = False

    def shown(self, step: int, time_s: float, motion: Measured) -> Measured:
        """Return what they show of a motion at a step, a simulation time [s]."""
        if self.failures.faults[0, 0]["target"] < 0:  # the first row is taken first
            self._has_last = False
            return motion
        pressure = 0.5 * self._density * motion.airspeed * motion.airspeed * _HPA
        parts: dict[str, tuple[float, ...]] = {
            "gyro": motion.rates,
            "accelerometer": motion.specific_force,
            "gps": (*motion.position, *motion.velocity),
            "airspeed": (pressure,),
        }
        for k, name in enumerate(self._names):
            sample = np.zeros(VALUES)
            sample[: len(parts[name])] = parts[name]
            if not self._has_last:
                self._last[k] = sample
            if _fail(self.failures, 0, k, step, time_s, sample, True):
                self._last[k] = sample
            parts[name] = tuple(self._last[k, : len(parts[name])].tolist())
        self._has_last = True
        (pressure,) = parts["airspeed"]
        return motion._replace(
            rates=_vector(parts["gyro"]),
            specific_force=_vector(parts["accelerometer"]),
            position=_vector(parts["gps"]),
            velocity=_vector(parts["gps"][3:]),
            airspeed=math.sqrt(2.0 * max(pressure, 0.0) / (_HPA * self._density)),
        )


def _vector(values: tuple[float, ...]) -> Vec3:
    return values[0], values[1], values[2]
