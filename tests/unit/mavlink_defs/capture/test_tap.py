"""The tap against an independent count of what was put in."""

import itertools
import json
from collections import Counter
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_defs import dialect
from mavlink_defs.capture.tap import DEFAULT_PORTS, LinkNames, Tap
from mavlink_defs.capture.tap_counts import new_counts
from mavlink_defs.capture.tap_report import OutcomeReport, TapReport
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.endpoint import UdpAddress
from mavlink_defs.framing.frames import FramePacker, frame_size

RUNNING = dialect.FTC_SIM_FLAGS_RUNNING
HEARTBEAT = dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)

floats = st.floats(width=32, allow_nan=False)
messages = st.one_of(
    st.just(HEARTBEAT),
    st.builds(dialect.MAVLink_ftc_step_done_message, st.integers(0, 2**32 - 1)),
    st.builds(
        dialect.MAVLink_attitude_message, st.integers(0, 2**32 - 1), *[floats for _ in range(6)]
    ),
    st.builds(
        dialect.MAVLink_ftc_events_message,
        *[st.integers(0, 2**32 - 1)] * 2,
        *[st.lists(st.integers(0, 2**32 - 1), min_size=4, max_size=4)] * 2,
        st.integers(0, 2**32 - 1),
        st.lists(st.integers(0, 2**32 - 1), min_size=4, max_size=4),
        st.integers(0, 2**32 - 1),
    ),
)
senders = st.tuples(st.integers(1, 255), st.integers(1, 255))
ways = st.tuples(st.sampled_from(["plant", "gcs"]), st.sampled_from(["to", "from"]))


def actuators(time_us: int, values: tuple[float, ...], system: int = 1) -> bytes:
    controls = [*values, *[0.0] * 12]
    message = dialect.MAVLink_hil_actuator_controls_message(time_us, controls, 0, 0)
    return FramePacker(system, 1).pack(message)


def state(step: int, system: int = 1, flags: int = RUNNING, run: int = 7) -> bytes:
    fields: Any = (*[[0.0] * 3] * 5, step, flags, run)
    message = dialect.MAVLink_ftc_sim_state_message(step * 1000, 0, *fields)
    return FramePacker(system, 25).pack(message)


def uav_of(tap: Tap, system: int = 1, link: str = "plant") -> dict:
    (uav,) = [
        u for u in tap.report().to_json()["uavs"] if (u["system"], u["link"]) == (system, link)
    ]
    return uav


@given(st.lists(st.tuples(ways, senders, messages), max_size=30))
def test_frames_and_bytes_are_counted_by_link_direction_sender_and_message(sent) -> None:
    tap = Tap()
    frames: Counter[Any] = Counter()
    sizes: Counter[Any] = Counter()
    for t, ((link, direction), (system, component), message) in enumerate(sent):
        datagram = FramePacker(system, component).pack(message)
        tap.count(float(t), link, direction, datagram)
        key = (link, direction, system, component, message.get_type())
        frames[key] += 1
        sizes[key] += len(datagram)
    rows = tap.report().to_json()["messages"]
    keys = [(r["link"], r["direction"], r["system"], r["component"], r["message"]) for r in rows]
    assert dict(zip(keys, [r["frames"] for r in rows], strict=True)) == frames
    assert dict(zip(keys, [r["bytes"] for r in rows], strict=True)) == sizes
    assert sum(link["bytes"] for link in tap.report().to_json()["links"]) == sizes.total()


@given(st.lists(st.tuples(*[st.sampled_from([0.0, 0.25, -0.5])] * 4), min_size=1, max_size=40))
def test_a_channel_transmits_when_its_value_changes(commands) -> None:
    tap = Tap()
    for k, values in enumerate(commands):
        tap.count(k * 1e-3, "plant", "from", state(k))
        tap.count(k * 1e-3, "plant", "to", actuators(1000 * k, values))
    before = [(None,) * 4, *commands]
    pairs = list(zip(before, commands, strict=False))
    uav, sent = uav_of(tap), 0
    for c, name in enumerate(ACTUATORS):
        at = [k for k, (old, new) in enumerate(pairs) if old[c] != new[c]]
        gaps = [(b - a) / 1e3 for a, b in itertools.pairwise(at)]
        assert uav["channels"][name]["events"] == tap.events(1, name) == len(at)
        shortest_s = uav["channels"][name]["min_interval_s"]
        assert shortest_s == (pytest.approx(min(gaps)) if gaps else None)
        sent += len(at)
    assert uav["messages"] == len(commands)
    assert uav["repeats"] == sum(old == new for old, new in pairs)
    assert uav["periods"] == len(commands)
    assert uav["saving"] == tap.report().to_json()["saving"] == 1 - sent / (4 * len(commands))


def test_systems_links_and_flights_do_not_disturb_each_other() -> None:
    tap = Tap()
    for step, run in ((0, 7), (1, 7), (2, 7), (2, 7), (0, 8), (1, 8)):  # one state comes twice
        for link, system in (("plant", 1), ("plant", 2), ("other", 1)):
            tap.count(0.0, link, "from", state(step, system, run=run))
    for link, system in (("plant", 1), ("plant", 2), ("other", 1)):
        tap.count(0.0, link, "to", actuators(0, (1.0, 1.0, 1.0, 1.0), system))
    for system, link in ((1, "plant"), (2, "plant"), (1, "other")):
        assert uav_of(tap, system, link)["periods"] == 5
        assert tap.events(system, "rudder", link) == 1
    assert tap.events(9, "rudder") == 0


def test_a_late_copy_of_the_first_state_begins_no_flight() -> None:
    tap = Tap()
    for step in (0, 1, 0, 2):
        tap.count(0.0, "plant", "from", state(step))
        tap.count(0.0, "plant", "to", actuators(1000 * step, (1.0, 1.0, 1.0, 1.0)))
    assert uav_of(tap)["periods"] == 3
    assert tap.events(1, "rudder") == 1


def test_frozen_and_ended_states_are_no_control_periods() -> None:
    tap = Tap()
    assert tap.simulated_s is None
    for step, flags in ((0, 0), (0, RUNNING), (1, RUNNING), (2, dialect.FTC_SIM_FLAGS_ENDED)):
        tap.count(0.0, "plant", "from", state(step, flags=flags))
    tap.count(0.0, "plant", "to", actuators(0, (0.0,) * 4))
    assert uav_of(tap)["periods"] == 2
    assert tap.simulated_s == pytest.approx(1e-3)


def test_without_states_the_control_period_is_taken_from_the_user() -> None:
    for period_us, periods in ((None, None), (1000, 11), (5000, 3)):
        tap = Tap(period_us=period_us)
        for time_us in (0, 10_000):
            tap.count(0.0, "plant", "to", actuators(time_us, (0.0,) * 4))
        assert uav_of(tap)["periods"] == periods


def test_what_autopilots_report_stands_in_for_what_is_not_seen() -> None:
    report = dialect.MAVLink_ftc_events_message(
        9, 100, [1, 2, 3, 4], [2**32 - 1, 500, 600, 700], 7, [0, 1, 0, 0], 0
    )
    tap = Tap()
    tap.count(0.0, "gcs", "to", FramePacker(1, 1).pack(report))
    uav = uav_of(tap, link="gcs")
    assert uav["reported"]
    assert uav["saving"] == pytest.approx(1 - 10 / 400)
    assert [c["min_interval_s"] for c in uav["channels"].values()] == [None, 5e-4, 6e-4, 7e-4]
    tap.count(0.0, "plant", "to", actuators(0, (0.0,) * 4))
    assert [(u["link"], u["reported"]) for u in tap.report().to_json()["uavs"]] == [
        ("plant", False)
    ]


def test_rates_are_over_a_sliding_window() -> None:
    tap = Tap(window_s=2.0)
    frame = FramePacker(1, 1).pack(HEARTBEAT)
    for k in range(100):
        tap.count(k * 0.1, "gcs", "to", frame)
    (row,) = tap.report(9.9).to_json()["messages"]
    assert row["rate_hz"] == pytest.approx(10.0)
    assert row["mean_hz"] == pytest.approx(10.0, rel=0.02)
    (link,) = tap.report(10.9).to_json()["links"]
    assert link["rate_hz"] == pytest.approx(5.0, abs=0.5)
    assert link["bytes_per_s"] == pytest.approx(link["rate_hz"] * len(frame))
    assert tap.report(20.0).to_json()["links"][0]["rate_hz"] == 0.0


def damaged(frame: bytes) -> dict[str, bytes]:
    unknown = bytes([0xFD, 1, 0, 0, 0, 1, 1, 0xFF, 0xFF, 0xFF, 5, 0, 0])
    version_1 = HEARTBEAT.pack(dialect.MAVLink(None, 1, 1), force_mavlink1=True)
    return {
        "empty": b"",
        "truncated": frame[:-1],
        "wrong checksum": frame[:-1] + bytes([frame[-1] ^ 1]),
        "not MAVLink 2": b"hello",
        "MAVLink 1": bytes(version_1),
        "unknown message": unknown,
        "unknown incompatibility flags": frame[:2] + b"\x02" + frame[3:],
    }


def test_what_is_no_frame_is_counted_by_reason() -> None:
    wrong = damaged(FramePacker(1, 1).pack(HEARTBEAT))
    tap = Tap()
    for reason, datagram in wrong.items():
        tap.count(0.0, "gcs", "to", datagram)
        size, why = frame_size(datagram)
        assert size == 0
        assert why is not None
        expected = {"empty": "truncated", "MAVLink 1": "not MAVLink 2"}.get(reason, reason)
        assert why.text == expected
    report = tap.report().to_json()
    (link,) = report["links"]
    assert link["dropped"] == dict.fromkeys(wrong, 1)
    assert link["datagrams"] == len(wrong)
    assert not report["messages"]


def test_a_datagram_may_hold_several_frames() -> None:
    frame = FramePacker(1, 1).pack(HEARTBEAT)
    tap = Tap()
    tap.count(0.0, "gcs", "to", frame * 3 + b"rest")
    report = tap.report().to_json()
    assert [(row["message"], row["frames"]) for row in report["messages"]] == [("HEARTBEAT", 3)]
    assert report["links"][0]["dropped"] == {"not MAVLink 2": 1}


def test_signed_frames_are_counted() -> None:
    signing = dialect.MAVLink(None, 1, 1)
    signing.signing.secret_key = bytes(32)
    signing.signing.sign_outgoing = True
    tap = Tap()
    tap.count(0.0, "gcs", "to", bytes(HEARTBEAT.pack(signing)))
    tap.count(0.0, "gcs", "to", FramePacker(1, 1).pack(HEARTBEAT))
    (row,) = tap.report().to_json()["messages"]
    assert (row["frames"], row["signed"]) == (2, 1)


@given(st.binary(max_size=300), st.binary(max_size=40))
def test_no_datagram_is_too_odd(noise: bytes, tail: bytes) -> None:
    tap = Tap()
    for datagram in (noise, b"\xfd" + noise, state(3) + tail, actuators(0, (0.0,) * 4) + tail):
        tap.count(0.0, "plant", "to", datagram)
    assert sum(link["datagrams"] for link in tap.report().to_json()["links"]) == 4


@given(messages | st.just(HEARTBEAT), senders)
def test_frame_size_agrees_with_pymavlink(message, sender) -> None:
    frame = FramePacker(*sender).pack(message)
    assert frame_size(frame + b"more") == (len(frame), None)


def test_memory_does_not_grow_with_the_number_of_frames() -> None:
    tap = Tap(window_s=0.1)
    frame = FramePacker(1, 1).pack(HEARTBEAT)
    tap.count(0.0, "gcs", "to", frame)
    room = [table.nbytes for table in tap.counts]
    for k in range(1, 5000):
        tap.count(k * 1e-2, "gcs", "to", frame)
    assert [table.nbytes for table in tap.counts] == room


@given(
    st.lists(st.tuples(st.floats(0.0, 3.0), ways, senders, messages), max_size=60),
    st.lists(st.floats(0.0, 4.0), min_size=1, max_size=4),
)
def test_rates_count_the_datagrams_within_the_window(sent, asked) -> None:
    sent.sort(key=lambda entry: entry[0])
    tap, sizes = Tap(window_s=0.5), []
    for time_s, (link, direction), sender, message in sent:
        datagram = FramePacker(*sender).pack(message)
        tap.count(time_s, link, direction, datagram)
        sizes.append((time_s, link, direction, sender, message.get_msgId(), len(datagram)))
    last_s = sent[-1][0] if sent else 0.0
    for now_s in sorted(max(time_s, last_s) for time_s in asked):
        report = tap.report(now_s)
        recent = [entry for entry in sizes if entry[0] > now_s - 0.5]
        for row in report.links:
            mine = [n for _, *way, _, _, n in recent if way == [row.link, row.direction]]
            assert (row.rate_hz, row.bytes_per_s) == (len(mine) / 0.5, sum(mine) / 0.5)
        for stream in report.messages:
            key = [stream.link, stream.direction, (stream.system, stream.component)]
            mine = [n for _, *of, n in recent if of == [*key, stream.message_id]]
            assert stream.rate_hz == len(mine) / 0.5


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["plant", "gcs", "a", "b"]),
            st.lists(st.tuples(senders, messages) | st.binary(max_size=20), max_size=8),
        ),
        max_size=20,
    ),
    st.sets(st.integers(0, 19)),
)
def test_reports_in_between_and_tables_that_grow_change_no_count(sent, pauses) -> None:
    at_once, in_pieces = Tap(), Tap()
    in_pieces.counts = new_counts(1.0, room=1)
    for k, (link, parts) in enumerate(sent):
        datagram = b"".join(
            part if isinstance(part, bytes) else FramePacker(*part[0]).pack(part[1])
            for part in parts
        )
        for tap in (at_once, in_pieces):
            tap.count(k * 0.1, link, "to", datagram)
        if k in pauses:
            in_pieces.report()
    assert in_pieces.report() == at_once.report()


def test_rates_of_bursts_that_become_longer() -> None:
    tap, frame = Tap(), FramePacker(1, 1).pack(HEARTBEAT)
    tap.counts = new_counts(1.0, room=4)
    for n in range(200):
        for _ in range(n):
            tap.count(0.4 * n, "gcs", "to", frame)
        if n > 2:
            assert tap.report().messages[0].rate_hz == n + (n - 1) + (n - 2)


def test_a_datagram_of_very_many_senders_is_counted() -> None:
    packers = [FramePacker(system, 1) for system in range(1, 256)]
    datagram = b"".join(packer.pack(HEARTBEAT) for packer in packers)
    tap = Tap()
    for _ in range(2):
        tap.count(0.0, "gcs", "to", datagram * 3)
    assert [row.frames for row in tap.report().messages] == [6] * 255
    assert tap.report().links[0].rate_hz == 2.0


def test_links_are_named_by_the_port_of_their_fixed_end() -> None:
    names = LinkNames({**DEFAULT_PORTS, 9000: "mine"})
    peer = UdpAddress("127.0.0.1", 40123)
    for port, link in ((14550, "gcs"), (14560, "plant"), (14602, "formation"), (9000, "mine")):
        end = UdpAddress("127.0.0.1", port)
        assert names.of(peer, end) == (link, "to")
        assert names.of(end, peer) == (link, "from")
    other = UdpAddress("127.0.0.1", 50000)
    link, direction = names.of(peer, other)
    assert link == "127.0.0.1:40123 / 127.0.0.1:50000"
    assert {direction, names.of(other, peer)[1]} == {"to", "from"}
    assert names.of(other, peer)[0] == link


def test_a_report_comes_back_from_its_json() -> None:
    tap = Tap()
    tap.count(0.0, "gcs", "from", b"nothing of ours")
    for k in range(5):
        tap.count(k / 10, "plant", "to", actuators(1000 * k, (float(k), 0.0, k / 2, 1.0)))
    counted = tap.report()
    fates = (OutcomeReport("plant", "to", {"undeliverable": 1, "lost": 3}),)
    for report in (counted, replace(counted, fates=fates)):
        tree = json.loads(json.dumps(report.to_json()))
        assert TapReport.from_json(tree) == report
        assert json.dumps(TapReport.from_json(tree).to_json()) == json.dumps(tree)


@pytest.mark.parametrize(
    "change", [{"links": 3}, {"span_s": "long"}, {"uavs": [{}]}, {"fates": [1]}, {"saving": []}]
)
def test_what_is_no_report_is_refused(change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="TapReport"):
        TapReport.from_json(Tap().report().to_json() | change)
