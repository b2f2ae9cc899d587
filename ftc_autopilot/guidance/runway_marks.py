"""What of a path is runway."""

from typing import NamedTuple


class RunwayMarks(NamedTuple):
    """What of a path is runway: numbers of legs, and heights of the centre of gravity [m].

    Attributes:
        climb: Leg after a take-off; 0: there is none.
        climb_to: Height that the take-off climbs to.
        final: First leg on the line of a landing.
        landing: Leg that begins at touchdown; 0: there is no landing.
        around: First leg of the way around, after the runway.
        around_at: Its height.
        flare: Height at which the flare begins.
    """

    climb: int = 0
    climb_to: float = 0.0
    final: int = 0
    landing: int = 0
    around: int = 0
    around_at: float = 0.0
    flare: float = 0.0


NO_MARKS = RunwayMarks()
