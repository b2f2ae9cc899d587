"""Signing: against hashlib and pymavlink, both ways, and what must be refused."""

import hashlib
import struct
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_defs import dialect
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.framing.hot_signing import (
    LinkSigner,
    load_link_signer,
    new_link_signer,
    sign_bytes,
    sign_frame,
    verify_frame,
)
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.framing.sha256 import signature
from mavlink_defs.framing.signing import (
    EPOCH_S,
    PLANT_LINK,
    WINDOW,
    Signer,
    SigningError,
    flagged,
    make_key,
    open_time,
    read_key,
    time_file,
    timestamp,
)

KEY, OTHER = bytes(range(1, 33)), bytes(range(2, 34))
UNSIGNED, WRONG = DropReason.UNSIGNED, DropReason.WRONG_SIGNATURE
REPLAYED, OUT_OF_RANGE = DropReason.REPLAYED, DropReason.OUT_OF_RANGE
ARM = dialect.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)


def frame_of(message: dialect.MAVLink_message = ARM, system: int = 255) -> bytes:
    return FramePacker(system, 190).pack(message)


def opened(link_signer: LinkSigner, frame: bytes) -> int:
    datagram = codec.new_buffer()
    size = min(len(frame), codec.BUFFER_SIZE)
    datagram[:size] = np.frombuffer(frame[:size], np.uint8)
    return verify_frame(link_signer, datagram, size)


@given(st.binary(min_size=32, max_size=32), st.binary(max_size=300))
def test_compiled_hash_is_sha256(key: bytes, data: bytes) -> None:
    expected = int.from_bytes(hashlib.sha256(key + data).digest()[:6], "big")
    buffer = np.frombuffer(data + bytes(20), np.uint8)
    assert signature(np.frombuffer(key, np.uint8), buffer, len(data)) == expected


def test_pymavlink_and_signer_understand_each_other() -> None:
    signer = Signer(KEY)
    theirs = dialect.MAVLink(None, srcSystem=255, srcComponent=1)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = KEY, True
    theirs.signing.timestamp = int((time.time() - EPOCH_S) * 1e5)
    for _ in range(3):
        assert signer.accepts(bytes(ARM.pack(theirs)))
        assert theirs.decode(bytearray(signer.sign(frame_of()))).get_signed()


def test_pymavlink_and_seal_understand_each_other() -> None:
    link_signer = new_link_signer(KEY, 0)
    theirs: Any = dialect.MAVLink(None, srcSystem=3, srcComponent=1)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = KEY, True
    theirs.signing.timestamp = int((time.time() - EPOCH_S) * 1e5)
    done, payload = dialect.MAVLink_ftc_step_done_message(7), np.zeros(1, codec.STEP_DONE)
    payload["step"] = 7
    for _ in range(3):
        assert opened(link_signer, bytes(done.pack(theirs))) == codec.MessageId.STEP_DONE
        assert opened(link_signer, bytes(ARM.pack(theirs))) == codec.FOREIGN
        datagram = codec.new_buffer()
        length = codec.pack(datagram, payload, codec.MessageId.STEP_DONE, 3, 1, 0)
        hot = bytes(datagram[: sign_frame(link_signer, datagram, length)])
        assert theirs.decode(bytearray(hot)).step == 7
        assert theirs.decode(bytearray(sign_bytes(link_signer, frame_of()))).command == 400


@pytest.mark.parametrize("message", [ARM, dialect.MAVLink_ftc_step_done_message(1)])
def test_unsigned_wrong_and_replayed_are_refused(message: dialect.MAVLink_message) -> None:
    good, bad = Signer(KEY).sign(frame_of(message)), Signer(OTHER).sign(frame_of(message))
    signer, link_signer = Signer(KEY), new_link_signer(KEY, 0)
    for frame, why in ((frame_of(message), UNSIGNED), (bad, WRONG), (good, None), (good, REPLAYED)):
        assert signer.accepts(frame) == (not why)
        code = opened(link_signer, frame)
        assert (code if code < codec.SIGNED else None) == why
    assert signer.refused == {UNSIGNED: 1, WRONG: 1, REPLAYED: 1}


@given(st.data())
def test_any_mutation_is_refused_and_changes_nothing(data: st.DataObject) -> None:
    message = data.draw(st.sampled_from([ARM, dialect.MAVLink_ftc_step_done_message(1)]))
    good = Signer(KEY).sign(frame_of(message))
    signer, link_signer = Signer(KEY), new_link_signer(KEY, 0)
    if data.draw(st.booleans()):
        bad = good[: data.draw(st.integers(0, len(good) - 1))]
    else:
        i, flip = data.draw(st.integers(0, len(good) - 1)), data.draw(st.integers(1, 255))
        bad = good[:i] + bytes([good[i] ^ flip]) + good[i + 1 :]
    assert not signer.accepts(bad)
    assert opened(link_signer, bad) < codec.SIGNED
    assert not link_signer.newest.any()
    assert signer.accepts(good)
    assert opened(link_signer, good) >= codec.FOREIGN


@given(st.binary(max_size=300))
def test_noise_is_refused(noise: bytes) -> None:
    assert not Signer(KEY).accepts(noise)
    assert opened(new_link_signer(KEY, 0), noise) < codec.SIGNED


def test_radio_status_may_be_unsigned() -> None:
    frame = frame_of(dialect.MAVLink_radio_status_message(0, 0, 0, 0, 0, 0, 0))
    assert Signer(KEY).accepts(frame)
    assert opened(new_link_signer(KEY, 0), frame) == codec.FOREIGN


@pytest.mark.parametrize(
    ("late_s", "accepted"), [(59.0, True), (61.0, False), (-59.0, True), (-61.0, False)]
)
def test_a_new_stream_may_be_one_minute_behind_or_ahead(late_s: float, accepted: bool) -> None:
    frame = Signer(KEY, unix_s=lambda: time.time() - late_s).sign(frame_of())
    assert Signer(KEY).accepts(frame) == accepted
    assert (opened(new_link_signer(KEY, 0), frame) == codec.FOREIGN) == accepted
    assert WINDOW == 60 * 100_000


def test_streams_are_apart() -> None:
    signer, sender = Signer(KEY), Signer(KEY)
    old = [sender.sign(frame_of(system=i)) for i in (1, 2)]
    new = Signer(KEY, link=1).sign(frame_of(system=1))
    assert all(signer.accepts(frame) for frame in (new, *reversed(old)))


def test_what_is_captured_on_one_link_is_refused_on_another() -> None:
    plant = sign_bytes(new_link_signer(KEY, PLANT_LINK), frame_of())
    assert not Signer(KEY).accepts(plant)
    assert opened(new_link_signer(KEY, 0), plant) == REPLAYED


def test_own_time_follows_what_is_heard() -> None:
    ahead, signer, link_signer = (
        Signer(KEY, unix_s=lambda: time.time() + 50.0),
        Signer(KEY),
        new_link_signer(KEY, 0),
    )
    frame = ahead.sign(frame_of())
    assert signer.accepts(frame)
    assert opened(link_signer, frame) == codec.FOREIGN
    for answer in (signer.sign(frame_of()), sign_bytes(link_signer, frame_of())):
        assert _stamp(answer) > _stamp(frame)


@given(st.integers(0, 2**48 - 1) | st.integers(-2 * WINDOW, 2 * WINDOW).map(lambda d: _now() + d))
def test_no_stamp_overflows_or_locks_out_others(stamp: int) -> None:
    signer, link_signer = Signer(KEY), new_link_signer(KEY, 0)
    signer.accepts(_stamped(stamp))
    opened(link_signer, _stamped(stamp))
    for answer in (signer.sign(frame_of()), sign_bytes(link_signer, frame_of())):
        assert _stamp(answer) <= _now() + WINDOW + 1
    honest = Signer(KEY).sign(frame_of(system=7))
    assert signer.accepts(honest)
    assert opened(link_signer, honest) == codec.FOREIGN


def test_a_stamp_of_the_far_future_is_out_of_range() -> None:
    signer, link_signer = Signer(KEY), new_link_signer(KEY, 0)
    for stamp in (2**47, 2**48 - 1):
        assert signer.problem(_stamped(stamp)) == OUT_OF_RANGE
        assert opened(link_signer, _stamped(stamp)) == OUT_OF_RANGE


def test_a_restart_never_goes_back_even_if_the_clock_does(tmp_path: Path) -> None:
    make_key(tmp_path / "key", KEY)
    shared = open_time(tmp_path / "key")
    late = Signer(KEY, shared, unix_s=lambda: time.time() + 1000.0).sign(frame_of())
    del shared
    assert Path(time_file(tmp_path / "key")).stat().st_size == 8
    again = Signer(KEY, open_time(tmp_path / "key")).sign(frame_of())
    compiled = sign_bytes(load_link_signer(KeyFile(tmp_path / "key"), 0), frame_of())
    assert _stamp(late) < _stamp(again) < _stamp(compiled)


def test_a_seal_without_a_key_lets_everything_pass() -> None:
    link_signer = new_link_signer(b"", 0)
    assert sign_bytes(link_signer, frame_of()) == frame_of()
    assert opened(link_signer, frame_of()) == codec.FOREIGN
    assert opened(link_signer, Signer(KEY).sign(frame_of())) == codec.SIGNED


def test_signed_frames_are_parsed() -> None:
    message = parse(Signer(KEY).sign(frame_of()))
    assert isinstance(message, dialect.MAVLink_command_long_message)
    assert message.command == 400


def test_key_file(tmp_path: Path) -> None:
    path = tmp_path / "key"
    make_key(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert len(read_key(path)) == 32
    with pytest.raises(SigningError, match="exists already"):
        make_key(path)
    path.chmod(0o644)
    with pytest.raises(SigningError, match=f"0644, expected 0600; run: chmod 600 {path}"):
        read_key(path)


@pytest.mark.parametrize("content", [b"", KEY[:-1], KEY + b"1", bytes(32)])
def test_no_key_in_the_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "key"
    path.touch(0o600)
    path.write_bytes(content)
    with pytest.raises(SigningError, match="expected 32 bytes") as info:
        read_key(path)
    assert repr(KEY[:8])[2:-1] not in str(info.value)
    with pytest.raises(SigningError, match="`gcs key FILE` makes one"):
        read_key(tmp_path / "missing")


def test_the_key_is_in_no_text() -> None:
    assert "x01" not in repr(Signer(KEY))
    assert str(list(KEY)[:3])[1:-1] not in repr(Signer(KEY))


def _stamp(frame: bytes) -> int:
    return int(struct.unpack("<Q", frame[-12:-6] + bytes(2))[0])


def _now() -> int:
    return timestamp(time.time())


def _stamped(stamp: int) -> bytes:
    """A frame that is signed with this timestamp."""
    body = flagged(frame_of()) + bytes(1) + stamp.to_bytes(6, "little")
    return bytes(body + hashlib.sha256(KEY + body).digest()[:6])
