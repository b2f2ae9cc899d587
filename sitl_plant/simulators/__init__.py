"""Simulators that fly an aircraft in place of the plant's own equations.

Other packages register theirs as entry points of the group `ftc_sitl.simulators`: each is a
callable that takes the section `options` of a scenario's plant and an altitude [m], and returns a
simulator.
"""

from importlib.metadata import entry_points

from mavlink_defs.runtime.foreign import ForeignCode
from sitl_plant.simulators.base import Simulator, SimulatorError
from sitl_plant.simulators.config import JsbSimPlant, OwnPlant, PlantSection, PluginPlant

GROUP = "ftc_sitl.simulators"


def new_simulator(
    plant: PlantSection, altitude_m: float, step_us: int = 1000, fastest_m_s: float | None = None
) -> Simulator:
    """Return a simulator that has loaded its aircraft; one for each aircraft and flight.

    Args:
        plant: Which one, and what it takes.
        altitude_m: Where it starts, above sea level and ground [m].
        step_us: Its step if the section does not say [µs].
        fastest_m_s: Of an aircraft with gear, its highest airspeed; None: the ground is out of
            reach.

    Raises:
        SimulatorError: It cannot fly this.
    """
    if isinstance(plant, OwnPlant):
        raise SimulatorError("plant.kind: expected a simulator, got 'own'")
    own_step_us = plant.step_us or step_us
    if isinstance(plant, JsbSimPlant):
        from sitl_plant.simulators.jsbsim import JsbSim  # takes time, and may not be installed

        return JsbSim(plant, altitude_m, own_step_us, fastest_m_s)
    return _of_other_package(plant, altitude_m)


def _of_other_package(plant: PluginPlant, altitude_m: float) -> Simulator:
    found = entry_points(group=GROUP)
    if plant.name not in found.names:
        names = ", ".join(sorted(found.names)) or "none is installed here"
        text = f"plant.name: expected a simulator registered in {GROUP}, got {plant.name!r}"
        raise SimulatorError(text, f"those registered: {names}")

    def error(problem: BaseException) -> BaseException:
        if isinstance(problem, SimulatorError):
            return problem
        what = f"{type(problem).__name__}: {problem}"
        return SimulatorError(f"the simulator {plant.name!r} cannot be started: {what}")

    with ForeignCode(error):
        make = found[plant.name].load()
        simulator: Simulator = make(dict(plant.options), altitude_m)
    return simulator
