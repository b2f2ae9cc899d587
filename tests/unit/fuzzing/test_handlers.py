"""Noise, damaged frames and extreme values change nothing, raise nothing, and are counted."""

import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzzing.frames import MESSAGES, damaged, frame_of, message_frame, noise
from fuzzing.targets import (
    AutopilotTarget,
    PlantTarget,
    StationTarget,
    Target,
    parse_all_ways,
    records_of_tlog,
)
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.command import InvalidParam, fault_from_params
from mavlink_defs.faults.kinds import FaultLimits
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, drop_reason, parse
from mavlink_defs.profile import AirspeedLimits, ProfileError, items_to_segments
from mavlink_defs.services.fault_list import FaultLister
from mavlink_defs.services.machine import SystemId

pytestmark = pytest.mark.slow

SEEDS = st.integers(0, 2**32 - 1)
IDS = sorted(MESSAGES)
PER_SEED = 8
TARGETS: dict[str, Callable[[Scenario], Target]] = {
    "gcs link": lambda s: AutopilotTarget(s, "gcs"),
    "simulator link": lambda s: AutopilotTarget(s, "simulator"),
    "formation link": lambda s: AutopilotTarget(s, "formation"),
    "plant": lambda s: PlantTarget(s, stranger=False),
    "plant by a stranger": lambda s: PlantTarget(s, stranger=True),
    "station": lambda _: StationTarget(),
}


@pytest.fixture(params=TARGETS, scope="module")
def target(request: pytest.FixtureRequest, scenario1: Scenario) -> Iterator[Target]:
    target = TARGETS[request.param](scenario1)
    yield target
    target.close()


@given(seed=SEEDS)
def test_an_invalid_datagram_changes_nothing_and_is_counted_once(target: Target, seed: int) -> None:
    random = Random(seed)
    frames = [
        message_frame(random, random.choice(IDS), target.sender, target.target)
        for _ in range(PER_SEED)
    ]
    for datagram in (*(damaged(random, frame) for frame in frames), noise(random), b""):
        before, drops = target.state(), target.drops()
        target.feed(datagram)
        assert target.state() == before, datagram.hex()
        assert target.drops() == drops + 1, datagram.hex()


def test_every_message_with_extreme_values_is_survived(target: Target) -> None:
    random = Random(1)
    for round_ in range(3):
        for message_id in IDS:
            target.feed(message_frame(random, message_id, target.sender, target.target))
        if isinstance(target, AutopilotTarget):
            target.handle_timer(10.0 * round_)
            controls = target.step()
            assert np.isfinite(controls).all()
            assert (abs(controls) <= 1.0).all()
        elif isinstance(target, PlantTarget):
            assert np.isfinite(target.fly(3)).all()
        elif isinstance(target, StationTarget):
            target.handle_timer(10.0 * round_)


def test_a_stranger_s_frames_change_nothing_in_the_plant(scenario1: Scenario) -> None:
    target, random = PlantTarget(scenario1, stranger=True), Random(2)
    before = target.state()
    for message_id in IDS:
        target.feed(message_frame(random, message_id, target.sender, target.target))
    assert target.state() == before
    assert target.drops() == len(IDS)
    target.close()


@given(st.binary(max_size=400))
def test_parsers_agree_on_noise(data: bytes) -> None:
    parse_all_ways(data)
    parse_all_ways(b"\xfd" + data)


@given(seed=SEEDS)
def test_parsers_agree_on_frames(seed: int) -> None:
    random = Random(seed)
    frame = message_frame(random, random.choice(IDS), (1, 1), (255, 190))
    assert parse_all_ways(frame)
    assert not parse_all_ways(damaged(random, frame))


def test_parse_takes_mavlink_2_frames_of_the_dialect_only() -> None:
    beat = dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 4, 3)
    mavlink = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    old = bytes(beat.pack(mavlink, force_mavlink1=True))
    unknown = frame_of(0xABCDEF, b"something", 1, 1, 0)
    frame = bytes(beat.pack(mavlink))
    flagged = bytearray(frame)
    flagged[2] = 2
    for datagram, reason in (
        (old, DropReason.BAD_MAGIC),
        (unknown, DropReason.UNEXPECTED),
        (bytes(flagged), DropReason.BAD_FLAGS),
        (frame + b"\0", DropReason.BAD_LENGTH),
        (frame[:-1], DropReason.TRUNCATED),
        (b"", DropReason.TRUNCATED),
        (frame[:-1] + bytes([frame[-1] ^ 1]), DropReason.BAD_CRC),
    ):
        assert parse(datagram) is None
        assert drop_reason(datagram) == reason
    assert parse(frame) is not None


@given(data=st.binary(max_size=200), seed=SEEDS)
def test_the_tlog_reader_survives_anything(data: bytes, seed: int) -> None:
    random = Random(seed)
    frame = message_frame(random, random.choice(IDS), (1, 1), (255, 190))
    record = struct.pack(">Q", 1) + frame
    assert records_of_tlog(record * 2) == 2
    assert records_of_tlog(record + data) >= 1
    records_of_tlog(data)


ANY = st.floats() | st.sampled_from([0.0, 1.0, -1.0, 3.0])


@given(params=st.tuples(*[ANY] * 7))
def test_what_the_fault_decoder_accepts_is_finite_and_in_range(params: tuple[float, ...]) -> None:
    with suppress(InvalidParam):
        fault = fault_from_params(
            ACTUATOR_FAULTS, params, FaultLimits(((-35.0, 35.0),) * 3, 2000.0)
        )
        assert fault.number in range(4)
        assert 0.0 <= fault.effectiveness <= 1.0
        assert np.isfinite([fault.value, fault.frequency_hz]).all()
        assert fault.start_s != np.inf


@given(seed=SEEDS)
def test_what_the_profile_decoder_accepts_is_finite(seed: int) -> None:
    random = Random(seed)
    items = []
    for seq in range(random.randint(0, 4)):
        number = dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT
        item = parse(message_frame(random, number, (255, 190), (1, 1)))
        assert isinstance(item, dialect.MAVLink_mission_item_int_message)
        item.seq, item.frame = seq, 0
        item.command = dialect.MAV_CMD_FTC_REFERENCE_SEGMENT if seq else 16
        items.append(item)
    with suppress(ProfileError):
        for s in items_to_segments(items, AirspeedLimits(20.0, 60.0)):
            values = (s.start_s, s.airspeed_m_s, s.roll_deg, s.pitch_deg, s.yaw_deg)
            assert np.isfinite(values).all()


def test_a_fault_of_no_actuator_is_ignored() -> None:
    lister = FaultLister(SystemId(255, 190), SystemId(1, 1))
    lister.start(0.0)
    speaker = FramePacker(1, 1)
    for actuator in (4, 255, 2):
        fault = dialect.MAVLink_ftc_fault_message(0.5, 0, 0, 0, 9, 0, 1, actuator, 1)
        lister.receive(parse(speaker.pack(fault)), 0.0)  # type: ignore[arg-type]  # it parses
    command = dialect.MAV_CMD_REQUEST_MESSAGE
    ack = dialect.MAVLink_command_ack_message(command, 0, 0, 0, 255, 190)
    lister.receive(parse(speaker.pack(ack)), 0.0)  # type: ignore[arg-type]  # it parses
    (listed,) = lister.events()
    assert [f.whose for f in listed.faults] == ["rudder"]


def hot(target: Target, record: np.ndarray, message_id: int) -> bytes:
    datagram = codec.new_buffer()
    length = codec.pack(datagram, record, message_id, *target.sender, 0)
    return datagram[:length].tobytes()


@pytest.mark.parametrize("time_usec", [1, 2**63, 2**64 - 2, 2**64 - 1])
def test_an_actuator_message_of_the_future_does_not_hold_off_all_others(
    scenario1: Scenario, time_usec: int
) -> None:
    """UINT64_MAX, taken over, would even mean that none was applied."""
    target = PlantTarget(scenario1, stranger=False)
    target.feed(b"")  # the states of step 0 are sent
    before = target.state()
    message = np.zeros(1, codec.ACTUATORS)
    message["controls"][0, 3], message["time_usec"] = 0.5, time_usec
    target.feed(hot(target, message, codec.MessageId.ACTUATORS))
    assert target.state() == before
    message["time_usec"] = 0
    target.feed(hot(target, message, codec.MessageId.ACTUATORS))
    assert target.state() != before
    target.close()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
def test_a_state_that_is_none_is_not_worked_on(scenario1: Scenario, value: float) -> None:
    target = AutopilotTarget(scenario1, "simulator")
    before, drops = target.state(), target.drops()
    for field in ("position", "velocity", "attitude", "rates", "specific_force"):
        state = np.zeros(1, codec.SIM_STATE)
        state[field][0, 1] = value
        target.feed(hot(target, state, codec.MessageId.SIM_STATE))
    assert target.state() == before
    assert target.drops() == drops + 5
    target.close()


def test_only_a_vehicle_itself_says_where_it_is() -> None:
    target = StationTarget()
    beat = dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 4, 3)
    system = target.sender[0]
    known = dict(target.client._peers)
    target.client.datagram_received(FramePacker(system, 77).pack(beat), ("127.0.0.1", 9))
    assert target.client._peers == known
