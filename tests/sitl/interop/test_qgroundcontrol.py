"""QGroundControl's requests to a vehicle at connect, in its order; every one has an answer.

QGroundControl cannot be installed here. Requests and their fields follow its source, master of
2025: `InitialConnectStateMachine.cc` (its states in order), `StandardModes.cc`,
`RequestMetaDataTypeStateMachine.cc`, `ParameterManager.cc`, `PlanManager.cc`,
`APMFirmwarePlugin.cc` (`initializeStreamRates`), `QGCCameraManager.cc`, `GimbalController.cc`.
"""

import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest
from standing import Standing

from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import segments_to_items
from mavlink_defs.services.mission import MissionItem

pytestmark = pytest.mark.sitl

UAV, AUTOPILOT = 2, 1
TIMEOUT_S = 600.0
ACCEPTED, UNSUPPORTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_UNSUPPORTED
REQUEST, SET_INTERVAL = dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAV_CMD_SET_MESSAGE_INTERVAL

# not in the dialect: work in progress in common.xml, or gone from it
PROTOCOL_VERSION, COMPONENT_INFORMATION, COMPONENT_METADATA, AVAILABLE_MODES = 300, 395, 397, 435
CAMERA_INFORMATION, GIMBAL_MANAGER_INFORMATION = 259, 280
HOME_POSITION, AUTOPILOT_VERSION = 242, 148


class QGroundControl:
    """System 255, component 190, on the port that vehicles send to."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.settimeout(0.5)
        self._speaker = FramePacker(255, 190)
        self._peer: Any = None
        self.wait_for("HEARTBEAT")

    def close(self) -> None:
        self._socket.close()

    def send(self, message: dialect.MAVLink_message) -> None:
        self._socket.sendto(self._speaker.pack(message), self._peer)

    def hear(self) -> Any:
        """The next message of the vehicle, or None after a silence."""
        try:
            frame, peer = self._socket.recvfrom(300)
        except TimeoutError:
            return None
        message = parse(frame)
        if message is None or message.get_srcSystem() != UAV:
            return None
        self._peer = peer
        return message

    def wait_for(self, name: str, **fields: Any) -> Any:
        end = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end:
            message = self.hear()
            if message is None or message.get_type() != name:
                continue
            if all(getattr(message, key) == value for key, value in fields.items()):
                return message
        raise AssertionError(f"no {name} {fields}")

    def command(self, number: int, *params: float) -> int:
        seven = (*params, *[0.0] * 7)[:7]
        self.send(dialect.MAVLink_command_long_message(UAV, AUTOPILOT, number, 0, *seven))
        return int(self.wait_for("COMMAND_ACK", command=number).result)

    def request(self, number: int, name: str, *params: float) -> Any:
        """REQUEST_MESSAGE as Vehicle::requestMessage does it: message and ACK in any order."""
        seven = (number, *params, *[0.0] * 7)[:7]
        self.send(dialect.MAVLink_command_long_message(UAV, AUTOPILOT, REQUEST, 0, *seven))
        end, answer, result = time.monotonic() + TIMEOUT_S, None, None
        while (answer is None or result is None) and time.monotonic() < end:
            message = self.hear()
            if message is not None and message.get_type() == name:
                answer = message
            elif message is not None and message.get_type() == "COMMAND_ACK":
                result = message.result
        assert (result, answer is not None) == (ACCEPTED, True), name
        return answer


@pytest.fixture(scope="module")
def qgc(fleet: Standing) -> Iterator[QGroundControl]:
    station = QGroundControl(fleet.port)
    gcs, invalid = dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID
    station.send(dialect.MAVLink_heartbeat_message(gcs, invalid, 0, 0, 4, 3))
    yield station
    station.close()


def test_1_autopilot_version(qgc: QGroundControl) -> None:
    version = qgc.request(AUTOPILOT_VERSION, "AUTOPILOT_VERSION")
    assert version.flight_sw_version >> 8 == 0x000100
    assert version.uid > 0
    assert not version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_FTP
    for capability in (
        dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE,
        dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY,
    ):
        assert version.capabilities & capability  # else it asks for neither


def test_2_standard_modes_and_component_information_are_not_offered(qgc: QGroundControl) -> None:
    for message_id in (AVAILABLE_MODES, COMPONENT_METADATA, COMPONENT_INFORMATION):
        assert qgc.command(REQUEST, message_id) == UNSUPPORTED
    for number in (REQUEST, dialect.MAV_CMD_REQUEST_PROTOCOL_VERSION):  # older releases
        assert qgc.command(number, PROTOCOL_VERSION) == UNSUPPORTED


def test_3_parameters(qgc: QGroundControl) -> None:
    name = b"@PARAM/param.pck?withdefaults=1"
    payload = [7, 0, 0, 4, len(name), 0, 0, 0, 0, 0, 0, 0, *name]
    payload += [0] * (251 - len(payload))
    qgc.send(dialect.MAVLink_file_transfer_protocol_message(0, UAV, AUTOPILOT, payload))
    nak = qgc.wait_for("FILE_TRANSFER_PROTOCOL", target_component=190)
    assert nak.payload[3] == 129
    qgc.send(dialect.MAVLink_param_request_list_message(UAV, dialect.MAV_COMP_ID_ALL))
    first = qgc.wait_for("PARAM_VALUE", param_index=0)
    seen = {0}
    while len(seen) < first.param_count:
        seen.add(qgc.wait_for("PARAM_VALUE").param_index)
    for index in (3, 17):  # as if they had been lost
        qgc.send(dialect.MAVLink_param_request_read_message(UAV, AUTOPILOT, b"", index))
        qgc.wait_for("PARAM_VALUE", param_index=index)


def areas() -> tuple[list[MissionItem], list[MissionItem]]:
    """A fence and rally points as GeoFenceManager and RallyPointManager send them."""
    corners = [(-353000000, 1491000000), (-353000000, 1492500000), (-354500000, 1492000000)]
    corner = dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    fence = [mission_item(k, corner, (3.0,), *place, 0.0, 0) for k, place in enumerate(corners)]
    circle = dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
    fence.append(mission_item(3, circle, (50.0,), -353100000, 1491800000, 0.0, 0))
    rally = mission_item(0, dialect.MAV_CMD_NAV_RALLY_POINT, (), -353500000, 1491700000, 100.0)
    return fence, [rally]


def test_4_mission_geofence_and_rally_points(qgc: QGroundControl, fleet: Standing) -> None:
    parts = (segments_to_items(fleet.scenario.segments(), UAV, AUTOPILOT), *areas())
    for mission_type, items in enumerate(parts):
        count = dialect.MAVLink_mission_count_message(UAV, AUTOPILOT, len(items), mission_type)
        qgc.send(count)
        for item in items:
            qgc.wait_for("MISSION_REQUEST_INT", seq=item.seq, mission_type=mission_type)
            item.target_system, item.target_component = UAV, AUTOPILOT
            item.mission_type = mission_type
            qgc.send(item)
        ack = qgc.wait_for("MISSION_ACK", mission_type=mission_type)
        assert ack.type == dialect.MAV_MISSION_ACCEPTED
    for mission_type, expected in enumerate(map(len, parts)):
        qgc.send(dialect.MAVLink_mission_request_list_message(UAV, AUTOPILOT, mission_type))
        assert qgc.wait_for("MISSION_COUNT", mission_type=mission_type).count == expected
        for seq in range(expected):
            request = dialect.MAVLink_mission_request_int_message(UAV, AUTOPILOT, seq, mission_type)
            qgc.send(request)
            found = qgc.wait_for("MISSION_ITEM_INT", seq=seq, mission_type=mission_type)
            assert found.command == parts[mission_type][seq].command
        qgc.send(dialect.MAVLink_mission_ack_message(UAV, AUTOPILOT, 0, mission_type))


def test_5_streams_and_home(qgc: QGroundControl) -> None:
    for stream, rate in ((1, 2), (2, 2), (3, 2), (6, 3), (10, 10), (11, 10), (12, 3)):
        message = dialect.MAVLink_request_data_stream_message(UAV, AUTOPILOT, stream, rate, 1)
        qgc.send(message)
    assert qgc.command(SET_INTERVAL, HOME_POSITION, 1e6) == ACCEPTED
    for name in (
        "HOME_POSITION",
        "BATTERY_STATUS",
        "EXTENDED_SYS_STATE",
        "SYS_STATUS",
        "VFR_HUD",
        "GLOBAL_POSITION_INT",
        "GPS_RAW_INT",
        "ATTITUDE",
        "MISSION_CURRENT",
    ):
        qgc.wait_for(name)


def test_6_no_camera_and_no_gimbal(qgc: QGroundControl) -> None:
    assert qgc.command(REQUEST, CAMERA_INFORMATION) == UNSUPPORTED
    assert qgc.command(dialect.MAV_CMD_REQUEST_CAMERA_INFORMATION, 1) == UNSUPPORTED
    assert qgc.command(REQUEST, GIMBAL_MANAGER_INFORMATION) == UNSUPPORTED


def test_7_time_and_link(qgc: QGroundControl) -> None:
    qgc.send(dialect.MAVLink_system_time_message(1, 1))  # sent, not requested
    qgc.send(dialect.MAVLink_ping_message(5, 1, 0, 0))
    assert qgc.wait_for("PING", target_component=190).seq == 1
    qgc.send(dialect.MAVLink_timesync_message(0, 99))
    assert qgc.wait_for("TIMESYNC", ts1=99).tc1 > 0
