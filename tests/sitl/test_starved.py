"""Real time: an autopilot without processor time says so, and is late by no more than it lacked."""

import asyncio
import contextlib
import itertools
import os
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest
from flying import process_of, scenario_tree
from station import up

from gcs.station.client import Client
from mavlink_defs import dialect
from mavlink_defs.constants import OLD_STATE_S
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.endpoint import parse_connection
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.services.machine import SystemId

pytestmark = pytest.mark.sitl
STARVED, OTHER = 1, 2
WITHOUT_S, WITH_S, AT_MOST_S = 0.15, 0.05, 2.0  # of its turns [s]
OLD, NEW = "acted on a state", "acts on new states again"
INTERVAL_S = 0.02  # of FTC_EVENTS
RESOLUTION_S = 5 * INTERVAL_S  # of times compared
MEMORY_S = 1.0  # for which gaps excuse being late: what comes after one comes in one burst
MESSAGES = 50
MAX_WAIT_S = 40.0  # of a wait
LEVEL = [{"start_s": 0.0, "airspeed_m_s": 40.0, "roll_deg": 0.0, "pitch_deg": 1.0, "yaw_deg": 0.0}]
HIGH_M = 5000.0  # where it starts: without processor time it may fall for all of the wait
CALM = {"faults": [], "profile": LEVEL, "disturbance": {}}


class Heard(NamedTuple):
    """An FTC_EVENTS of the starved autopilot; times are simulated [s]."""

    own_s: float  # its time
    other_s: float  # newest of the other autopilot's at its arrival
    oldest_s: float  # age that it tells


class Listener:
    """Notes what the starved autopilot says, beside the time of another one.

    All times are of the wire, in the order of one socket: how busy this process is has no part.
    """

    def __init__(self) -> None:
        self.heard: list[Heard] = []
        self.texts = ""
        self.other_s = 0.0

    def has_acted_on(self, time_s: float) -> bool:
        """Whether it has acted on the state of a time [s]."""
        return self.heard[-1].own_s >= time_s

    def receive(self, message: MAVLink_message) -> None:
        system = message.get_srcSystem()
        if isinstance(message, dialect.MAVLink_statustext_message) and system == STARVED:
            self.texts += message.text
        if not isinstance(message, dialect.MAVLink_ftc_events_message):
            return
        time_s = message.time_boot_ms / 1e3
        if system == OTHER:
            self.other_s = time_s
        elif system == STARVED:
            oldest_s = message.oldest_state_us / 1e6
            self.heard.append(Heard(time_s, self.other_s, oldest_s))


async def starving(
    client: Client, pid: int, listener: Listener, is_seen: Callable[[], bool]
) -> bool:
    """Give a process little time in turns, until something is seen; return whether it was.

    As a core does that it shares with others, but in shares that are the same on any machine: each
    lasts until it has acted on what it had missed. On a busy machine it would do so too seldom, and
    its aircraft, without control, be lost.
    """
    deadline = time.monotonic() + MAX_WAIT_S
    try:
        while not is_seen() and time.monotonic() < deadline:
            os.kill(pid, signal.SIGSTOP)
            await asyncio.sleep(WITHOUT_S)
            os.kill(pid, signal.SIGCONT)
            await client.until(partial(listener.has_acted_on, listener.other_s), AT_MOST_S)
            await client.until(is_seen, WITH_S)
    finally:
        with contextlib.suppress(ProcessLookupError):  # its end is reported elsewhere
            os.kill(pid, signal.SIGCONT)
    return is_seen()


async def starve(hub: str, pid: int, listener: Listener) -> int:
    """Let an autopilot fly, starve until it has said so, and get time until it has said that.

    Returns:
        How many messages of its neighbours it has dropped as out of range.
    """
    own, connection = SystemId(255, 78), parse_connection(hub)
    async with Client(connection, on_message=listener.receive, own=own) as client:
        await client.wait_for((STARVED, OTHER), MAX_WAIT_S)
        for system in (STARVED, OTHER):
            vehicle = client.vehicle(system)
            await vehicle.set_interval(dialect.MAVLINK_MSG_ID_FTC_EVENTS, INTERVAL_S)
        assert await client.until(lambda: len(listener.heard) > MESSAGES, MAX_WAIT_S)
        begun = len(listener.heard)

        def is_seen() -> bool:
            return OLD in listener.texts and len(listener.heard) > begun + MESSAGES

        assert await starving(client, pid, listener, is_seen), listener.texts
        assert await client.until(lambda: NEW in listener.texts, MAX_WAIT_S), listener.texts
        vehicle = client.vehicle(STARVED)
        await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_DROPS)
        assert vehicle.state.drops is not None
        return vehicle.state.drops["formation"].get(DropReason.OUT_OF_RANGE.text, 0)


def test_a_starved_autopilot_is_late_by_no_more_than_it_lacked_and_says_so(tmp_path: Path) -> None:
    listener = Listener()
    tree = scenario_tree(**CALM)
    for uav in tree["uavs"]:
        uav["initial"]["altitude_m"] = HIGH_M
    with up(tmp_path / "up", "--start", "--speed", "1", tree=tree) as fleet:
        pid = process_of(fleet.folder, f"uav{STARVED}")
        assert asyncio.run(starve(fleet.hub, pid, listener)) == 0
    heard = listener.heard
    lacked = [
        (late.other_s, late.other_s - early.other_s) for early, late in itertools.pairwise(heard)
    ]
    allowed_s = []
    for k, message in enumerate(heard[1:], 1):
        lately_s = sum(  # a second gap may come before what the first one held back is worked off
            gap_s
            for at_s, gap_s in lacked[:k]
            if at_s > message.other_s - MEMORY_S and gap_s > RESOLUTION_S
        )
        allowed_s.append(lately_s + RESOLUTION_S)
        assert message.other_s - message.own_s <= allowed_s[-1]
    assert OLD_STATE_S < max(message.oldest_s for message in heard) <= max(allowed_s)
