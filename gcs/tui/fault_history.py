"""All faults that were seen: when they were acknowledged, to which station, and when they ended."""

from collections import defaultdict, deque
from dataclasses import dataclass
from typing import TypeAlias

from gcs.station.notifications import Notification
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect
from mavlink_defs.faults import SETTING
from mavlink_defs.faults.fault import Fault
from mavlink_defs.services.machine import SystemId

_SETTING = {*SETTING, dialect.MAV_CMD_INJECT_FAILURE}
_CLEARING = {dialect.MAV_CMD_FTC_CLEAR_FAULTS, dialect.MAV_CMD_INJECT_FAILURE}


@dataclass(frozen=True)
class Acknowledgement:
    """A vehicle accepted a command.

    Attributes:
        at: When [s since 1970].
        asked_by: The station that had sent the command: "this station", or its ids.
    """

    at: float
    asked_by: str


@dataclass
class FaultRecord:
    """One fault of one vehicle.

    Attributes:
        system: System id of the vehicle.
        fault: The fault.
        acknowledged: How it was set, if that was heard.
        gone_at: When the vehicle no longer had it [s since 1970]; None while it has.
        gone: Why: "cleared", "replaced" or "restarted".
        cleared: How it was cleared, if that was heard.
    """

    system: int
    fault: Fault
    acknowledged: Acknowledgement | None = None
    gone_at: float | None = None
    gone: str = ""
    cleared: Acknowledgement | None = None

    def phase(self, time_s: float | None) -> str:
        """Return "waiting", "active", "over", or why it has gone."""
        if self.gone_at is not None:
            return self.gone
        now = time_s or 0.0
        if now <= self.fault.start_s:
            return "waiting"
        return "active" if now <= self.fault.end_s else "over"


_Known: TypeAlias = tuple[int, tuple[Fault, ...] | None]


class FaultHistory:
    """Keeps records of faults, the latest last."""

    def __init__(self, own: tuple[int, int]) -> None:
        """Make an empty history.

        Args:
            own: System and component id of this station.
        """
        self.records: list[FaultRecord] = []
        self._own = SystemId(*own)
        self._set: defaultdict[int, deque[Acknowledgement]] = defaultdict(deque)
        self._cleared: dict[int, Acknowledgement] = {}
        self._known: dict[int, _Known] = {}

    def receive(self, notifications: Notification, at: float) -> None:
        """Note acknowledgements; they come before the change shows in the vehicle's list."""
        ack = notifications.about
        if not isinstance(ack, dialect.MAVLink_command_ack_message):
            return
        if ack.result != dialect.MAV_RESULT_ACCEPTED:
            return
        asker = SystemId(ack.target_system, ack.target_component)
        by = "this station" if asker == self._own else f"station {asker.system}/{asker.component}"
        if ack.command in _SETTING:
            self._set[notifications.system].append(Acknowledgement(at, by))
        if ack.command in _CLEARING:
            self._cleared[notifications.system] = Acknowledgement(at, by)

    def update(self, state: VehicleState, at: float) -> None:
        """Compare the faults that a vehicle has with those it had."""
        restarts, before = self._known.get(state.system, (state.restarts, None))
        if (restarts, before) == (state.restarts, state.faults):
            return
        self._known[state.system] = (state.restarts, state.faults)
        there = [r for r in self.records if r.system == state.system and r.gone_at is None]
        if restarts != state.restarts:
            self._go(there, "restarted", at)
            there = []
        if state.faults is None:
            return
        acks = self._set[state.system]
        if not acks:
            self._correct_starts(there, state.faults)
        new = [fault for fault in state.faults if fault not in (r.fault for r in there)]
        lost = [record for record in there if record.fault not in state.faults]
        replaced = {fault.whose for fault in new}
        self._go([r for r in lost if r.fault.whose in replaced], "replaced", at)
        self._go([r for r in lost if r.fault.whose not in replaced], "cleared", at)
        while len(acks) > len(new):
            acks.popleft()  # of faults that were replaced before they were seen
        ack: Acknowledgement | None = None
        for before_it, fault in zip((None, *new), new, strict=False):
            if not _by_one_command(before_it, fault):
                ack = acks.popleft() if acks else None
            self.records.append(FaultRecord(state.system, fault, ack))

    def forget(self) -> None:
        """Forget all records."""
        self.records.clear()
        self._set.clear()
        self._cleared.clear()
        self._known.clear()

    @property
    def last(self) -> FaultRecord | None:
        """The latest record."""
        return self.records[-1] if self.records else None

    def _correct_starts(self, records: list[FaultRecord], faults: tuple[Fault, ...]) -> None:
        """Take over starts that differ though nobody set a fault: a log can only estimate "now"."""
        for record in records:
            if record.fault not in faults:
                same = (f for f in faults if record.fault._replace(start_s=f.start_s) == f)
                record.fault = next(same, record.fault)

    def _go(self, records: list[FaultRecord], why: str, at: float) -> None:
        for record in records:
            record.gone_at, record.gone = at, why
            if why == "cleared":
                record.cleared = self._cleared.get(record.system)


def _by_one_command(one: Fault | None, other: Fault) -> bool:
    """Return whether one command set both: the same of two sensors of a kind."""
    if one is None or not one.instance:
        return False
    return one._replace(instance=other.instance) == other
