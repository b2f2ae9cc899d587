"""PX4's lockstep from the simulator's side: whose turn it is, whatever comes."""

import pytest

from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker
from sitl_plant.foreign.px4.lockstep import NotInLockstep, Px4Lockstep, Turn, is_px4

FRAME_US = 4000
packer = FramePacker(1, 1)


class Sent:
    """In place of the instruments: what a frame is asked for."""

    def __init__(self):
        self.frames = []

    def frame(self, time_us, *, with_truth):
        self.frames.append((time_us, with_truth))
        return b"frame"


@pytest.fixture
def sent():
    return Sent()


@pytest.fixture
def px4():
    return Px4Lockstep(FRAME_US)


def controls(time_us, flags=1, first=0.0):
    values = [first] + [0.0] * 15
    return packer.pack(dialect.MAVLink_hil_actuator_controls_message(time_us, values, 129, flags))


def command(number, *params):
    seven = (*params, *[0.0] * 7)[:7]
    return packer.pack(dialect.MAVLink_command_long_message(0, 0, number, 0, *seven))


def asks_for_truth(interval):
    return command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 115, interval)


def test_frame_follows_frame_until_the_first_answer(px4, sent):
    for _ in range(3):
        px4.frame(sent)
    turns = [px4.turn]
    px4.receive(controls(12_000))
    turns.append(px4.turn)
    px4.frame(sent)
    assert [*turns, px4.turn] == [Turn.FREEWHEELING, Turn.SIMULATOR, Turn.PX4]
    assert [time for time, _ in sent.frames] == [4000, 8000, 12_000, 16_000]


def test_a_first_answer_that_is_behind_is_waited_for(px4, sent):
    """While it started, frames came faster than it read them."""
    for _ in range(3):
        px4.frame(sent)
    px4.receive(controls(4000, first=0.1))
    before = px4.turn
    px4.receive(controls(8000, first=0.2) + controls(12_000, first=0.3))
    assert (before, px4.turn) == (Turn.PX4, Turn.SIMULATOR)
    assert px4.controls["controls"][0] == pytest.approx(0.3)
    assert px4.dropped == {"an answer to an earlier frame": 2}


def test_only_the_answer_to_the_last_frame_counts(px4, sent):
    px4.frame(sent)
    px4.receive(controls(4000, first=0.5))
    px4.receive(controls(4000, first=0.6))
    assert px4.controls["controls"][0] == 0.5
    px4.frame(sent)
    px4.receive(controls(4000, first=0.7))
    assert px4.turn is Turn.PX4
    px4.receive(controls(8000, first=0.8))
    assert (px4.turn, px4.answers) == (Turn.SIMULATOR, 2)
    assert px4.dropped == {"a second answer to a frame": 1, "an answer to an earlier frame": 1}


def test_an_answer_of_the_future_is_of_another_simulator(px4, sent):
    px4.frame(sent)
    with pytest.raises(NotInLockstep, match="8000 us and the simulator's at 4000 us"):
        px4.receive(controls(8000))


def test_one_without_lockstep_is_told_apart(px4, sent):
    px4.frame(sent)
    with pytest.raises(NotInLockstep, match="built without lockstep"):
        px4.receive(controls(4000, flags=0))


@pytest.mark.parametrize(("interval", "every"), [(5000, 1), (4000, 1), (8000, 2), (1, 1), (0, 1)])
def test_the_truth_comes_as_often_as_it_is_asked_for(px4, sent, interval, every):
    px4.frame(sent)
    px4.receive(asks_for_truth(interval))
    for _ in range(6):
        px4.frame(sent)
    with_truth = [truth for _, truth in sent.frames]
    assert with_truth == [False] + [k % every == 0 for k in range(1, 7)]
    px4.receive(asks_for_truth(-1))
    px4.frame(sent)
    assert not sent.frames[-1][1]


@pytest.mark.parametrize("interval", [float("nan"), float("inf"), -7.0, 1e38])
def test_no_interval_ends_it(px4, sent, interval):
    px4.receive(asks_for_truth(interval))
    px4.frame(sent)


def test_what_is_not_a_simulators_is_counted(px4):
    px4.receive(command(400, 1.0) + packer.pack(dialect.MAVLink_ping_message(0, 0, 0, 0)))
    px4.receive(packer.pack(dialect.MAVLink_heartbeat_message(0, 12, 0, 0, 0, 3)))
    assert sum(px4.dropped.values()) == 2
    px4.receive(b"GET / HTTP/1.0\r\n\r\n")
    assert px4.damaged == 18


def test_px4_shows_itself_by_its_heartbeat():
    ours = packer.pack(dialect.MAVLink_heartbeat_message(0, 12, 0, 0, 0, 3))
    others = packer.pack(dialect.MAVLink_heartbeat_message(0, 3, 0, 0, 0, 3))
    assert is_px4(ours)
    assert is_px4(asks_for_truth(5000) + ours)
    assert is_px4(ours[:7]) is None
    assert is_px4(others) is False
    assert is_px4(b"GET / HTTP/1.0\r\n\r\n" * 60) is False
