"""Registration: which autopilot flies each aircraft, and what follows when it falls silent.

No socket and no clock: the sender of the datagram in the link's buffer and the time go in.
"""

import math
from collections.abc import Callable
from enum import Enum

import numpy as np

from mavlink_defs.dialect import FTC_SIM_FLAGS_RUNNING
from sitl_plant.loop.link import PlantLink
from sitl_plant.loop.period import time_s

TAKEOVER_S = 1.0
"""Silence of an autopilot after which another one may replace it in flight [s]."""
FROZEN_TAKEOVER_S = 2.5
"""The same before and after the flight, when only HEARTBEATs are sent, one a second [s]."""

_ASLEEP_S = 0.5  # between two turns of the plant


class Claim(Enum):
    """Result of a datagram that claims an aircraft."""

    REFUSED = "another autopilot is registered"
    KNOWN = "its sender is registered already"
    NEW = "its sender is registered now"


class Registration:
    """The registered autopilots of a plant; they are in the arrays of its link."""

    def __init__(
        self,
        link: PlantLink,
        silence_timeout_s: float,
        wait_for_restart: bool,
        notify: Callable[[str], None],
    ) -> None:
        """Begin with the registrations that the link holds.

        Args:
            link: The plant's link; registrations are written to it.
            silence_timeout_s: Silence after which an autopilot counts as gone [s, wall time].
            wait_for_restart: Wait for a silent autopilot instead of ending the flight.
            notify: Called with a line for the log.
        """
        self._link = link
        self._silence_timeout_s = silence_timeout_s
        self._wait_for_restart = wait_for_restart
        self._notify = notify
        self._turn_s = math.inf

    def note_turn(self, now: float) -> None:
        """Note that the plant runs: what it has slept through is not the autopilots' silence.

        Their datagrams wait in its socket.

        Args:
            now: Wall-clock time [s].
        """
        slept_s, self._turn_s = now - self._turn_s, now
        if slept_s > _ASLEEP_S:
            heard_s = self._link.peers["heard_s"]
            heard_s[:] = np.minimum(heard_s + slept_s, now)

    def claim(self, i: int, now: float) -> Claim:
        """Register the sender of the received datagram as the autopilot of an aircraft.

        A second claimant is refused until the registered autopilot has been silent for
        `TAKEOVER_S`, or `FROZEN_TAKEOVER_S`.

        Args:
            i: Index of the aircraft.
            now: Wall-clock time [s].
        """
        peer, sender = self._link.peers[i], self._link.state["sender"][0]
        same = np.array_equal(peer["address"], sender)
        takeover_s = TAKEOVER_S if self._running else FROZEN_TAKEOVER_S
        if not same and peer["known"] and now - peer["heard_s"] < takeover_s:
            return Claim.REFUSED
        known = bool(same and peer["known"])
        peer["address"], peer["known"], peer["heard_s"] = sender, 1, now
        if not known and self._running:
            self._notify(f"the autopilot of UAV {peer['system']} is back at {self._time_s:.3f} s")
        return Claim.KNOWN if known else Claim.NEW

    def check_silence(self, now: float) -> str | None:
        """Apply the policy to autopilots that have fallen silent.

        Before and after the flight they lose their registration. In flight they end it, or the
        aircraft holds its last command until an autopilot claims it.

        Args:
            now: Wall-clock time [s].

        Returns:
            Why the flight must end; None if it continues.
        """
        peers = self._link.peers
        silent = np.flatnonzero(peers["known"] & (now - peers["heard_s"] > self._silence_timeout_s))
        if not self._running:
            peers["known"][silent] = 0
            return None
        for i in silent:
            text = (
                f"the autopilot of UAV {peers[i]['system']} has been silent for "
                f"{self._silence_timeout_s:g} s at {self._time_s:.3f} s of simulated time"
            )
            if not self._wait_for_restart:
                return text
            peers["known"][i] = 0
            self._notify(f"{text}; holding its last command and waiting for it to come back")
        return None

    @property
    def _running(self) -> bool:
        return bool(self._link.state[0]["flags"] & FTC_SIM_FLAGS_RUNNING)

    @property
    def _time_s(self) -> float:
        state = self._link.state[0]
        return time_s(int(state["step"]), int(state["step_us"]))
