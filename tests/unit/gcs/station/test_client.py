"""The client on a real socket, with a vehicle in the same event loop."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from gcs.console.errors import BadInput, CommandRefused, NoAnswer
from gcs.station.client import Client
from gcs.station.notifications import Notification
from gcs.station.telemetry import REQUESTED_S
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogWriter
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.endpoint import Connection, UdpAddress, free_ports
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, parse, text_chunks
from mavlink_defs.framing.signing import make_key
from mavlink_defs.profile import Segment
from mavlink_defs.services.command_server import CommandServer
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission_server import MissionServer
from mavlink_defs.system_ids import bits_of

REAL, INT = dialect.MAV_PARAM_TYPE_REAL32, dialect.MAV_PARAM_TYPE_INT32
PATIENCE_S = 60.0


class FakeVehicle(asyncio.DatagramProtocol):
    """Answers whoever speaks to it; arms, refuses to start, never answers a change of mode."""

    def __init__(self, system: int) -> None:
        own = SystemId(system, 1)
        self.speaker = FramePacker(*own)
        self.commands = CommandServer(own)
        self.mission = MissionServer(own, lambda items: None)
        self.params = {"B1": (0.25, REAL), "COUNT": (7.0, INT)}
        self.transport: Any = None
        self.peer: Any = None
        self.heartbeats = 0
        self.intervals: list[int] | None = None  # of which messages; None: it refuses them
        self.fleet: list[int] | None = None  # its members; None: it refuses to tell
        self.fleets_lost = 0  # messages that tell it and are lost on their way

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def say(self, *messages: MAVLink_message) -> None:
        for message in messages:
            self.transport.sendto(self.speaker.pack(message), self.peer)

    def beat(self, status: int = dialect.MAV_STATE_STANDBY) -> None:
        self.say(dialect.MAVLink_heartbeat_message(1, 3, 0, 12, status, 3))

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self.peer = addr
        message = parse(data)
        now = asyncio.get_running_loop().time()
        match message:
            case dialect.MAVLink_heartbeat_message():
                self.heartbeats += 1
                self.beat()
            case dialect.MAVLink_param_request_list_message():
                for name in self.params:
                    self.value(name)
            case dialect.MAVLink_param_request_read_message():
                self.value(message.param_id)
            case dialect.MAVLink_param_set_message(param_id=name, param_value=value):
                if value < 0.0:
                    refusal = dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
                    raw = name.encode()
                    self.say(dialect.MAVLink_param_error_message(255, 190, raw, -1, refusal))
                else:
                    self.params[name] = (value, self.params[name][1])
                    self.value(name)
        assert message is not None
        self.mission.receive(message, now)
        self.commands.receive(message, now)
        for command in self.commands.events():
            number = command.message.command
            if number == dialect.MAV_CMD_MISSION_START:
                self.say(*text_chunks(dialect.MAV_SEVERITY_WARNING, "no profile", 1))
                self.commands.finish(command.token, dialect.MAV_RESULT_DENIED, now=now)
            elif number == dialect.MAV_CMD_SET_MESSAGE_INTERVAL and self.intervals is not None:
                self.intervals.append(int(command.message.param1))
                if self.intervals[-1] == dialect.MAVLINK_MSG_ID_FTC_EVENTS:
                    four = [0] * 4
                    self.say(dialect.MAVLink_ftc_events_message(0, 0, four, four, 0, four, 0))
                self.commands.finish(command.token, dialect.MAV_RESULT_ACCEPTED, now=now)
            elif number == dialect.MAV_CMD_REQUEST_MESSAGE and self.fleet is not None:
                if self.fleets_lost == 0:  # behind the acknowledgement, as ArduPilot sends it
                    answer = dialect.MAVLink_ftc_fleet_message(bits_of(self.fleet))
                    asyncio.get_running_loop().call_soon(self.say, answer)
                self.fleets_lost = max(self.fleets_lost - 1, 0)
                self.commands.finish(command.token, dialect.MAV_RESULT_ACCEPTED, now=now)
            elif number == dialect.MAV_CMD_COMPONENT_ARM_DISARM:
                self.commands.finish(command.token, dialect.MAV_RESULT_ACCEPTED, now=now)
            elif number != dialect.MAV_CMD_DO_SET_MODE:
                self.commands.finish(command.token, dialect.MAV_RESULT_UNSUPPORTED, now=now)
        acks = [
            ack
            for ack in self.commands.messages_to_send()
            if getattr(ack, "command", None) != dialect.MAV_CMD_DO_SET_MODE
        ]
        self.say(*self.mission.messages_to_send(), *acks)

    def value(self, name: str) -> None:
        i = list(self.params).index(name)
        value, kind = self.params[name]
        self.say(dialect.MAVLink_param_value_message(name.encode(), value, kind, 2, i))


@contextlib.asynccontextmanager
async def connected(
    tells_private: bool = False, **options: Any
) -> AsyncIterator[tuple[Client, Vehicle, FakeVehicle]]:
    fake = FakeVehicle(7)
    fake.intervals = [] if tells_private else None
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(lambda: fake, ("127.0.0.1", 0))
    port = transport.get_extra_info("sockname")[1]
    try:
        async with Client(Connection("out", UdpAddress("127.0.0.1", port)), **options) as client:
            (vehicle,) = await client.discover(PATIENCE_S, [7])
            yield client, vehicle, fake
    finally:
        transport.close()


def run(test: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(test())


def test_parameters() -> None:
    async def test() -> None:
        async with connected() as (client, vehicle, fake):
            steps: list[tuple[int, int]] = []
            params = await vehicle.list_params(lambda done, total: steps.append((done, total)))
            assert [(p.name, p.value) for p in params] == [("B1", 0.25), ("COUNT", 7)]
            assert steps == [(1, 2), (2, 2)]
            assert (await vehicle.set_param("COUNT", 9.0)).value == 9
            assert fake.params["COUNT"] == (9.0, INT)
            with pytest.raises(CommandRefused, match=r"B1 = -1 \(MAV_PARAM_ERROR_VALUE_OUT_OF"):
                await vehicle.set_param("B1", -1.0)
            with pytest.raises(BadInput, match="expected a whole number, got"):
                await vehicle.set_param("COUNT", 1.5)
            with pytest.raises(BadInput, match="ASCII"):
                await vehicle.get_param("MUCH_TOO_LONG_A_NAME")
            refusals = [n.text for n in client.log if n.severity == dialect.MAV_SEVERITY_WARNING]
            assert refusals == ["UAV 7 refused B1 = -1 (MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)"]

    run(test)


def test_a_refusal_has_the_reason_that_the_vehicle_gave() -> None:
    async def test() -> None:
        async with connected() as (_, vehicle, fake):
            fake.say(*text_chunks(dialect.MAV_SEVERITY_WARNING, "an older story", 1))
            await vehicle.arm()
            with pytest.raises(CommandRefused) as refused:
                await vehicle.start_mission()
            assert str(refused.value) == (
                "UAV 7 refused MAV_CMD_MISSION_START (MAV_RESULT_DENIED): no profile"
            )
            assert refused.value.exit_status == 3

    run(test)


def test_a_command_that_is_given_up_leaves_room_for_the_next() -> None:
    async def test() -> None:
        async with connected() as (_, vehicle, _):
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.1):
                    await vehicle.set_mode("AUTO")
            await vehicle.arm()
            results = await asyncio.gather(*(vehicle.arm() for _ in range(3)))
            assert results == [None, None, None]

    run(test)


def test_profiles_and_inquiries() -> None:
    """A vehicle that has no faults to tell is not asked twice; a new profile is noticed."""

    async def test() -> None:
        notifications: list[Notification] = []
        async with connected(inquire=True, on_notification=notifications.append) as (
            client,
            vehicle,
            fake,
        ):
            state = vehicle.state
            assert await client.until(lambda: state.profile == (), PATIENCE_S)
            assert (state.faults, state.offers_faults) == (None, False)
            segment = Segment(0.0, 40.0, 0.0, 0.0, 0.0, ramp=False)
            steps: list[tuple[int, int]] = []
            await vehicle.upload_profile([segment], lambda done, total: steps.append((done, total)))
            assert steps == [(1, 2), (2, 2)]
            assert len(fake.mission.items) == 2
            assert await client.until(lambda: state.profile == (segment,), PATIENCE_S)
            assert await vehicle.download_profile() == (segment,)
            texts = [one.text for one in notifications]
            assert texts[0] == "vehicle found"
            assert "holds profile of 1 segments" in texts
            assert list(client.log) == notifications

    run(test)


def test_private_messages_are_asked_for_at_first_and_after_a_restart() -> None:
    async def test() -> None:
        async with connected(tells_private=True, private=True) as (client, vehicle, fake):
            await client.wait_for([7], PATIENCE_S)
            assert vehicle.state.tells_private
            assert fake.intervals is not None
            assert await client.until(
                lambda: len(fake.intervals or ()) == len(REQUESTED_S), PATIENCE_S
            )
            assert set(fake.intervals) == set(REQUESTED_S)
            fake.beat(dialect.MAV_STATE_BOOT)
            assert await client.until(
                lambda: len(fake.intervals or ()) == 2 * len(REQUESTED_S), PATIENCE_S
            )

    run(test)


def test_private_messages_are_not_asked_for_without_need_nor_of_who_has_none() -> None:
    async def test() -> None:
        async with connected(tells_private=True) as (client, _, fake):
            await client.wait_for([7], PATIENCE_S)
            await asyncio.sleep(0)
            assert fake.intervals == []
        async with connected(private=True) as (client, vehicle, _):
            await client.wait_for([7], PATIENCE_S)
            assert not vehicle.state.offers_private

    run(test)


def test_a_client_catches_up_with_all_that_has_arrived() -> None:
    async def test() -> None:
        async with connected() as (client, vehicle, fake):
            begin = vehicle.state.texts_heard
            for i in range(100):
                fake.say(*text_chunks(dialect.MAV_SEVERITY_INFO, f"text {i}", i))
            await client.catch_up(PATIENCE_S)
            assert vehicle.state.texts_heard - begin == 100

    run(test)


def test_what_is_only_recorded_shows_that_its_vehicle_lives(tmp_path: Path) -> None:
    attitude = dialect.MAVLink_attitude_message(9, *[0.5] * 6)
    heartbeat = dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 3, 3)
    frame, peer = FramePacker(7, 1).pack(attitude), ("127.0.0.1", 9)
    damaged = frame[:-1] + bytes([frame[-1] ^ 1])
    file, now = tmp_path / "tlog", 0.0

    async def test() -> None:
        nonlocal now
        with TlogWriter(file) as tlog:
            client = Client(
                Connection("in", UdpAddress("127.0.0.1", 0)),
                tlog=tlog,
                only_recorded={attitude.get_msgId()},
                clock=lambda: now,
            )
            async with client:
                client.datagram_received(FramePacker(7, 1).pack(heartbeat), peer)
                now = 1.5
                for data in (frame, damaged, FramePacker(8, 1).pack(attitude)):
                    client.datagram_received(data, peer)
        state = client.vehicle(7).state
        assert (state.heard_at, state.lost) == (1.5, False)
        assert attitude.get_msgId() not in state.latest
        assert client.fleet.unconfirmed == {8}
        assert client.drops == {DropReason.BAD_CRC.text: 1}

    run(test)
    recorded = file.read_bytes()
    assert recorded.count(frame[10:]) == 1
    assert damaged[10:] not in recorded


def test_heartbeats_go_on() -> None:
    async def test() -> None:
        async with connected() as (client, _, fake):
            assert await client.until(lambda: fake.heartbeats >= 3, PATIENCE_S)

    run(test)


def test_silence_and_nobody_there() -> None:
    async def test() -> None:
        async with connected() as (client, vehicle, fake):
            fake.transport.close()
            with pytest.raises(NoAnswer, match="UAV 7 did not answer MAV_CMD_COMPONENT_ARM"):
                await vehicle.arm()
            assert client.unreachable
            assert vehicle.state.lost
            assert [one.kind for one in client.log if one.severity == 3] == ["link", "link", "ack"]
        (port,) = free_ports(1)
        async with Client(Connection("out", UdpAddress("127.0.0.1", port))) as client:
            with pytest.raises(NoAnswer, match=f"nobody listens at 127.0.0.1:{port}"):
                await client.discover(PATIENCE_S)
        async with Client(Connection("in", UdpAddress("127.0.0.1", port))) as client:
            with pytest.raises(NoAnswer, match="no vehicle heard within"):
                await client.discover(0.1)
            with pytest.raises(BadInput, match=f"UDP port {port} .* is in use"):
                async with Client(Connection("in", UdpAddress("127.0.0.1", port))):
                    pass

    run(test)


@pytest.mark.parametrize("lost", [0, 1])
def test_a_vehicle_names_the_members_of_its_fleet_that_are_not_there(lost: int) -> None:
    async def test() -> None:
        async with connected() as (client, vehicle, fake):
            fake.fleet, fake.fleets_lost = [7, 8, 250], lost
            with pytest.raises(NoAnswer, match="UAV 8, 250 of the fleet not heard"):
                await client.discover(0.2)
            assert await client.discover(PATIENCE_S, whole=False) == [vehicle]
            assert await client.discover(PATIENCE_S, [7]) == [vehicle]
            fake.fleet = [7]
            assert await client.discover(PATIENCE_S) == [vehicle]

    run(test)


def test_a_message_that_is_requested_and_does_not_come() -> None:
    async def test() -> None:
        async with connected() as (_, vehicle, fake):
            fake.fleet, fake.fleets_lost = [7], 3
            with pytest.raises(NoAnswer, match="accepted to send FTC_FLEET, which has not come"):
                await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_FLEET)
            await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_FLEET)
            assert dialect.MAVLINK_MSG_ID_FTC_FLEET in vehicle.state.latest

    run(test)


def test_a_late_member_of_the_fleet_is_waited_for() -> None:
    async def test() -> None:
        async with connected() as (client, _, fake):
            fake.fleet = [7, 8]
            heartbeat = FramePacker(8, 1).pack(dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 3, 3))
            discovery = asyncio.create_task(client.discover(PATIENCE_S))
            assert await client.until(lambda: client.fleet.missing == [8], PATIENCE_S)
            fake.transport.sendto(heartbeat, fake.peer)
            assert [vehicle.system for vehicle in await discovery] == [7, 8]

    run(test)


def test_a_member_that_falls_silent_is_missing() -> None:
    async def test() -> None:
        async with connected() as (client, vehicle, fake):
            fake.fleet = [7, 8]
            await vehicle.ask_for_fleet()
            assert client.fleet.missing == [8]
            fake.transport.close()
            assert await client.until(lambda: client.fleet.missing == [7, 8], PATIENCE_S)

    run(test)


def test_unsigned_frames_change_nothing_and_are_counted(tmp_path: Path) -> None:
    key = str(tmp_path / "key")
    make_key(Path(key))

    async def test() -> None:
        async with Client(Connection("in", UdpAddress("127.0.0.1", 0)), signing_key=key) as client:
            heartbeat = dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 3, 3)
            client.datagram_received(FramePacker(7, 1).pack(heartbeat), ("127.0.0.1", 9))
            assert client.drops == {"unsigned": 1}
            assert not client.fleet.vehicles

    run(test)
