"""SETUP_SIGNING: which keys a vehicle takes over, and from when its timestamps begin."""

import time

import pytest

from ftc_autopilot.vehicle.gcs_signing import GcsSigning
from mavlink_defs import dialect
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.framing.signing import Signer, timestamp

KEY = bytes(range(1, 33))


def setup(initial: int) -> dialect.MAVLink_setup_signing_message:
    return dialect.MAVLink_setup_signing_message(3, 1, list(KEY), initial)


@pytest.mark.parametrize("initial", [2**48, 2**64 - 1, 2**48 - 1, 2**47])
def test_a_key_with_a_time_of_the_far_future_is_refused(initial: int) -> None:
    gcs_signing = GcsSigning(3, None)
    text = gcs_signing.set_key(setup(initial), "127.0.0.1", armed=False)
    assert text is not None
    assert f"initial_timestamp {initial} " in text
    frame = FramePacker(3, 1).pack(dialect.MAVLink_ping_message(0, 0, 0, 0))
    assert gcs_signing.sign(frame) == frame  # no key is in force


def test_a_key_with_a_time_of_today_is_taken_and_others_are_heard() -> None:
    gcs_signing = GcsSigning(3, None)
    now = timestamp(time.time())
    assert gcs_signing.set_key(setup(now + 1_000_000), "127.0.0.1", armed=False) is not None
    frame = FramePacker(255, 190).pack(dialect.MAVLink_ping_message(0, 0, 0, 0))
    assert gcs_signing.accept(frame) == DropReason.UNSIGNED
    assert not isinstance(gcs_signing.accept(Signer(KEY).sign(frame)), DropReason)
