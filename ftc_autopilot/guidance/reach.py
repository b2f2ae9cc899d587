"""Whether those members of a formation that can come close can know of each other.

A member knows where all are that a chain of links joins to it, later with each link; see
`ftc_autopilot.guidance.places`. Which two can come close is decided across the path alone: a UAV
that loses thrust falls back along it, past all that fly behind.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from ftc_autopilot.guidance.formation import Formation, Slot
from ftc_autopilot.guidance.places import FORGOTTEN_S, MAX_RELAYED, REPEAT_S
from mavlink_defs.config.models import Loc

_MARGIN_M = 15.0
"""What a degraded member may drift off its slot across the path before it counts as gone [m]."""


def most_links(members: int, update_s: float, silence_s: float | None) -> int:
    """Return over how many links a place gets around before it is forgotten.

    Args:
        members: UAVs in the formation.
        update_s: Period in which each chooses members to relay [s].
        silence_s: Longest silence of a trigger of neighbour messages; None: every period [s].
    """
    hop_s = update_s * math.ceil(max(members - 2, 1) / MAX_RELAYED)
    first_s = update_s
    if silence_s is not None:
        first_s, hop_s = silence_s, hop_s + REPEAT_S
    return 1 + max(math.floor((FORGOTTEN_S - first_s) / hop_s), 0)


def reach_problems(
    formation: Formation, edges: Sequence[tuple[int, int]], most: int
) -> Iterator[tuple[Loc, str]]:
    """Yield each pair that can come close although neither hears of the other in time.

    Args:
        formation: The formation.
        edges: Pairs of UAVs that hear each other.
        most: Links over which a place gets around.
    """
    least = formation.separation_m
    if least <= 0.0:
        return
    links = _links(formation.members, edges)
    for a, b in combinations(formation.members, 2):
        count = links[a].get(b)
        if count is not None and count <= most:
            continue
        room = _room_across(formation, a, b)
        if room >= least + _MARGIN_M:
            continue
        far = "no chain of links joins them" if count is None else f"{count} links are between them"
        limit = "" if count is None else f", and a place is relayed over {most} at most"
        text = (
            f"UAVs {a} and {b} fly within {room:.3g} m of each other across the path, and neither "
            f"knows in time where the other is: {far}{limit}; give them an edge in network.edges, "
            f"or slots at least {least + _MARGIN_M:g} m apart across the path"
        )
        yield ("slots",), text


def _links(members: Sequence[int], edges: Sequence[tuple[int, int]]) -> dict[int, dict[int, int]]:
    """Return how many links there are between any two members at least; none: not joined."""
    hears: dict[int, set[int]] = {m: set() for m in members}
    for a, b in edges:
        if a in hears and b in hears:
            hears[a].add(b)
            hears[b].add(a)
    links = {}
    for m in members:
        found, border = {m: 0}, {m}
        while border:
            border = {other for near in border for other in hears[near]} - found.keys()
            found.update(dict.fromkeys(border, max(found.values()) + 1))
        links[m] = found
    return links


def _room_across(formation: Formation, a: int, b: int) -> float:
    """Return the least distance of two members across the path [m].

    Each can be anywhere between its slots before and after a change, or on its way out.
    """
    plans = formation.plans()
    least = math.inf
    for before, after in zip(plans, [*plans[1:], plans[-1]], strict=True):
        gaps = []
        for axis in (1, 2):  # to the right, up
            low_a, high_a = _extent(formation, a, before, after, axis)
            low_b, high_b = _extent(formation, b, before, after, axis)
            gaps.append(max(low_b - high_a, low_a - high_b, 0.0))
        least = min(least, math.hypot(*gaps))
    return least


def _extent(
    formation: Formation, uav: int, before: Mapping[int, Slot], after: Mapping[int, Slot], axis: int
) -> tuple[float, float]:
    """Return from where to where a member moves along an axis [m]."""
    places = [before[uav].offset[axis], after[uav].offset[axis]]
    if "leave" in (formation.on_lost, formation.on_degraded, formation.on_silent):
        leave = (formation.leave_ahead_m, formation.leave_right_m, formation.leave_up_m)[axis]
        places += [place + leave for place in places]
    return min(places), max(places)
