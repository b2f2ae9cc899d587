"""Thrust by the engines of an aircraft in JSBSim: the throttle that makes it at an airspeed.

The map is measured, at constant airspeeds, each engine settled as JSBSim settles it for its trim.
In flight the engines have dynamics of their own: thrust comes when they have it.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from itertools import accumulate
from typing import Any

from sitl_plant.simulators.base import SimulatorError
from sitl_plant.simulators.jsbsim_units import FT, LBF

_THROTTLES = tuple(k / 10 for k in range(11))
_AIRSPEEDS = (0.5, 0.75, 1.0, 1.25, 1.5)  # of the one that it starts at
_STANDING_FPS = 1.0
_FROM_REST = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the highest one
_ALL = -1.0  # engines
_BOTH_MAGNETOS = 3.0


class Engine:
    """All engines of one aircraft, by one throttle."""

    def __init__(self, aircraft: str, fdm: Any, fastest_m_s: float | None) -> None:
        """Take JSBSim with the aircraft; SimulatorError if it has no engine.

        Args:
            aircraft: Its name.
            fdm: JSBSim.
            fastest_m_s: Highest airspeed of one that starts from the ground.
        """
        self._aircraft, self._fdm = aircraft, fdm
        self._fastest = None if fastest_m_s is None else fastest_m_s / FT
        self._propulsion = fdm.get_propulsion()
        count = self._propulsion.get_num_engines()
        if count == 0:
            text = f"JSBSim's {aircraft} has no engine"
            raise SimulatorError(text, "choose plant.thrust: force")
        node = fdm.get_property_manager().get_node
        self._throttles = [node(f"fcs/throttle-cmd-norm[{i}]", True) for i in range(count)]
        self._airspeed = node("velocities/vt-fps").get_double_value
        self._near = (0.0, -1.0)  # airspeeds at which the map will do [ft/s]
        self._airspeeds: list[float] = []  # ft/s
        self._thrusts: list[list[float]] = []  # by airspeed and throttle [N]
        fdm["propulsion/fuel_freeze"] = 1.0

    def start(self, evaluate: Callable[[], None]) -> None:
        """Let the engines run, settled at the throttle they have.

        The map is measured about the present airspeed, unless it was near to it.

        Args:
            evaluate: Evaluates the forces at the present state.
        """
        low, high = self._near
        if not low <= self._airspeed() <= high:
            self._measure(evaluate)
        self._settle(evaluate)

    def put(self, thrust: float) -> None:
        """Set the throttle that makes a thrust [N] at the present airspeed, or the nearest."""
        V, airspeeds = self._airspeed(), self._airspeeds
        i = min(max(bisect_right(airspeeds, V), 1), len(airspeeds) - 1)
        share = (V - airspeeds[i - 1]) / (airspeeds[i] - airspeeds[i - 1])
        share = min(max(share, 0.0), 1.0)
        slower, faster = self._thrusts[i - 1], self._thrusts[i]
        made = [a + share * (b - a) for a, b in zip(slower, faster, strict=True)]
        self._set(_inverse(thrust, made))

    def _measure(self, evaluate: Callable[[], None]) -> None:
        fdm = self._fdm
        body = [(f"ic/{axis}-fps", fdm[f"ic/{axis}-fps"]) for axis in "uvw"]
        throttles = [node.get_double_value() for node in self._throttles]
        V, speeds, shares = self._airspeed(), [speed for _, speed in body], _AIRSPEEDS
        self._near = 0.75 * V, 1.25 * V
        if V < _STANDING_FPS and self._fastest is not None:
            V, speeds, shares = self._fastest, [self._fastest, 0.0, 0.0], _FROM_REST
            self._near = 0.0, math.inf
        self._airspeeds = [share * V for share in shares]
        self._thrusts = []
        for share in shares:
            for (key, _), speed in zip(body, speeds, strict=True):
                fdm[key] = share * speed
            made = []
            for throttle in _THROTTLES:
                fdm.run_ic()
                self._set(throttle)
                self._settle(evaluate)
                made.append(fdm["forces/fbx-prop-lbs"] * LBF)
            self._thrusts.append(list(accumulate(made, max)))
        if not self._thrusts[len(_AIRSPEEDS) // 2][-1] > 0.0:
            text = f"the engine of JSBSim's {self._aircraft} makes no thrust"
            raise SimulatorError(text, "choose plant.thrust: force")
        for key, speed in body:
            fdm[key] = speed
        for node, throttle in zip(self._throttles, throttles, strict=True):
            node.set_double_value(throttle)
        fdm.run_ic()

    def _settle(self, evaluate: Callable[[], None]) -> None:
        fdm = self._fdm
        throttles = [node.get_double_value() for node in self._throttles]
        for i in range(len(throttles)):
            fdm[f"fcs/mixture-cmd-norm[{i}]"] = fdm[f"fcs/advance-cmd-norm[{i}]"] = 1.0
        fdm["propulsion/magneto_cmd"] = _BOTH_MAGNETOS
        evaluate()  # the commands get through the flight control
        fdm["propulsion/set-running"] = _ALL  # which opens the throttle
        for node, throttle in zip(self._throttles, throttles, strict=True):
            node.set_double_value(throttle)
        evaluate()
        self._propulsion.get_steady_state()
        evaluate()

    def _set(self, throttle: float) -> None:
        for node in self._throttles:
            node.set_double_value(throttle)


def _inverse(thrust: float, made: list[float]) -> float:
    """Return the least throttle that makes a thrust; thrusts never fall with the throttle."""
    if thrust <= made[0]:
        return _THROTTLES[0]
    for k in range(1, len(made)):
        if thrust <= made[k]:
            share = (thrust - made[k - 1]) / (made[k] - made[k - 1])
            return _THROTTLES[k - 1] + share * (_THROTTLES[k] - _THROTTLES[k - 1])
    return _THROTTLES[-1]
