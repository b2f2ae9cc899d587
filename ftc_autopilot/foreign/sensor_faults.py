"""Faults of the sensors that a foreign autopilot is shown, which its bridge makes.

Faults of actuators are the plant's. A command is executed as a whole, or refused with a reason.
"""

from collections.abc import Callable

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.faults.aircraft import AircraftFaults
from mavlink_defs.faults.command import InvalidParam, failure_from_params, fault_from_params
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import ANY_LIMITS
from mavlink_defs.faults.sensors import SENSOR_FAULTS
from sitl_plant.sensing.failures import Failures, fault_table

_ALL = -1.0


class SensorFaults:
    """The faults of the sensors of one foreign autopilot."""

    def __init__(
        self,
        failures: Failures,
        refuses: Callable[[Fault], str | None],
        time_s: Callable[[], float],
    ) -> None:
        """Take over the faults of an aircraft's sensors.

        Args:
            failures: What they are written to.
            refuses: Returns why the autopilot cannot have a fault; None if it can.
            time_s: Returns the simulation time [s].
        """
        table = {SENSOR_FAULTS.key: fault_table(failures, 0)}
        self._faults = AircraftFaults(table, ANY_LIMITS, np.zeros(4))
        self._refuses, self._time_s = refuses, time_s

    def execute(self, number: int, params: tuple[float, ...]) -> int | None:
        """Execute a command.

        Returns:
            MAV_RESULT; None if the plant is to execute it, too, or alone.

        Raises:
            InvalidParam: There is no such sensor, or its fault cannot reach the autopilot.
            OverflowError: There is no room.
        """
        if number == dialect.MAV_CMD_FTC_CLEAR_FAULTS:
            if params[0] == _ALL:
                self._faults.clear(_ALL)
            return None
        if number == SENSOR_FAULTS.command:
            self._check(fault_from_params(SENSOR_FAULTS, params))
            self._faults.set(SENSOR_FAULTS, params, self._time_s())
            return dialect.MAV_RESULT_ACCEPTED
        is_failure = number == dialect.MAV_CMD_INJECT_FAILURE
        if not is_failure or (failing := failure_from_params(params)) is None:
            return None
        target, instance, failure = failing
        found = None if failure is None else SENSOR_FAULTS.default(failure, target)
        if found is not None:
            self._check(Fault(target, *found, instance=instance))
        return self._faults.inject(params, self._time_s())

    def _check(self, fault: Fault) -> None:
        if (why := self._refuses(fault)) is not None:
            raise InvalidParam(1, "Sensor", f"Failure: {why}")

    def beside(self, message: dialect.MAVLink_ftc_fault_message) -> list[dialect.MAVLink_message]:
        """Return a message of the plant's list of faults, and behind the last one these."""
        time_s = self._time_s()
        own = [fault.message(time_s) for fault in self._faults.listed()]
        of_plant, count = message.count, message.count + len(own)
        for i, one in enumerate(own):
            one.index, one.count = of_plant + i, count
        if not of_plant:
            return [*own] or [message]
        message.count = count
        return [message, *(own if message.index == of_plant - 1 else ())]
