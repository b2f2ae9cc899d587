"""The order in which the items of a mission are flown, jumps carried out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ftc_autopilot.guidance.mission_items import (
    Delay,
    Jump,
    Loiter,
    Return,
    SetHome,
    SetSpeed,
    Takeoff,
    Task,
    Waypoint,
)
from mavlink_defs import dialect
from mavlink_defs.profile import ItemError

MAX_VISITS = 1000


@dataclass(frozen=True)
class Visit:
    """A place of a mission, and what is done on the way to it.

    Attributes:
        place: The place.
        on_the_way: What is done.
        jump: Item of the jump that led to it once more; None if it is the first visit.
    """

    place: Waypoint | Loiter | Return
    on_the_way: tuple[SetSpeed | Delay | SetHome, ...]
    jump: int | None = None


@dataclass(frozen=True)
class Order:
    """The places in the order in which they are flown.

    Attributes:
        visits: Each visit.
        again: Visit that follows the last one, if the mission has no end.
    """

    visits: tuple[Visit, ...]
    again: int | None = None


def order_of(tasks: Sequence[Task], first: int = 1) -> Order:
    """Carry out the jumps of a mission.

    A jump counts by itself, and is not set back by another one, as in ArduPilot. What stands before
    the last place has its effect; what stands after it has none.

    Args:
        tasks: Task k is that of item k + 1.
        first: Item to begin with.

    Raises:
        ItemError: Jumps lead around without a place, or make too many of them.
    """
    visits: list[Visit] = []
    visited: set[int] = set()
    left = {task.item: task.times for task in tasks if isinstance(task, Jump)}
    on_the_way: list[SetSpeed | Delay | SetHome] = []
    begun: dict[tuple[int, ...], int] = {}  # visits made when an endless jump was taken before
    at, jump = first, None
    while at <= len(tasks):
        task = tasks[at - 1]
        at += 1
        match task:
            case Waypoint() | Loiter() | Return():
                seen = task.item in visited
                visited.add(task.item)
                visits.append(Visit(task, tuple(on_the_way), jump if seen else None))
                on_the_way.clear()
                if _has_no_end(task):
                    break
                if jump is not None and len(visits) > MAX_VISITS:
                    text = f"jumps make more than {MAX_VISITS} places of the mission"
                    raise ItemError(jump, dialect.MAV_MISSION_NO_SPACE, f"{text}; jump less often")
            case Jump():
                if left[task.item] == 0:
                    continue
                if left[task.item] > 0:
                    left[task.item] -= 1
                else:
                    state = (task.item, *left.values())
                    if begun.get(state, len(visits)) < len(visits):
                        return Order(tuple(visits), begun[state])
                    if state in begun:
                        text = f"jump to item {task.to} leads around without a waypoint"
                        raise ItemError(task.item, dialect.MAV_MISSION_INVALID_PARAM1, text)
                    begun[state] = len(visits)
                at, jump = task.to, task.item
            case Takeoff():
                pass
            case _:
                on_the_way.append(task)
    return Order(tuple(visits))


def _has_no_end(place: Waypoint | Loiter | Return) -> bool:
    return isinstance(place, Return) or (isinstance(place, Loiter) and math.isinf(place.turns))
