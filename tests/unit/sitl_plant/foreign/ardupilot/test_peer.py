"""The order of an ArduPilot's frames: losses, repetitions, restarts, strangers."""

from hypothesis import given
from hypothesis import strategies as st
from json_peer import servo_packet

from sitl_plant.foreign.ardupilot.peer import TAKEOVER_S, Frame, Peer

ONE, OTHER = ("127.0.0.1", 40001), ("127.0.0.1", 40002)
PWM = [1500] * 16


def heard(peer, *counts, address=ONE, now=0.0):
    return [peer.receive(servo_packet(n, PWM), address, now) for n in counts]


def test_frames_in_order_are_new():
    peer = Peer()
    assert heard(peer, 0, 1, 2) == [Frame.NEW] * 3
    assert (peer.frames, peer.missing, peer.repeated, peer.restarts) == (3, 0, 0, 0)
    assert peer.address == ONE


def test_the_plant_may_come_later_than_the_first_frame():
    assert heard(Peer(), 812, 813) == [Frame.NEW] * 2


def test_a_frame_once_more_is_repeated():
    peer = Peer()
    assert heard(peer, 5, 5, 5, 6) == [Frame.NEW, Frame.REPEATED, Frame.REPEATED, Frame.NEW]
    assert (peer.frames, peer.repeated) == (2, 2)


def test_a_gap_of_the_count_is_a_loss():
    peer = Peer()
    assert heard(peer, 5, 6, 9, 10, 12) == [Frame.NEW] * 5
    assert (peer.frames, peer.missing) == (5, 3)


@given(st.integers(1, 2**32 - 1), st.sampled_from([0.0, 0.9, 1.1]))
def test_frame_0_after_others_is_a_restart_but_not_when_it_may_be_late(count, silent):
    peer = Peer()
    heard(peer, count)
    restarts = count > 10 or silent > 1.0
    assert heard(peer, 0, now=silent * TAKEOVER_S) == [
        Frame.RESTARTED if restarts else Frame.DROPPED
    ]
    assert (peer.restarts, peer.missing) == (restarts, 0)


def test_a_count_that_falls_far_back_is_a_restart_and_one_that_comes_late_is_not():
    peer = Peer()
    assert heard(peer, 100, 98, 101, 3) == [
        Frame.NEW, Frame.DROPPED, Frame.NEW, Frame.RESTARTED,
    ]  # fmt: skip
    assert sum(peer.dropped.values()) == 1
    assert "late" in next(iter(peer.dropped))


def test_a_restarted_one_has_another_port_and_was_silent_for_a_second():
    peer = Peer()
    assert heard(peer, 700) == [Frame.NEW]
    assert heard(peer, 0, address=OTHER, now=0.9 * TAKEOVER_S) == [Frame.DROPPED]
    assert heard(peer, 0, address=OTHER, now=1.1 * TAKEOVER_S) == [Frame.RESTARTED]
    assert peer.address == OTHER


COUNTS = st.integers(0, 20) | st.integers(0, 2**32 - 1)


@given(COUNTS, st.lists(st.tuples(COUNTS, st.floats(0.0, 0.99)), max_size=8))
def test_nothing_that_another_sends_counts_while_one_flies(count, sent):
    """Whatever its count: the first of a flight, the last once more, far ahead, far back."""
    peer = Peer()
    heard(peer, count, now=5.0)
    for other, after in sent:
        assert heard(peer, other, address=OTHER, now=5.0 + after * TAKEOVER_S) == [Frame.DROPPED]
    assert (peer.address, peer.frames, peer.repeated, peer.restarts) == (ONE, 1, 0, 0)
    dropped = {"another sender than the ArduPilot that flies": len(sent)} if sent else {}
    assert peer.dropped == dropped
    assert heard(peer, count + 1, now=5.99) == [Frame.NEW if count < 2**32 - 1 else Frame.RESTARTED]


def test_another_sender_goes_on_after_a_second_of_silence():
    peer = Peer()
    heard(peer, 700)
    assert heard(peer, 701, address=OTHER, now=1.1 * TAKEOVER_S) == [Frame.NEW]
    assert heard(peer, 702, address=ONE, now=1.2 * TAKEOVER_S) == [Frame.DROPPED]


@given(st.lists(st.binary(max_size=80), max_size=20))
def test_garbage_is_counted_and_changes_nothing(garbage):
    peer = Peer()
    heard(peer, 4)
    for datagram in garbage:
        assert peer.receive(datagram, OTHER, 0.0) is Frame.DROPPED
    assert sum(peer.dropped.values()) == len(garbage)
    assert peer.describe().count("dropped") == len(peer.dropped)
    assert heard(peer, 5) == [Frame.NEW]
    assert peer.address == ONE
