"""The faults of an aircraft, and the commands that change them, as who simulates it executes them.

A command is executed as a whole or refused with a reason; nothing of a refused one stays.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.faults import FAMILY_OF
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS, STUCK
from mavlink_defs.faults.command import InvalidParam, failure_from_params, fault_from_params
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import Family, FaultLimits, Target
from mavlink_defs.faults.table import FaultTable

_ALL = -1.0


class AircraftFaults:
    """The faults of one aircraft."""

    def __init__(
        self, tables: Mapping[str, FaultTable], limits: FaultLimits, applied: np.ndarray
    ) -> None:
        """Take over the tables of an aircraft.

        Args:
            tables: By the key of their family; of one that flies by its true state, no sensors'.
            limits: Of its actuators.
            applied: Where they are now, shape (4,) [rad, rad, rad, N].
        """
        self._tables, self._limits, self._applied = tables, limits, applied

    def set(self, family: Family, params: Sequence[float], time_s: float) -> None:
        """Execute the command that sets a fault of a family.

        Args:
            family: The family.
            params: Parameters 1 to 7.
            time_s: Simulation time [s].

        Raises:
            InvalidParam: A parameter is out of range, or there is no such target.
            OverflowError: There is no room.
        """
        fault = fault_from_params(family, params, self._limits)
        if math.isnan(fault.start_s) and fault.end_s <= time_s:
            text = f"{family.title}: End is {fault.end_s:g} s, it is {time_s:g} s already"
            raise InvalidParam(1 + family.params.index("end_s"), "End", text)
        self._table_of(fault, 4).set([fault], time_s)

    def clear(self, actuator: float) -> None:
        """Execute MAV_CMD_FTC_CLEAR_FAULTS of an actuator, or of all targets.

        Raises:
            InvalidParam: There is no such actuator.
        """
        target = ACTUATOR_FAULTS.target(actuator)
        if target is not None:
            self._tables[ACTUATOR_FAULTS.key].clear(target)
            return
        if actuator != _ALL:
            text = f"Clear faults: Actuator is {actuator:g}, must be -1 to 3"
            raise InvalidParam(1, "Actuator", text)
        for table in self._tables.values():
            table.clear()

    def inject(self, params: Sequence[float], time_s: float) -> int:
        """Execute MAV_CMD_INJECT_FAILURE of sensors, or OFF, STUCK, OK of servos or motor.

        Returns:
            MAV_RESULT.

        Raises:
            InvalidParam: There is no such type or instance.
            OverflowError: There is no room.
        """
        if (failing := failure_from_params(params)) is None:
            return self._inject_actuators(params, time_s)
        target, instance, failure = failing
        table = self._table_of(Fault(target, STUCK, instance=instance), 3)
        if failure is None:
            table.clear(target, instance)
        elif (found := FAMILY_OF[target.name].default(failure, target)) is not None:
            table.set([Fault(target, *found, instance=instance)], time_s)
        else:
            return dialect.MAV_RESULT_UNSUPPORTED
        return dialect.MAV_RESULT_ACCEPTED

    def _inject_actuators(self, params: Sequence[float], time_s: float) -> int:
        unit, kind, instance = params[:3]
        of_unit = [target for target in ACTUATOR_FAULTS.targets if target.failure_unit == unit]
        if not of_unit:
            return dialect.MAV_RESULT_UNSUPPORTED
        if instance not in range(1 + len(of_unit)):
            text = f"Failure: Instance is {instance:g}, must be 0 to {len(of_unit)}"
            raise InvalidParam(3, "Instance", text)
        named = [of_unit[int(instance) - 1]] if instance else of_unit
        there = [target for target in named if self._limits.has(target.name)]
        if not there:
            text = f"Failure: the aircraft has no {named[0].name}"
            raise InvalidParam(3, "Instance", text)
        table = self._tables[ACTUATOR_FAULTS.key]
        if kind == dialect.FAILURE_TYPE_OK:
            for target in there:
                table.clear(target)
        elif kind in {dialect.FAILURE_TYPE_OFF, dialect.FAILURE_TYPE_STUCK}:
            stuck = kind == dialect.FAILURE_TYPE_STUCK
            faults = (Fault(one, STUCK, self._position_of(one) if stuck else 0.0) for one in there)
            table.set(list(faults), time_s)
        else:
            return dialect.MAV_RESULT_UNSUPPORTED
        return dialect.MAV_RESULT_ACCEPTED

    def _position_of(self, actuator: Target) -> float:
        """Return where an actuator is, in its unit."""
        position = self._applied[ACTUATOR_FAULTS.number_of(actuator)]
        return float(position) * (1.0 / actuator.per_unit)

    def listed(self) -> list[Fault]:
        """Return all faults, past and future ones included."""
        return [fault for table in self._tables.values() for fault in table.faults]

    def _table_of(self, fault: Fault, index: int) -> FaultTable:
        """Return the table of a fault, if the aircraft has what it names.

        Args:
            fault: The fault.
            index: Number of the parameter with the instance.
        """
        table, name = self._tables.get(fault.family.key), fault.target.name
        if table is None:
            text = (
                f"Failure: the aircraft flies by its true state and has no {name} that could fail; "
                "fly a scenario with navigation: estimated"
            )
            raise InvalidParam(1, "Unit", text)
        if not table.numbers(fault):
            most = len(table.numbers(fault._replace(instance=0)))
            text = f"Failure: Instance is {fault.instance}, must be 0 (all) to {most} of {name}"
            raise InvalidParam(index, "Instance", text if most else f"Failure: there is no {name}")
        return table
