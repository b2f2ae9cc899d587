"""The simulator component of one aircraft: arming state and fault commands.

No socket and no clock: messages and the time go in, messages to send come out.
"""

import math
from typing import TypeAlias

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.fault_kinds import STUCK, FaultLimits
from mavlink_defs.faults import Fault, InvalidParam, fault_from_params
from mavlink_defs.framing.frames import text_chunks
from mavlink_defs.sensor_faults import SensorFault, failure_from_params
from mavlink_defs.services.command import CommandMessage, command_params
from mavlink_defs.services.command_server import CommandServer
from mavlink_defs.services.machine import SystemId
from sitl_plant.actuators.faults import add_fault, clear_faults, in_wire_units
from sitl_plant.sensing.commands import SensorFaultCommands

_Instances: TypeAlias = dict[int, tuple[int, ...]]
_SURFACES: _Instances = {
    0: (0, 1, 2),
    1: (0,),
    2: (1,),
    3: (2,),
}  # MAV_CMD_INJECT_FAILURE servo instance
_ALL = -1.0
_MOTORS: _Instances = {0: (3,), 1: (3,)}


class AircraftService:
    """The simulator component of one aircraft.

    Attributes:
        armed: Whether its autopilot's last HEARTBEAT reported it armed. An autopilot that is
            armed in its first HEARTBEAT was armed for another plant's flight: it counts as
            armed only after it has been disarmed once.
    """

    def __init__(
        self,
        system: int,
        component: int,
        faults: np.ndarray,
        applied: np.ndarray,
        limits: FaultLimits,
        sensors: SensorFaultCommands | None = None,
    ) -> None:
        self.armed = False
        self._disarmed_before = False
        self._faults = faults  # the aircraft's row of the fault table
        self._applied = applied  # actuator positions now [rad, rad, rad, N]
        self._limits = limits
        self._sensors = sensors or SensorFaultCommands()
        self._commands = CommandServer(SystemId(system, component))
        self._outbox: list[MAVLink_message] = []
        self._texts = 0

    def receive(self, message: MAVLink_message, time_s: float, now: float) -> None:
        """Take in a message of the aircraft's autopilot.

        Args:
            message: Any message; irrelevant ones are ignored.
            time_s: Simulation time [s].
            now: Wall-clock time [s].
        """
        if isinstance(message, dialect.MAVLink_heartbeat_message):
            armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            self._disarmed_before |= not armed
            self.armed = armed and self._disarmed_before
        self._commands.receive(message, now)
        for command in self._commands.events():
            result = self._execute(command.message, time_s)
            self._commands.finish(command.token, result, now=now)

    def messages_to_send(self) -> list[MAVLink_message]:
        """Hand over what is to be sent to the autopilot."""
        messages, self._outbox = self._outbox + self._commands.messages_to_send(), []
        return messages

    def _execute(self, message: CommandMessage, time_s: float) -> int:
        params = command_params(message)
        try:
            match message.command:
                case dialect.MAV_CMD_FTC_SET_FAULT:
                    fault = fault_from_params(params, self._limits)
                    if math.isnan(fault.start_s) and fault.end_s <= time_s:
                        text = f"Fault: End is {fault.end_s:g} s, it is {time_s:g} s already"
                        raise InvalidParam(6, "End", text)
                    add_fault(self._faults, fault, time_s)
                case dialect.MAV_CMD_FTC_SET_SENSOR_FAULT:
                    self._sensors.set(params, time_s)
                case dialect.MAV_CMD_FTC_CLEAR_FAULTS:
                    self._clear(params[0])
                case dialect.MAV_CMD_INJECT_FAILURE:
                    return self._inject(params, time_s)
                case dialect.MAV_CMD_REQUEST_MESSAGE:
                    self._list_faults(time_s)
                case _:
                    return dialect.MAV_RESULT_UNSUPPORTED
        except (InvalidParam, OverflowError) as problem:
            self._say(str(problem))
            return dialect.MAV_RESULT_DENIED
        return dialect.MAV_RESULT_ACCEPTED

    def _clear(self, actuator: float) -> None:
        if actuator not in {_ALL, *range(len(ACTUATORS))}:
            text = f"Clear faults: Actuator is {actuator:g}, must be -1 to 3"
            raise InvalidParam(1, "Actuator", text)
        clear_faults(self._faults, int(actuator))
        if actuator == _ALL:
            self._sensors.clear()

    def _inject(self, params: tuple[float, ...], time_s: float) -> int:
        """Execute MAV_CMD_INJECT_FAILURE for sensors, or servos or motor: OFF, STUCK, OK again."""
        if (sensor := failure_from_params(params)) is not None:
            self._sensors.inject(*sensor, time_s)
            return dialect.MAV_RESULT_ACCEPTED
        unit, kind, instance = params[:3]
        units: dict[float, _Instances] = {
            dialect.FAILURE_UNIT_SYSTEM_SERVO: _SURFACES,
            dialect.FAILURE_UNIT_SYSTEM_MOTOR: _MOTORS,
        }
        if unit not in units:
            return dialect.MAV_RESULT_UNSUPPORTED
        if instance not in units[unit]:
            text = f"Failure: Instance is {instance:g}, must be 0 to {max(units[unit])}"
            raise InvalidParam(3, "Instance", text)
        faults = self._faults.copy()  # there may not be room for all
        named = units[unit][int(instance)]
        actuators = [actuator for actuator in named if self._limits.has(ACTUATORS[actuator])]
        if not actuators:
            text = f"Failure: the aircraft has no {ACTUATORS[named[0]]}"
            raise InvalidParam(3, "Instance", text)
        for actuator in actuators:
            if kind == dialect.FAILURE_TYPE_OK:
                clear_faults(faults, actuator)
            elif kind == dialect.FAILURE_TYPE_OFF:
                _stick(faults, actuator, 0.0, time_s)
            elif kind == dialect.FAILURE_TYPE_STUCK:
                _stick(faults, actuator, float(self._applied[actuator]), time_s)
            else:
                return dialect.MAV_RESULT_UNSUPPORTED
        self._faults[:] = faults
        return dialect.MAV_RESULT_ACCEPTED

    def _list_faults(self, time_s: float) -> None:
        rows = self._faults[self._faults["actuator"] >= 0]
        listed = [
            *(_message(in_wire_units(Fault(*row.item())), time_s) for row in rows),
            *(_sensor_message(fault, time_s) for fault in self._sensors.listed()),
        ]
        for i, message in enumerate(listed):
            message.index, message.count = i, len(listed)
        self._outbox += listed or [dialect.MAVLink_ftc_fault_message(0, 0, 0, 0, 0, 0, 0, 0, 0)]

    def _say(self, text: str) -> None:
        self._texts += 1
        self._outbox += text_chunks(dialect.MAV_SEVERITY_WARNING, text, self._texts)


def _stick(faults: np.ndarray, actuator: int, value: float, time_s: float) -> None:
    fault = Fault(actuator, 0.0, value, 0.0, math.nan, math.nan, STUCK.code)
    add_fault(faults, in_wire_units(fault), time_s)


def _message(fault: Fault, time_s: float) -> dialect.MAVLink_ftc_fault_message:
    return dialect.MAVLink_ftc_fault_message(
        effectiveness=fault.effectiveness,
        value=fault.value,
        frequency=fault.frequency_hz,
        start=fault.start_s,
        end=fault.end_s,
        index=0,
        count=0,
        actuator=fault.actuator,
        active=int(fault.window.contains(time_s)),
        kind=fault.code,
    )


def _sensor_message(fault: SensorFault, time_s: float) -> dialect.MAVLink_ftc_fault_message:
    return dialect.MAVLink_ftc_fault_message(
        effectiveness=0.0,
        value=fault.value,
        frequency=0.0,
        start=fault.start_s,
        end=fault.end_s,
        index=0,
        count=0,
        actuator=0,
        active=int(fault.window.contains(time_s)),
        kind=fault.code,
        sensor=fault.sensor,
        instance=fault.instance,
        axis=fault.axis,
    )
