"""Faults of actuators and sensors: what they are, say, and look like on the wire and in files.

What a kind of fault does to a command or a sample is the plant's.
"""

from mavlink_defs.dialect import MAV_CMD_FTC_CLEAR_FAULTS, MAV_CMD_INJECT_FAILURE
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.sensors import SENSOR_FAULTS

FAMILIES = (ACTUATOR_FAULTS, SENSOR_FAULTS)
"""All families; a fault on the wire that names no target of another one is of the first."""

SETTING = {family.command: family for family in FAMILIES}
"""The family whose faults a command sets."""

COMMANDS = {*SETTING, MAV_CMD_INJECT_FAILURE, MAV_CMD_FTC_CLEAR_FAULTS}
"""All commands that set or clear faults."""

FAMILY_OF = {target.name: family for family in FAMILIES for target in family.targets}
"""The family of each target, by its name."""
