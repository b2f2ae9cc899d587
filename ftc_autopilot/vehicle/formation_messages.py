"""What a member of a formation reports to ground stations, and their commands for its slot."""

import math
from collections.abc import Iterator, Sequence

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controllers import Controllers, ReferenceSource
from ftc_autopilot.guidance.members import SILENT, cause_of, policy_of, state_of
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.modes import Say
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults.command import InvalidParam
from mavlink_defs.float32 import float32s
from sitl_plant.vec3 import Vec3

_CAUSES = ("well", "an actuator is degraded", "an actuator is lost", "silent")
_POLICIES = ("it stays", "the formation slows down", "its slot moves outwards", "it leaves")
_FARTHEST_M = 1000.0
"""Farthest place of a slot, in each direction [m]."""


def slot_ordered(params: Sequence[float], in_formation: bool) -> tuple[Vec3 | None, str]:
    """Return the slot that MAV_CMD_FTC_SET_SLOT orders, None: the planned one, and a text of it.

    Raises:
        InvalidParam: There is none, or it cannot be had.
    """
    if not in_formation:
        raise InvalidParam(1, "Slot", "Slot: this UAV is in no formation")
    ahead, right, up = slot = params[0], params[1], params[2]
    if any(map(math.isnan, slot)):
        if not all(map(math.isnan, slot)):
            text = "Slot: is partly NaN, must be three distances or three NaN"
            raise InvalidParam(1, "Slot", text)
        return None, "slot is the planned one"
    for i, name in enumerate(("ahead", "right", "up")):
        if not abs(slot[i]) <= _FARTHEST_M:
            limits = f"{-_FARTHEST_M:g} to {_FARTHEST_M:g} m"
            text = f"Slot: {name} is {slot[i]:g} m, must be {limits}"
            raise InvalidParam(i + 1, name, text)
    return slot, f"slot is {ahead:g} m ahead, {right:g} m to the right, {up:g} m up"


class FormationMessages:
    """Makes messages and texts from the last update, and takes orders for the slot."""

    def __init__(
        self, config: AutopilotConfig, hot: HotState, controllers: Controllers, say: Say
    ) -> None:
        self._hot, self._controllers, self._say = hot, controllers, say
        self._formation = config.formation
        self._members = () if config.formation is None else config.formation.members
        self._state, self._own = controllers.uavs[0]["formation"], config.id
        self._known = [0] * len(self._members)
        self._slot, self._evading, self._near = self._own, False, False

    @message(dialect.MAVLink_ftc_formation_message)
    def formation(self) -> MAVLink_message:
        """Return FTC_FORMATION; without a path or a formation, its path_id is 0."""
        state, path_id = self._state, self._path_id
        own = int(state["table"][self._members.index(self._own)]) if path_id else 0
        position, rate, distance = float32s((state["xi"], state["xi_rate"], state["distance"]))
        return dialect.MAVLink_ftc_formation_message(
            self._hot.time_ms,
            path_id,
            position,
            rate,
            float32s(state["slot"]["place"]),
            float32s(state["error"]),
            distance,
            int(state["nearest"]),
            int(state["evading"]),
            cause_of(own),
            policy_of(own),
            [int(entry) for entry in state["table"]] if path_id else [0] * len(state["table"]),
        )

    def set_slot(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_FTC_SET_SLOT."""
        try:
            slot, text = slot_ordered(params, self._formation is not None)
        except InvalidParam as problem:
            self._say(dialect.MAV_SEVERITY_WARNING, str(problem))
            return dialect.MAV_RESULT_DENIED
        self._state["commanded"] = math.nan if slot is None else slot
        self._say(dialect.MAV_SEVERITY_INFO, text)
        return dialect.MAV_RESULT_ACCEPTED

    def changes(self) -> Iterator[Change]:
        """Yield what has changed since the last call."""
        if self._formation is None or not self._path_id:
            return
        yield from self._changes_of_members()
        state, least = self._state, self._formation.separation_m
        neighbour, distance = int(state["nearest"]), float(state["distance"])
        evading, near = bool(state["evading"]), distance < least
        if near and not self._near:
            text = f"UAV {neighbour} is {distance:.1f} m away, less than {least:g} m"
            yield Change("separation", dialect.MAV_SEVERITY_CRITICAL, text)
        elif evading and not self._evading:
            text = f"evading, the nearest is UAV {neighbour}, {distance:.1f} m away"
            yield Change("evading", dialect.MAV_SEVERITY_WARNING, text)
        self._evading, self._near = evading, near

    def _changes_of_members(self) -> Iterator[Change]:
        """Yield what has become of this UAV, of the silent, and whose slot this UAV takes."""
        state = self._state
        table = state["table"].tolist()
        for m, uav in enumerate(self._members):
            entry = table[m]
            before, self._known[m] = self._known[m], state_of(entry)
            if before == self._known[m]:
                continue
            silent = SILENT in {cause_of(entry), cause_of(before)}
            if uav != self._own and not silent:
                continue
            who = f"formation: UAV {uav}"
            if self._known[m] == 0:
                yield Change(who, dialect.MAV_SEVERITY_NOTICE, f"{who} is well again")
            else:
                text = f"{_CAUSES[cause_of(entry)]}, {_POLICIES[policy_of(entry)]}"
                yield Change(who, dialect.MAV_SEVERITY_WARNING, f"{who}: {text}")
        slot = self._members[int(state["slot_of"][self._members.index(self._own)])]
        if slot != self._slot:
            self._slot = slot
            whose = "its own slot" if slot == self._own else f"the slot of UAV {slot}"
            text = f"formation: UAV {self._own} takes {whose}"
            yield Change("slot", dialect.MAV_SEVERITY_NOTICE, text)

    @property
    def _path_id(self) -> int:
        """Number of the path that is flown in formation; 0: none."""
        follows = int(self._controllers.uavs[0]["guidance"]["follows"]) == ReferenceSource.PATH
        return int(self._state["path_id"]) if follows else 0
