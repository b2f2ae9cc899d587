"""A formation in space: slots relative to a path, how they are held, and what changes them.

All members fly the same path, each with its own offset, its slot. Slots, and what becomes of them
when a member is degraded, are known to every member, so that all derive the same formation from the
same facts; see `ftc_autopilot.guidance.members`.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from mavlink_defs.config.models import AtMost, Loc, Model, Problems, SystemId
from mavlink_defs.config.quantity import quantity
from sitl_plant.vec3 import Vec3

MAX_MEMBERS = 64
"""Most UAVs that a formation can have: FTC_NEIGHBOUR reports on so many."""
MAX_CHANGES = 16
"""Most changes of the slots that a formation can plan."""
LEADER_FOLLOWER = 1
"""`kind` of a formation whose leaders wait for nobody, in a record of its parameters."""

Policy: TypeAlias = Literal["stay", "slow", "widen", "leave"]
"""What becomes of a member that is in trouble, in the order of FTC_POLICY."""

_Offset = Annotated[float, quantity("m", "Distance.", ge=-1000.0, le=1000.0)]


class Slot(Model):
    """A place relative to the point of the path that the formation is at.

    Attributes:
        ahead_m: Ahead, along the path [m].
        right_m: To the right of the path [m].
        up_m: Above the path [m].
    """

    ahead_m: _Offset = 0.0
    right_m: _Offset = 0.0
    up_m: _Offset = 0.0

    @property
    def offset(self) -> Vec3:
        """Ahead, to the right, up [m]."""
        return self.ahead_m, self.right_m, self.up_m


class FormationChange(Model):
    """Other slots from a time on.

    Attributes:
        at_s: Time on the mission's clock.
        slots: New slots by UAV; the others keep theirs.
    """

    at_s: float = quantity("s", gt=0.0)
    slots: Annotated[dict[SystemId, Slot], AtMost(MAX_MEMBERS)] = Field(min_length=1)


class FormationParameters(Model):
    """The numbers of a formation; they are parameters of the vehicle, too.

    Attributes:
        kind: Whether the UAVs with leader access wait for the others, too.
        ks: Speed per metre that the neighbours are ahead.
        rate_share: Share of the neighbours' excess speed that is matched.
        speed_limit_m_s: Largest correction of the speed along the path.
        slot_speed_m_s: Speed at which a UAV moves to another slot.
        separation_m: Least distance to a neighbour that is held.
        separation_rate: Fastest approach to a neighbour, per metre above the least distance.
        on_lost: When an actuator of a member is lost.
        on_degraded: When one does less than `degraded_below` of what is commanded.
        on_silent: When a neighbour falls silent.
        degraded_below: Effectiveness below which an actuator is degraded.
        recovered_s: Time for which a member must be well to count as such.
        slow_share: Slower by this share of the speed, by policy `slow`.
        widen_m: Further out by this distance, by policy `widen`.
        leave_ahead_m: Ahead of its slot, for a member that leaves by policy `leave` [m].
        leave_right_m: To the right of it [m].
        leave_up_m: Above it [m].
    """

    kind: Literal["virtual_structure", "leader_follower"] = "virtual_structure"
    ks: float = quantity("1/s", default=0.3, gt=0.0, le=2.0)
    rate_share: float = quantity("", default=0.5, ge=0.0, lt=1.0)
    speed_limit_m_s: float = quantity("m/s", default=4.0, gt=0.0, le=20.0)
    slot_speed_m_s: float = quantity("m/s", default=2.0, gt=0.0, le=10.0)
    separation_m: float = quantity("m", default=15.0, ge=0.0, le=500.0)
    separation_rate: float = quantity("1/s", default=0.3, gt=0.0, le=2.0)
    on_lost: Policy = "stay"
    on_degraded: Policy = "stay"
    on_silent: Policy = "stay"
    degraded_below: float = quantity("", default=0.6, gt=0.0, lt=1.0)
    recovered_s: float = quantity("s", default=5.0, ge=0.0)
    slow_share: float = quantity("", default=0.1, ge=0.0, le=0.5)
    widen_m: float = quantity("m", default=20.0, ge=0.0, le=500.0)
    leave_ahead_m: _Offset = -100.0
    leave_right_m: _Offset = 0.0
    leave_up_m: _Offset = 50.0


class Formation(FormationParameters):
    """Slots of all members on the path, how they are held, and what becomes of degraded members.

    Attributes:
        slots: Slot of each member, by UAV.
        changes: Changes of the slots, in order of time.
    """

    slots: Annotated[dict[SystemId, Slot], AtMost(MAX_MEMBERS)] = Field(min_length=1)
    changes: Annotated[tuple[FormationChange, ...], AtMost(MAX_CHANGES)] = ()

    @property
    def members(self) -> tuple[int, ...]:
        """System ids of the members, in order."""
        return tuple(sorted(self.slots))

    def plans(self) -> list[Mapping[int, Slot]]:
        """Return the slots of all members at the start and after each change."""
        plans: list[Mapping[int, Slot]] = [self.slots]
        for change in self.changes:
            plans.append({**plans[-1], **change.slots})
        return plans

    @model_validator(mode="after")
    def _changes_fit(self) -> "Formation":
        Problems.check(self._change_problems())
        return self

    @model_validator(mode="after")
    def _slots_apart(self) -> "Formation":
        Problems.check(self._distance_problems())
        return self

    def _change_problems(self) -> Iterator[tuple[Loc, str]]:
        for k, change in enumerate(self.changes):
            before = self.changes[k - 1].at_s if k else 0.0
            if change.at_s <= before:
                text = f"expected later than {before:g} s, the change before, got {change.at_s!r}"
                yield ("changes", k, "at_s"), text
            for uav in change.slots.keys() - self.slots.keys():
                ids = ", ".join(map(str, self.members))
                text = f"expected a member of the formation ({ids}), got UAV {uav}"
                yield ("changes", k, "slots", uav), text

    def _distance_problems(self) -> Iterator[tuple[Loc, str]]:
        for k, plan in enumerate(self.plans()):
            loc: Loc = ("slots",) if k == 0 else ("changes", k - 1, "slots")
            for a, b in combinations(self.members, 2):
                distance = math.dist(plan[a].offset, plan[b].offset)
                if distance < self.separation_m:
                    text = f"UAVs {a} and {b} are {distance:.3g} m apart there, expected at least"
                    yield loc, f"{text} separation_m, {self.separation_m:g} m"


LAYOUT = np.dtype(
    [
        ("count", "i8"),  # members, 0: no formation
        ("own", "i8"),  # index of this UAV among them, in the order of their ids
        ("ids", "i8", (MAX_MEMBERS,)),
        ("neighbours", "i8", (MAX_MEMBERS,)),  # member that each neighbour is, or -1
        ("access", "f8"),  # leader access h_i
        ("weight", "f8"),  # h_i + sum of a_ij while every neighbour is heard
        ("plans", "i8"),
        ("at", "f8", (MAX_CHANGES + 1,)),  # start of each plan on the mission's clock [s]
        ("slots", "f8", (MAX_CHANGES + 1, MAX_MEMBERS, 3)),  # ahead, right, up [m]
    ]
)
"""What does not change in flight: members, planned slots, place in the communication graph."""


def layout_record(
    formation: Formation, own: int, access: float, neighbours: Mapping[int, float]
) -> np.void:
    """Return a formation as one of its members sees it, as a record of dtype `LAYOUT`.

    Args:
        formation: The formation.
        own: System id of the member.
        access: Its leader access h_i.
        neighbours: Its weights a_ij by neighbour, in the order of its links.
    """
    members = formation.members
    record: np.void = np.zeros(1, LAYOUT)[0]
    record["count"], record["own"] = len(members), members.index(own)
    record["ids"][: len(members)] = members
    record["neighbours"] = -1
    for d, uav in enumerate(neighbours):
        if uav in members:
            record["neighbours"][d] = members.index(uav)
    record["access"] = access
    record["weight"] = access + sum(a for uav, a in neighbours.items() if uav in members)
    plans = formation.plans()
    record["plans"] = len(plans)
    record["at"][1 : len(plans)] = [change.at_s for change in formation.changes]
    for k, plan in enumerate(plans):
        record["slots"][k, : len(members)] = [plan[uav].offset for uav in members]
    return record
