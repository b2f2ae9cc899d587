"""Items of a mission that change nothing of its path: commands to a payload, and markers.

A vehicle keeps them, hands them out as they were sent, and announces each where it is passed:
behind the place before it, or where a condition lets it act. Nothing is carried out, as there is no
payload.
"""

import math

from mavlink_defs import dialect
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.services.mission import MissionItem

_OF_ARDUPILOT = {216: "DO_SPRAYER", 217: "DO_SEND_SCRIPT_MESSAGE", 218: "DO_AUX_FUNCTION"}
"""Commands of ArduPilot's dialect, which ours does not have."""

PAYLOAD = frozenset(
    {
        dialect.MAV_CMD_NAV_ROI,
        dialect.MAV_CMD_DO_SET_RELAY,
        dialect.MAV_CMD_DO_REPEAT_RELAY,
        dialect.MAV_CMD_DO_SET_SERVO,
        dialect.MAV_CMD_DO_REPEAT_SERVO,
        dialect.MAV_CMD_DO_SET_ACTUATOR,
        dialect.MAV_CMD_DO_SET_ROI_LOCATION,
        dialect.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET,
        dialect.MAV_CMD_DO_SET_ROI_NONE,
        dialect.MAV_CMD_DO_SET_ROI_SYSID,
        dialect.MAV_CMD_DO_CONTROL_VIDEO,
        dialect.MAV_CMD_DO_SET_ROI,
        dialect.MAV_CMD_DO_DIGICAM_CONFIGURE,
        dialect.MAV_CMD_DO_DIGICAM_CONTROL,
        dialect.MAV_CMD_DO_MOUNT_CONFIGURE,
        dialect.MAV_CMD_DO_MOUNT_CONTROL,
        dialect.MAV_CMD_DO_MOUNT_CONTROL_QUAT,
        dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        dialect.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL,
        dialect.MAV_CMD_DO_PARACHUTE,
        dialect.MAV_CMD_DO_GRIPPER,
        dialect.MAV_CMD_DO_WINCH,
        dialect.MAV_CMD_DO_ENGINE_CONTROL,
        dialect.MAV_CMD_ILLUMINATOR_ON_OFF,
        dialect.MAV_CMD_DO_ILLUMINATOR_CONFIGURE,
        dialect.MAV_CMD_SET_CAMERA_MODE,
        dialect.MAV_CMD_SET_CAMERA_ZOOM,
        dialect.MAV_CMD_SET_CAMERA_FOCUS,
        dialect.MAV_CMD_SET_CAMERA_SOURCE,
        dialect.MAV_CMD_SET_STORAGE_USAGE,
        dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
        dialect.MAV_CMD_IMAGE_START_CAPTURE,
        dialect.MAV_CMD_IMAGE_STOP_CAPTURE,
        dialect.MAV_CMD_DO_TRIGGER_CONTROL,
        dialect.MAV_CMD_CAMERA_TRACK_POINT,
        dialect.MAV_CMD_CAMERA_TRACK_RECTANGLE,
        dialect.MAV_CMD_CAMERA_STOP_TRACKING,
        dialect.MAV_CMD_VIDEO_START_CAPTURE,
        dialect.MAV_CMD_VIDEO_STOP_CAPTURE,
        dialect.MAV_CMD_VIDEO_START_STREAMING,
        dialect.MAV_CMD_VIDEO_STOP_STREAMING,
        dialect.MAV_CMD_LOGGING_START,
        dialect.MAV_CMD_LOGGING_STOP,
        dialect.MAV_CMD_PANORAMA_CREATE,
        dialect.MAV_CMD_DO_ADSB_OUT_IDENT,
        dialect.MAV_CMD_PAYLOAD_PREPARE_DEPLOY,
        dialect.MAV_CMD_PAYLOAD_CONTROL_DEPLOY,
        *range(dialect.MAV_CMD_USER_1, dialect.MAV_CMD_USER_5 + 1),
        *_OF_ARDUPILOT,
    }
)
"""Commands to what an aircraft carries."""

TAG = dialect.MAV_CMD_JUMP_TAG
MARKERS = frozenset(
    {
        TAG,
        dialect.MAV_CMD_DO_LAND_START,
        dialect.MAV_CMD_DO_RETURN_PATH_START,
        dialect.MAV_CMD_DO_FENCE_ENABLE,
        dialect.MAV_CMD_DO_AUTOTUNE_ENABLE,
        dialect.MAV_CMD_CONDITION_YAW,
    }
)
"""Marks in the list of items, and what changes no path: a heading, which is the path's here."""

ANNOUNCED = PAYLOAD | MARKERS
"""Commands that are announced where they are passed."""

FLOWN_STRAIGHT = frozenset({dialect.MAV_CMD_NAV_SPLINE_WAYPOINT, dialect.MAV_CMD_NAV_ARC_WAYPOINT})
"""Waypoints that are to be reached on a curve, and are reached on a line."""


def command_name(command: int) -> str:
    """Return the name of a command without MAV_CMD; its number if there is none."""
    entry = dialect.enums["MAV_CMD"].get(command)
    if entry is None:
        return _OF_ARDUPILOT.get(command, f"command {command}")
    return entry.name.removeprefix("MAV_CMD_")


def command_text(item: MissionItem) -> str:
    """Describe an item by its command and params, such as "DO_SET_SERVO 9 1500"."""
    values = [
        decimal_of_float32(value) for value in (item.param1, item.param2, item.param3, item.param4)
    ]
    while values and (values[-1] == 0.0 or math.isnan(values[-1])):
        values.pop()
    return " ".join([command_name(item.command), *(f"{value:g}" for value in values)])
