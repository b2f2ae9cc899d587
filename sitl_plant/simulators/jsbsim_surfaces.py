"""Surfaces of an aircraft in JSBSim: which command puts each to which angle.

What lies between command and angle is measured: the aircraft's flight control may scale a command,
shift it, or turn it round. It has to be a map of this command alone, at once, and one that can be
inverted; else the aircraft has an autopilot, or servos, of its own, which would be flown as well.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

from sitl_plant.simulators.base import SimulatorError

_GRID = 20  # commands on either side of 0
_MIN_ANGLE = 1e-6  # rad: angles nearer to each other are the same
_DISTURBED = {"ic/p-rad_sec": 0.2, "ic/q-rad_sec": 0.1, "ic/r-rad_sec": 0.1, "ic/theta-rad": 0.1}


class _Named(NamedTuple):
    name: str
    command: str
    positions: tuple[str, ...]  # the first that the command moves
    moment: str


_SURFACES = (
    _Named(
        "aileron",
        "fcs/aileron-cmd-norm",
        ("fcs/left-aileron-pos-rad", "fcs/right-aileron-pos-rad"),
        "moments/l-aero-lbsft",
    ),
    _Named("elevator", "fcs/elevator-cmd-norm", ("fcs/elevator-pos-rad",), "moments/m-aero-lbsft"),
    _Named("rudder", "fcs/rudder-cmd-norm", ("fcs/rudder-pos-rad",), "moments/n-aero-lbsft"),
)


class Surface:
    """One surface.

    Attributes:
        stops: Least and largest angle [rad], with the plant's signs; (0, 0) if there is no surface.
    """

    def __init__(self, command: Any, angles: Sequence[float], commands: Sequence[float]) -> None:
        """Take a node, and ascending angles [rad] with the commands that make them."""
        self._command = command
        self._angles, self._commands = list(angles), list(commands)
        self.stops = (self._angles[0], self._angles[-1]) if self.has_angles else (0.0, 0.0)

    @property
    def has_angles(self) -> bool:
        """Whether there is such a surface."""
        return bool(self._angles)

    def put(self, angle: float) -> None:
        """Command an angle [rad], or the stop that is before it."""
        if not self.has_angles:
            return
        angles, commands = self._angles, self._commands
        i = min(max(bisect_right(angles, angle), 1), len(angles) - 1)
        share = (angle - angles[i - 1]) / (angles[i] - angles[i - 1])
        share = min(max(share, 0.0), 1.0)
        self._command.set_double_value(commands[i - 1] + share * (commands[i] - commands[i - 1]))


def surfaces_of(
    aircraft: str, fdm: Any, checked: Callable[[Callable[[], Any]], Any]
) -> tuple[Surface, ...]:
    """Measure aileron, elevator and rudder at the initial condition that is set.

    Args:
        aircraft: Its name, for messages.
        fdm: JSBSim with the aircraft.
        checked: Calls JSBSim.

    Raises:
        SimulatorError: A surface cannot be put to an angle.
    """
    measured = [_measured(aircraft, fdm, checked, named) for named in _SURFACES]
    lacking = [
        named for named, surface in zip(_SURFACES, measured, strict=True) if not surface.has_angles
    ]
    if len(lacking) == len(_SURFACES):
        text = f"JSBSim's {aircraft} has no aerodynamic surfaces"
        raise SimulatorError(text, "choose a fixed-wing aircraft")
    for named in lacking:
        if named.name != "rudder":
            text = f"JSBSim's {aircraft} has no {named.name}: {named.command} moves none"
            raise SimulatorError(text, "choose an aircraft with aileron and elevator")
    return tuple(measured)


def _refused(aircraft: str, why: str) -> SimulatorError:
    text = f"JSBSim's {aircraft} cannot be flown by its surfaces: {why}"
    return SimulatorError(text, "choose an aircraft without a flight control of its own")


def _measured(
    aircraft: str, fdm: Any, checked: Callable[[Callable[[], Any]], Any], named: _Named
) -> Surface:
    command = fdm.get_property_manager().get_node(named.command, True)
    refused = partial(_refused, aircraft)
    late = refused(f"the {named.name} follows {named.command} late, by a servo of its own")
    grid = [k / _GRID for k in range(-_GRID, _GRID + 1)]

    def at(value: float, key: str) -> float:
        command.set_double_value(value)
        checked(fdm.run_ic)
        return float(fdm[key])

    for position in named.positions:
        angles = [at(value, position) for value in grid]
        if max(angles) - min(angles) > _MIN_ANGLE:
            break
    else:
        command.set_double_value(1.0)
        for _ in range(1000):
            checked(fdm.run)
        moved = any(abs(fdm[p] - angles[0]) > _MIN_ANGLE for p in named.positions)
        at(0.0, named.positions[0])
        if moved:
            raise late
        return Surface(command, [], [])
    if abs(at(1.0, position) - at(1.0, position)) > _MIN_ANGLE:
        at(0.0, position)
        raise late
    turned = angles[-1] < angles[0]
    ascending = angles[::-1] if turned else angles
    commands = grid[::-1] if turned else grid
    ascending, commands = _without_ends(ascending, commands)
    if any(b - a < _MIN_ANGLE for a, b in pairwise(ascending)):
        seen = ", ".join(f"{angle:.3g}" for angle in angles[:: _GRID // 2])
        raise refused(
            f"{named.command} of -1, -0.5, 0, 0.5, 1 gives {position} {seen} rad, which has no "
            "inverse"
        )
    _check_alone(fdm, checked, named, position, at, refused)
    difference = at(1.0, named.moment) - at(-1.0, named.moment)
    rest = at(0.0, position)
    if not abs(difference) > 0.0:
        raise refused(f"the {named.name} makes no moment about its axis")
    if abs(rest) > max(abs(ascending[0]), abs(ascending[-1])):
        raise refused(f"the {named.name} is at {rest:.3g} rad by a command of 0")
    raises_moment = (difference > 0.0) != turned
    if raises_moment:  # by its angle; the plant's derivatives by surfaces are negative
        return Surface(command, [-angle for angle in reversed(ascending)], commands[::-1])
    return Surface(command, ascending, commands)


def _without_ends(angles: list[float], commands: list[float]) -> tuple[list[float], list[float]]:
    """Leave out, at both ends, the commands that change nothing any more."""
    first, last = 0, len(angles) - 1
    while first < last and abs(angles[first + 1] - angles[first]) < _MIN_ANGLE:
        first += 1
    while last > first and abs(angles[last - 1] - angles[last]) < _MIN_ANGLE:
        last -= 1
    return angles[first : last + 1], commands[first : last + 1]


def _check_alone(
    fdm: Any,
    checked: Callable[[Callable[[], Any]], Any],
    named: _Named,
    position: str,
    at: Callable[[float, str], float],
    refused: Callable[[str], SimulatorError],
) -> None:
    """Check that the angle follows the command at once, and nothing else."""
    for value in (0.0, 0.5):
        angle = at(value, position)
        before = {key: fdm[key] for key in _DISTURBED}
        for key, disturbed in _DISTURBED.items():
            fdm[key] = disturbed
        other = at(value, position)
        for _ in range(100):
            checked(fdm.run)
        later = fdm[position]
        for key, undisturbed in before.items():
            fdm[key] = undisturbed
        at(value, position)
        if max(abs(other - angle), abs(later - angle)) > _MIN_ANGLE:
            text = f"the {named.name} moves without {named.command}, by an autopilot of its own"
            raise refused(text)
    at(0.0, position)
    command = fdm.get_property_manager().get_node(named.command)
    command.set_double_value(0.5)
    checked(fdm.run)
    prompt = fdm[position]
    if abs(prompt - at(0.5, position)) > _MIN_ANGLE:
        at(0.0, position)
        raise refused(f"the {named.name} follows {named.command} late, by a servo of its own")
    at(0.0, position)
