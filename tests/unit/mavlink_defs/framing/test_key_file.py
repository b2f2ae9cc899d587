"""A key that is replaced while others use it, and captured frames after a restart."""

import os
import time
from pathlib import Path

import numpy as np
import pytest

from mavlink_defs import dialect
from mavlink_defs.framing import codec, key_file
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.framing.hot_signing import (
    LinkSigner,
    load_link_signer,
    refresh,
    sign_bytes,
    verify_frame,
)
from mavlink_defs.framing.key_file import (
    ANNOUNCED_S,
    GRACE_S,
    KeyFile,
    load_signer,
    replace_key,
)
from mavlink_defs.framing.signing import (
    Keys,
    Signer,
    SigningError,
    former_file,
    make_key,
    read_key,
)

OLD, NEW = bytes(range(1, 33)), bytes(range(2, 34))
LINK = 254
BEFORE_USE_S, IN_GRACE_S, LATER_S = ANNOUNCED_S - 1.0, GRACE_S - 1.0, GRACE_S + 1.0


@pytest.fixture
def path(tmp_path: Path) -> Path:
    make_key(tmp_path / "key", OLD)
    return tmp_path / "key"


def frame_of(system: int = 1) -> bytes:
    return FramePacker(system, 1).pack(dialect.MAVLink_ping_message(0, 0, 0, 0))


def opened(link_signer: LinkSigner, frame: bytes) -> int:
    datagram = codec.new_buffer()
    datagram[: len(frame)] = np.frombuffer(frame, np.uint8)
    return verify_frame(link_signer, datagram, len(frame))


def make_old(path: Path, age_s: float) -> None:
    then = time.time() - age_s
    os.utime(path, (then, then))


def test_a_new_key_is_announced_then_used_and_the_former_one_expires(path: Path) -> None:
    keys = KeyFile(path)
    begin = path.stat().st_mtime
    assert keys.at(begin) == Keys(OLD, b"")
    replace_key(path, NEW)
    since = path.stat().st_mtime
    for watcher in (keys, KeyFile(path)):  # one that flies, and one that is started meanwhile
        assert watcher.at(since + BEFORE_USE_S) == Keys(OLD, NEW)
        assert watcher.at(since + ANNOUNCED_S) == Keys(NEW, OLD)
        assert watcher.at(since + IN_GRACE_S) == Keys(NEW, OLD)
        assert watcher.at(since + GRACE_S) == Keys(NEW, b"")
    for file in (path, former_file(path)):
        assert file.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("age_s", "old_is_heard"),
    [(0.0, True), ((ANNOUNCED_S + GRACE_S) / 2.0, True), (LATER_S, False)],  # far from the edges
)
def test_signers_of_both_kinds_go_over_to_the_new_key(
    path: Path, age_s: float, old_is_heard: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(key_file, "_POLL_S", 0.0)
    signer, watched = load_signer(str(path)), KeyFile(path)
    hot = load_link_signer(watched, LINK)
    assert signer is not None
    replace_key(path, NEW)
    make_old(path, age_s)
    assert signer.accepts(Signer(NEW).sign(frame_of(1)))
    assert signer.accepts(Signer(OLD).sign(frame_of(2))) == old_is_heard
    refresh(watched, hot)
    for system, key, heard in ((3, NEW, True), (4, OLD, old_is_heard)):
        frame = Signer(key, link=LINK).sign(frame_of(system))
        assert (opened(hot, frame) >= codec.FOREIGN) == heard
    in_use = OLD if age_s < ANNOUNCED_S else NEW
    assert Signer(in_use).accepts(signer.sign(frame_of(5)))
    assert Signer(in_use, link=LINK).accepts(sign_bytes(hot, frame_of(6)))


def test_a_file_that_became_unreadable_changes_nothing_and_is_reported_once(path: Path) -> None:
    reported: list[str] = []
    keys = KeyFile(path, reported.append)
    now = time.time()
    path.write_bytes(b"half a key")
    for k in range(1, 5):
        assert keys.at(now + k).signing == OLD
    assert len(reported) == 1
    assert "expected 32 bytes, got 10" in reported[0]
    path.write_bytes(NEW)
    assert keys.at(now + 10.0).signing == NEW


def test_a_second_replacement_waits_until_the_first_is_over(path: Path) -> None:
    replace_key(path, NEW)
    with pytest.raises(SigningError, match="was replaced less than 30 s ago"):
        replace_key(path)
    assert (read_key(path), read_key(former_file(path))) == (NEW, OLD)
    make_old(path, LATER_S)
    replace_key(path, OLD)
    assert (read_key(path), read_key(former_file(path))) == (OLD, NEW)


def test_there_must_be_a_key_to_be_replaced(tmp_path: Path) -> None:
    with pytest.raises(SigningError, match="`gcs key FILE` makes one"):
        replace_key(tmp_path / "none")
    assert not list(tmp_path.iterdir())


def test_a_key_made_again_has_no_former_one(path: Path) -> None:
    replace_key(path, NEW)
    path.unlink()
    make_key(path, OLD)
    assert KeyFile(path).at(time.time()) == Keys(OLD, b"")


def test_what_was_captured_in_the_first_run_is_refused_in_the_second(path: Path) -> None:
    """Of every stream, known or not; and what is sent after the restart is accepted."""
    sender = {link: Signer(OLD, link=link) for link in (0, LINK)}
    first = load_signer(str(path))
    first_hot = load_link_signer(KeyFile(path), LINK)
    assert first is not None
    captured = {
        link: [sender[link].sign(frame_of(system)) for system in range(1, 20)] for link in sender
    }
    assert all(first.accepts(frame) for frame in captured[0])
    assert all(opened(first_hot, frame) >= codec.FOREIGN for frame in captured[LINK])
    del first, first_hot  # they die

    second, second_hot = load_signer(str(path)), load_link_signer(KeyFile(path), LINK)
    assert second is not None
    for frame in captured[0]:
        assert second.problem(frame) == DropReason.REPLAYED
    for frame in captured[LINK]:
        assert opened(second_hot, frame) == DropReason.REPLAYED
    assert second.accepts(sender[0].sign(frame_of(1)))
    fresh = sender[LINK].sign(frame_of(2))
    assert opened(second_hot, fresh) >= codec.FOREIGN


def test_what_comes_between_binding_a_port_and_loading_its_signer_is_accepted(path: Path) -> None:
    """Others of the fleet are faster, and send."""
    other = load_link_signer(KeyFile(path), LINK)
    before = sign_bytes(other, frame_of(1))
    keys = KeyFile(path)
    first = sign_bytes(other, frame_of(2))
    sign_bytes(other, frame_of(2))
    late = load_link_signer(keys, LINK)
    assert opened(late, first) >= codec.FOREIGN
    assert opened(late, before) == DropReason.REPLAYED


def test_the_time_between_two_looks_is_short(path: Path) -> None:
    assert key_file._POLL_S < ANNOUNCED_S / 10
