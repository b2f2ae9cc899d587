"""Numbers and names on the wire that several packages share."""

from typing import Literal, TypeAlias, get_args

from mavlink_defs.dialect import (
    FTC_ACTUATOR_AILERON,
    FTC_ACTUATOR_ELEVATOR,
    FTC_ACTUATOR_RUDDER,
    FTC_ACTUATOR_THROTTLE,
    FTC_SENSOR_ACCELEROMETER,
    FTC_SENSOR_AIRSPEED,
    FTC_SENSOR_BAROMETER,
    FTC_SENSOR_GPS,
    FTC_SENSOR_GYRO,
    FTC_SENSOR_MAGNETOMETER,
    MAV_COMP_ID_USER1,
)

N_CHANNELS = 4
"""Actuator channels, in the order of FTC_ACTUATOR: aileron, elevator, rudder, throttle."""

AILERON, ELEVATOR, RUDDER = FTC_ACTUATOR_AILERON, FTC_ACTUATOR_ELEVATOR, FTC_ACTUATOR_RUDDER
"""The channels of the surfaces."""
THROTTLE = FTC_ACTUATOR_THROTTLE
"""The channel of the thrust."""
BRAKE = 4
"""Index of the brakes in HIL_ACTUATOR_CONTROLS.controls, 0 to 1, which are no actuator channel."""

SIMULATOR_COMPONENT = MAV_COMP_ID_USER1
"""Component id of an aircraft inside the plant; its system id is the UAV's."""

Actuator: TypeAlias = Literal["aileron", "elevator", "rudder", "throttle"]

ACTUATORS: tuple[Actuator, ...] = get_args(Actuator)
"""Names of the actuator channels, in the order of FTC_ACTUATOR."""

SURFACES = ACTUATORS[:THROTTLE]
"""Names of the surfaces."""

GYRO, ACCELEROMETER, MAGNETOMETER = (
    FTC_SENSOR_GYRO,
    FTC_SENSOR_ACCELEROMETER,
    FTC_SENSOR_MAGNETOMETER,
)
BAROMETER, GNSS, PITOT = FTC_SENSOR_BAROMETER, FTC_SENSOR_GPS, FTC_SENSOR_AIRSPEED
"""The navigation sensors, on the wire, in the plant and in the estimator; 0 is none.

Faults call the last two gps and airspeed, as MAVLink does.
"""

LAST_SYSTEM = 250
"""Largest system id of a UAV."""

AUTO, RTL, LOITER, TAKEOFF, GUIDED, AUTOLAND = 10, 11, 12, 13, 15, 26
"""custom_mode numbers of ArduPlane."""
MODE_NAMES = {
    AUTO: "AUTO",
    RTL: "RTL",
    LOITER: "LOITER",
    TAKEOFF: "TAKEOFF",
    GUIDED: "GUIDED",
    AUTOLAND: "AUTOLAND",
}

MAX_DATAGRAM = 65535
"""Size of the longest UDP payload, rounded up [bytes]."""

MAX_MISSION_ITEMS = 1000
"""Most items of a mission, without home."""

FORCE_DISARM = 21196.0
"""Parameter 2 of MAV_CMD_COMPONENT_ARM_DISARM that disarms in flight."""

INT32_MAX = 2**31 - 1
"""Largest int32; in x and y of COMMAND_INT and of mission items it stands for NaN."""

OLD_STATE_S = 0.1
"""Real time: an autopilot that acts on a state older than this says so [s, simulated]."""

STATUSTEXT_SIZE = 50
"""Characters that one STATUSTEXT holds; a full one announces that another one follows."""
