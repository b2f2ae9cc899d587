"""A log is sought and replayed by simulated time, else by its own clock."""

import itertools
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs.commands.log import log
from gcs.console.errors import BadInput
from gcs.tui.playback import Playback
from gcs.tui.view import FleetView
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import TlogWriter, read_frames
from mavlink_defs.framing.frames import FramePacker, of_mavlink1

OTHERS = Path(__file__).parents[3] / "data" / "others"
EPOCH_US = 1_700_000_000_000_000
HEARTBEAT = dialect.MAVLink_heartbeat_message(1, 3, 129, 12, dialect.MAV_STATE_ACTIVE, 3)

Records = list[tuple[int, bytes]]


def tracking(time_ms: int) -> dialect.MAVLink_message:
    """Return a message with simulated time."""
    return dialect.MAVLink_ftc_tracking_message(time_ms, *[[0.0] * 4] * 3)


def recorded(*said: tuple[float, int, int | None]) -> Records:
    """Return a log: when it was heard [s], the vehicle, and its simulated time [ms] or none."""
    packers = {system: FramePacker(system, 1) for _, system, _ in said}
    return [
        (
            EPOCH_US + round(heard_s * 1e6),
            packers[system].pack(HEARTBEAT if time_ms is None else tracking(time_ms)),
        )
        for heard_s, system, time_ms in said
    ]


def paused(records: Records) -> Playback:
    player = Playback("some.tlog", records, lambda: 0.0)
    player.playing = False
    return player


def go(player: Playback, position_s: float) -> None:
    player.seek(position_s)
    while not player.advance():
        pass


@st.composite
def flights(draw: st.DrawFn) -> tuple[Records, list[int], list[int]]:
    """A flight of two vehicles whose wall pace changes at will, with other messages between."""
    count = draw(st.integers(2, 30))
    steps_ms = draw(st.lists(st.integers(0, 2000), min_size=count, max_size=count))
    pace_s = draw(
        st.lists(st.sampled_from([0.0, 1e-6, 0.003, 0.2, 30.0]), min_size=count, max_size=count)
    )
    others = draw(st.lists(st.integers(0, 3), min_size=count, max_size=count))
    start_ms = draw(st.integers(0, 100_000))
    said: list[tuple[float, int, int | None]] = [(0.0, 1, None), (0.0, 2, None)]
    times_ms, systems, heard_s, time_ms = [], [], 0.0, start_ms
    for step_ms, wait_s, extra in zip(steps_ms, pace_s, others, strict=True):
        for k in range(extra):
            said.append((heard_s + wait_s * k / max(extra, 1), 1, None))
        heard_s, time_ms = heard_s + wait_s, time_ms + step_ms
        system = draw(st.sampled_from([1, 2]))
        said.append((heard_s, system, time_ms))
        times_ms.append(time_ms)
        systems.append(system)
    said += [(heard_s + wait_s, 2, None) for wait_s in draw(st.lists(st.just(5.0), max_size=2))]
    return recorded(*said), times_ms, systems


@given(flights(), st.data())
def test_a_time_that_is_sought_shows_the_fleet_at_that_simulated_time(
    flight: tuple[Records, list[int], list[int]], data: st.DataObject
) -> None:
    records, times_ms, systems = flight
    player = paused(records)
    assert player.clock.is_simulated
    assert (player.begin_s, player.end_s) == (times_ms[0] / 1e3, times_ms[-1] / 1e3)
    positions = player.clock.positions_s
    assert all(a <= b for a, b in itertools.pairwise(positions))
    for _ in range(3):  # forward and back
        sought_ms = data.draw(st.integers(times_ms[0], times_ms[-1]))
        go(player, sought_ms / 1e3)
        assert player.position_s == sought_ms / 1e3
        for system in set(systems):
            said_ms = [t for t, s in zip(times_ms, systems, strict=True) if s == system]
            heard = [t / 1e3 for t in said_ms if t <= sought_ms]
            shown_s = player.fleet.vehicles[system].time_s
            assert shown_s == (heard[-1] if heard else None)
        assert records[0][0] / 1e6 <= player.now() <= records[-1][0] / 1e6


@settings(max_examples=20)
@given(flights())
def test_ages_follow_the_log(flight: tuple[Records, list[int], list[int]]) -> None:
    records, *_ = flight
    player = paused(records)
    heard, position_s = player.now(), player.begin_s
    while position_s < player.end_s:
        position_s += 0.7
        go(player, position_s)
        assert player.now() >= heard
        heard = player.now()
    go(player, player.end_s)
    assert player.now() == records[-1][0] / 1e6


def test_simulated_time_passes_at_the_speed_of_the_replay() -> None:
    now = 0.0
    # a hundred times real time
    fast = recorded((0.0, 1, None), *((k * 0.01, 1, 1000 * k) for k in range(25)))
    player = Playback("some.tlog", fast, lambda: now)
    view = FleetView(player)
    assert player.advance()  # from now on time passes
    for _ in range(50):
        now += 0.1
        player.advance()
    view.update()
    assert player.fleet.vehicles[1].time_s == pytest.approx(5.0, abs=1.0)
    assert (player.position_s, view.paced_by_s) == pytest.approx((5.0, 5.0))
    assert player.now() - EPOCH_US / 1e6 == pytest.approx(0.05, abs=1e-3)


def test_a_log_without_simulated_time_has_its_own_clock() -> None:
    player = paused(recorded((0.0, 1, None), (2.0, 1, None), (7.0, 1, None)))
    assert not player.clock.is_simulated
    assert (player.begin_s, player.end_s) == (0.0, 7.0)
    go(player, 3.0)
    assert player.now() == EPOCH_US / 1e6 + 3.0


@pytest.mark.parametrize("system", [1, 2])
def test_a_fleet_that_was_started_again_has_the_clock_of_the_log(system: int) -> None:
    flown = [(k * 0.5, 1 + k % 2, 500 * k) for k in range(20)]
    again = [(10.0 + k * 0.5, system, 500 * k) for k in range(6)]
    player = paused(recorded((0.0, 1, None), (0.0, 2, None), *flown, *again))
    assert not player.clock.is_simulated
    assert player.end_s == 12.5
    go(player, 12.5)
    assert player.fleet.vehicles[system].time_s == 2.5  # what came last is reached


def test_messages_that_are_late_or_broken_do_not_move_the_clock() -> None:
    records = recorded((0.0, 1, 0), (0.1, 1, 3000), (0.2, 1, 1000), (0.3, 1, 4000), (0.4, 2, 9000))
    time_us, frame = records.pop()
    player = paused([*records, (time_us, frame[:-1] + bytes([frame[-1] ^ 1]))])
    assert player.clock.positions_s == [0.0, 3.0, 3.0, 4.0, 4.0]


@pytest.mark.parametrize(
    ("said", "at_s", "problem"),
    [
        ([(0.0, 1, 5000), (1.0, 1, 24000)], 40.0, "simulated time from 5.0 to 24.0 s"),
        ([(0.0, 1, 5000), (1.0, 1, 24000)], 4.0, "simulated time from 5.0 to 24.0 s"),
        ([(0.0, 1, None), (7.0, 1, None)], 19.0, "time since its first frame from 0.0 to 7.0 s"),
    ],
)
def test_a_time_that_is_not_in_the_log_is_refused(
    said: Any, at_s: float, problem: str, tmp_path: Path
) -> None:
    path = tmp_path / "some.tlog"
    with TlogWriter(path) as file:
        for time_us, frame in recorded(*said):
            file.write(frame, time_us)
    with pytest.raises(BadInput, match=re.escape(f"--at {at_s:g}: some.tlog has {problem}")):
        log(path, at=at_s)


def test_a_log_in_mavlink_1_is_shown_as_the_same_in_mavlink_2() -> None:
    older = list(read_frames(OTHERS / "mavlink1.tlog"))
    newer = [(at_us, of_mavlink1(frame) or b"") for at_us, frame in older]
    states = []
    for frames in (older, newer):
        player = Playback("mavlink1.tlog", frames, lambda: 0.0)
        player.seek(player.end_s)
        while not player.advance():
            pass
        [vehicle] = player.fleet.vehicles.values()
        states.append({kind: message.to_dict() for kind, message in vehicle.latest.items()})
    assert repr(states[0]) == repr(states[1])
    assert {0, 30} <= states[0].keys()  # HEARTBEAT, ATTITUDE
