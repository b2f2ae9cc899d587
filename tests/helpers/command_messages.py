"""Commands and acknowledgements for tests of the command protocol."""

import math
from typing import Any

from lossy_network import GCS, VEHICLE, over_the_wire

from mavlink_defs import dialect
from mavlink_defs.dialect import (
    MAVLink_command_ack_message,
    MAVLink_command_int_message,
    MAVLink_command_long_message,
)
from mavlink_defs.services.machine import SystemId

ARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
SET_FAULT = dialect.MAV_CMD_FTC_SET_FAULT
CLEAR_FAULTS = dialect.MAV_CMD_FTC_CLEAR_FAULTS
QUESTIONS = (
    dialect.MAV_CMD_REQUEST_MESSAGE,
    dialect.MAV_CMD_GET_HOME_POSITION,
    dialect.MAV_CMD_GET_MESSAGE_INTERVAL,
    dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
)
ACCEPTED = dialect.MAV_RESULT_ACCEPTED
FAILED = dialect.MAV_RESULT_FAILED
IN_PROGRESS = dialect.MAV_RESULT_IN_PROGRESS


def long(
    param1: float = 1.0, command: int = ARM, confirmation: int = 0, target: SystemId = VEHICLE
) -> MAVLink_command_long_message:
    return MAVLink_command_long_message(
        *target, command, confirmation, param1, 0.0, math.nan, 0.0, 0.0, 0.0, 0.0
    )


def int_(param1: float = 1.0, command: int = ARM) -> MAVLink_command_int_message:
    return MAVLink_command_int_message(
        *VEHICLE, 0, command, 0, 0, param1, 0.0, math.nan, 0.0, 0, 0, 0.0
    )


def ack(
    command: int = ARM,
    result: int = ACCEPTED,
    progress: int = 0,
    source: SystemId = VEHICLE,
    target: SystemId = GCS,
    seq: int = 0,
) -> Any:
    message = MAVLink_command_ack_message(command, result, progress, 7, *target)
    return over_the_wire(message, source, seq)
