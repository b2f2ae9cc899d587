"""The fault commands of an aircraft's navigation sensors, as its simulator component executes them.

A command is executed as a whole or refused with a reason; nothing of a refused one stays.
"""

import math
from collections.abc import Sequence

import numpy as np

from mavlink_defs.faults import InvalidParam
from mavlink_defs.sensor_fault_kinds import SENSOR_NAMES, Failure, SensorUnit, default_of
from mavlink_defs.sensor_faults import SensorFault, sensor_fault_from_params
from sitl_plant.sensing.failures import (
    Failures,
    add_sensor_fault,
    as_fault,
    clear_sensor_faults,
    instances_of,
)


class SensorFaultCommands:
    """The sensor faults of one aircraft; of one that flies by its true state there are none."""

    def __init__(self, faults: np.ndarray | None = None, units: np.ndarray | None = None) -> None:
        """Take over an aircraft's part of `sitl_plant.sensing.failures.Failures`.

        Args:
            faults: Its row of the fault table; None: it has no navigation sensors.
            units: Its sensors.
        """
        self._faults, self._units = faults, units

    def set(self, params: Sequence[float], time_s: float) -> None:
        """Execute MAV_CMD_FTC_SET_SENSOR_FAULT.

        Args:
            params: Its parameters.
            time_s: Simulation time [s].

        Raises:
            InvalidParam: A parameter is out of range, or there is no such sensor.
            OverflowError: There is no room.
        """
        fault = sensor_fault_from_params(params)
        if math.isnan(fault.start_s) and fault.end_s <= time_s:
            text = f"Sensor fault: End is {fault.end_s:g} s, it is {time_s:g} s already"
            raise InvalidParam(6, "End", text)
        faults, units = self._of(fault, 4)
        add_sensor_fault(faults, units, fault, time_s)

    def inject(
        self, unit: SensorUnit, instance: int, failure: Failure | None, time_s: float
    ) -> None:
        """Execute MAV_CMD_INJECT_FAILURE of a sensor.

        Args:
            unit: The sensor.
            instance: Its number; 0: all.
            failure: FAILURE_TYPE; None: OK, which clears its faults.
            time_s: Simulation time [s].

        Raises:
            InvalidParam: There is no such sensor.
            OverflowError: There is no room.
        """
        sensor = 1 + SENSOR_NAMES.index(unit.name)
        kind, value = default_of(failure or "off", unit)
        fault = SensorFault(sensor, kind.code, value, instance)
        faults, units = self._of(fault, 3)
        if failure is None:
            clear_sensor_faults(faults, sensor, instance)
        else:
            add_sensor_fault(faults, units, fault, time_s)

    def clear(self) -> None:
        """Clear the faults of all sensors, if there are any."""
        if self._faults is not None:
            clear_sensor_faults(self._faults)

    def listed(self) -> list[SensorFault]:
        """Return all faults, past and future ones included."""
        if self._faults is None:
            return []
        return [as_fault(row) for row in self._faults if row["sensor"]]

    def _of(self, fault: SensorFault, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Return table and sensors of the aircraft, if it has the sensor that a fault names.

        Args:
            fault: The fault.
            index: Number of the parameter with the instance.
        """
        name = fault.unit.name
        if self._faults is None or self._units is None:
            text = (
                f"Failure: the aircraft flies by its true state and has no {name} that could fail; "
                "fly a scenario with navigation: estimated"
            )
            raise InvalidParam(1, "Unit", text)
        if not instances_of(self._units, fault):
            most = len(instances_of(self._units, fault._replace(instance=0)))
            text = f"Failure: Instance is {fault.instance}, must be 0 (all) to {most} of {name}"
            raise InvalidParam(index, "Instance", text if most else f"Failure: there is no {name}")
        return self._faults, self._units


def sensor_commands(failures: Failures, i: int) -> SensorFaultCommands:
    """Return the sensor fault commands of an aircraft.

    Args:
        failures: Of a fleet that navigates by sensors; of no aircraft if it has its true states.
        i: Index of the aircraft.
    """
    if not len(failures.faults):
        return SensorFaultCommands()
    return SensorFaultCommands(failures.faults[i], failures.units[i])
