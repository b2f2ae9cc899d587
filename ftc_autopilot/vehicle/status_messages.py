"""Status messages of a vehicle: identity, capabilities, health."""

import re
from collections.abc import Callable
from importlib.metadata import version

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.vehicle.battery import CELLS, CURRENT_CA, battery_at
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.estimator_messages import EstimatorMessages
from ftc_autopilot.vehicle.fence import VehicleFence
from ftc_autopilot.vehicle.message import message
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message

VERSION = tuple(map(int, re.findall(r"\d+", version("ftc-sitl"))[:3]))
"""Major, minor and patch of the installed package."""

_UID = 0x4654_4300_0000_0000  # "FTC"
_UID2_SIZE = 18
_CAPABILITIES = (
    dialect.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)
# MAVSDK takes a vehicle for healthy by these, MAVProxy announces a fence breach without GEOFENCE
_FENCE = dialect.MAV_SYS_STATUS_GEOFENCE
_ACTUATORS = dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
_SENSORS = (
    dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
    | dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | dialect.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
    | dialect.MAV_SYS_STATUS_SENSOR_GPS
    | _FENCE
    | dialect.MAV_SYS_STATUS_SENSOR_BATTERY
    | dialect.MAV_SYS_STATUS_AHRS
    | dialect.MAV_SYS_STATUS_PREARM_CHECK
    | _ACTUATORS
)
_UINT16, _UNKNOWN_I16 = 2**16 - 1, 2**15 - 1  # the former also: no such cell
_VOLTAGES = 10  # of BATTERY_STATUS


class StatusMessages:
    """Makes the messages that do not depend on the aircraft's motion."""

    def __init__(
        self,
        config: AutopilotConfig,
        actuators_healthy: Callable[[], bool],
        estimator: EstimatorMessages,
        fence: VehicleFence,
        frames_dropped: Callable[[], int],
        clock: VehicleClock,
    ) -> None:
        self._actuators_healthy, self._frames_dropped = actuators_healthy, frames_dropped
        self._clock, self._estimator, self._fence = clock, estimator, fence
        self._system = config.id
        self._capabilities = _CAPABILITIES | config.param_capability

    @message(dialect.MAVLink_autopilot_version_message)
    def autopilot_version(self) -> MAVLink_message:
        """Return AUTOPILOT_VERSION."""
        major, minor, patch = VERSION
        version = major << 24 | minor << 16 | patch << 8 | dialect.FIRMWARE_VERSION_TYPE_OFFICIAL
        uid2 = f"ftc-sitl UAV {self._system}".encode().ljust(_UID2_SIZE, b"\0")
        return dialect.MAVLink_autopilot_version_message(
            self._capabilities,
            version,
            *(0, 0, 0),
            *([0] * 8, [0] * 8, [0] * 8),
            *(0, 0),
            _UID | self._system,
            [*uid2],
        )

    @message(
        dialect.MAVLink_sys_status_message,
        every_s=1.0,
        stream=dialect.MAV_DATA_STREAM_EXTENDED_STATUS,
    )
    def sys_status(self) -> MAVLink_message:
        """Return SYS_STATUS: all is well, but what diagnosis, estimator and fence exclude.

        It counts drops on the ground stations' links.
        """
        present = self._estimator.fitted(_SENSORS)
        health = present if self._actuators_healthy() else present & ~_ACTUATORS
        health &= ~(_FENCE if self._fence.is_breached else 0)
        enabled = present & ~(0 if self._fence.enabled else _FENCE)
        battery = battery_at(self._clock.boot_us / 1e6)
        return dialect.MAVLink_sys_status_message(
            present,
            enabled,
            self._estimator.healthy(health),
            0,  # load
            CELLS * battery.cell_mv,
            CURRENT_CA,
            battery.remaining_percent,
            0,  # drop rate
            min(self._frames_dropped(), _UINT16),
            *[0] * 4,
        )

    @message(
        dialect.MAVLink_battery_status_message, every_s=2.0, stream=dialect.MAV_DATA_STREAM_EXTRA3
    )
    def battery_status(self) -> MAVLink_message:
        """Return BATTERY_STATUS, of the avionics."""
        battery = battery_at(self._clock.boot_us / 1e6)
        cells = [battery.cell_mv] * CELLS
        return dialect.MAVLink_battery_status_message(
            0,
            dialect.MAV_BATTERY_FUNCTION_AVIONICS,
            dialect.MAV_BATTERY_TYPE_LIPO,
            _UNKNOWN_I16,
            cells + [_UINT16] * (_VOLTAGES - CELLS),
            CURRENT_CA,
            battery.consumed_mah,
            battery.consumed_hj,
            battery.remaining_percent,
            battery.time_left_s,
            dialect.MAV_BATTERY_CHARGE_STATE_OK,
        )
