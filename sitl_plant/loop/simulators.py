"""The aircraft of a fleet that simulators fly, and their periods in between two compiled halves."""

import math
from collections.abc import Callable

import numpy as np

from mavlink_defs.constants import SURFACES
from mavlink_defs.runtime.foreign import ForeignCode
from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import contact
from sitl_plant.airframe.config import Aircraft
from sitl_plant.config import InitialState, PlantConfig, PlantUav
from sitl_plant.loop.fleet import ADVANCE, PlantState
from sitl_plant.simulators import new_simulator
from sitl_plant.simulators.base import GroundSimulator, Motion, Simulator, SimulatorError
from sitl_plant.simulators.config import OwnPlant
from sitl_plant.vec3 import Vec3

_note_outside = in_python(contact.note_outside)
_REACHED_DEG = 0.1  # stops this far beyond a simulator's are the same: files have round numbers


class Outside:
    """The simulators of a plant.

    Attributes:
        failures: Why one could not fly on, by the index of its aircraft, whose state is then NaN.
    """

    def __init__(self, config: PlantConfig, fleet: PlantState) -> None:
        """Load what the simulators fly, at its initial state.

        Args:
            config: The plant's.
            fleet: Its state at its start, which has the initial states of its aircraft.

        Raises:
            SimulatorError: An aircraft cannot be flown.
        """
        self._fleet = fleet
        self._dt = config.step_us / 1e6
        self._begun = False
        self._windy = fleet.wind[0]["still"] == 0
        self.failures: dict[int, str] = {}
        self._simulators = {
            i: simulator_of(uav, config.step_us)
            for i, uav in enumerate(config.uavs)
            if not isinstance(uav.plant, OwnPlant)
        }
        for i, simulator in self._simulators.items():
            with ForeignCode(_failure):
                self._start(i, config.uavs[i].initial, simulator)

    def _start(self, i: int, initial: InitialState, simulator: Simulator) -> None:
        """Put an aircraft where it begins."""
        uav = self._fleet.uavs[i]
        if initial.on_ground and isinstance(simulator, GroundSimulator):
            yaw = math.radians(initial.yaw_deg)
            motion = simulator.stand(initial.north_m, initial.east_m, yaw)
            uav["state"] = _state(motion)
            uav["gear"]["load"] = motion.load
        else:
            simulator.reset(_motion(uav["state"]))
            motion = simulator.read()
        uav["outside"]["specific_force"] = motion.specific_force
        if not isinstance(simulator, GroundSimulator):  # it must not touch the ground
            uav["gear"]["has"] = 0

    def advance(self) -> None:
        """Advance every simulator by one period, for which the fleet has begun."""
        outside = self._fleet.uavs["outside"]
        for i, simulator in self._simulators.items():
            try:  # whatever another package raises ends this flight alone
                with ForeignCode(_failure):
                    motion = self._advanced(i, simulator)
            except SimulatorError as problem:
                self.failures[i] = str(problem)
                self._fleet.uavs[i]["state"] = math.nan
                continue
            uav = self._fleet.uavs[i]
            before, uav["state"] = uav["state"].copy(), _state(motion)
            outside["specific_force"][i] = motion.specific_force
            if uav["gear"]["near"]:
                t = uav["message"]["time_usec"] / 1e6
                _note_outside(before, t, uav["state"], motion.load, uav["aircraft"], uav["gear"])
        outside["advanced"] = 1
        self._begun = True

    def _advanced(self, i: int, simulator: Simulator) -> Motion:
        outside = self._fleet.uavs[i]["outside"]
        if self._windy:
            simulator.set_wind(_vector(outside["wind"]))
        if not self._begun:  # the servos have come to rest at their first commands
            *delta, thrust = self._fleet.uavs[i]["applied"].tolist()
            simulator.control((delta[0], delta[1], delta[2]), thrust)
            simulator.reset(_motion(self._fleet.uavs[i]["state"]))
        gear = self._fleet.uavs[i]["gear"]
        if gear["has"] and isinstance(simulator, GroundSimulator):
            simulator.brake(float(gear["brake"]))
        *delta, thrust = outside["controls"].tolist()
        simulator.control((delta[0], delta[1], delta[2]), thrust)
        simulator.advance(self._dt)
        return simulator.read()


def flown_by(outside: Outside, loop: Callable[[int], tuple[int, int]]) -> tuple[int, int]:
    """Run a compiled loop of steps, and advance the simulators each time that it returns for that.

    Args:
        outside: The simulators.
        loop: Flies on when so many steps are flown; returns how many more it flew, and what
            `sitl_plant.loop.fleet.fly` returned last.

    Returns:
        Steps flown, and the index of the lost aircraft, or -1.
    """
    flown = 0
    while True:
        more, lost = loop(flown)
        flown += more
        if lost != ADVANCE:
            return flown, lost
        outside.advance()


def simulator_of(uav: PlantUav, step_us: int) -> Simulator:
    """Return the simulator of an aircraft that the plant does not fly itself.

    Args:
        uav: The aircraft.
        step_us: Control period [µs].

    Raises:
        SimulatorError: It cannot fly it: not as far as the aircraft's stops are apart, say.
    """
    gear, altitude_m = uav.aircraft.gear, uav.initial.altitude_m
    fastest_m_s = None if gear is None else uav.aircraft.airspeed_max_m_s
    simulator = new_simulator(uav.plant, altitude_m, step_us, fastest_m_s)
    if uav.initial.on_ground and not isinstance(simulator, GroundSimulator):
        text = f"UAV {uav.id}: its simulator has no ground to stand on"
        raise SimulatorError(text, "give initial.altitude_m and airspeed_m_s in place of on_ground")
    if uav.initial.on_ground and gear is not None and gear.launcher is not None:
        text = f"UAV {uav.id}: expected an aircraft without a launcher on a simulator's ground"
        raise SimulatorError(text, "leave out on_ground, or aircraft.gear.launcher")
    _check_stops(uav.id, uav.aircraft, simulator)
    return simulator


def _check_stops(uav_id: int, aircraft: Aircraft, simulator: Simulator) -> None:
    for name, stops, reached in zip(SURFACES, aircraft.stops_deg, simulator.stops, strict=True):
        low, high = np.degrees(reached)
        if stops[0] < low - _REACHED_DEG or stops[1] > high + _REACHED_DEG:
            hint = f"set aircraft.surface_limits_deg.{name} to what it reaches"
            raise SimulatorError(
                f"UAV {uav_id}: the {name}'s stops are {stops[0]:g} and {stops[1]:g} deg in "
                f"`aircraft`, but its simulator's reach {low:.1f} to {high:.1f} deg",
                hint if low < high else f"set aircraft.surface_limits_deg.{name} to none",
            )


def _failure(problem: BaseException) -> BaseException:
    if isinstance(problem, SimulatorError):
        return problem
    return SimulatorError(f"its simulator failed: {type(problem).__name__}: {problem}")


def _motion(x: np.ndarray) -> Motion:
    still = (0.0, 0.0, 0.0)
    return Motion(_vector(x[0:3]), _vector(x[3:6]), _vector(x[6:9]), _vector(x[9:12]), still)


def _state(motion: Motion) -> tuple[float, ...]:
    return (*motion.position, *motion.velocity, *motion.attitude, *motion.rates)


def _vector(a: np.ndarray) -> Vec3:
    x, y, z = a.tolist()
    return x, y, z
