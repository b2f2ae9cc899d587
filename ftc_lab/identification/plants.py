"""What can be identified, by its name: ``own:aerosonde``, ``jsbsim:c172p``."""

from importlib.metadata import version

from gcs.console.errors import BadInput
from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.simulators import new_simulator
from sitl_plant.simulators.base import Simulator, SimulatorError
from sitl_plant.simulators.config import JsbSimPlant
from sitl_plant.simulators.own import OwnSimulator

_EXPECTED = "expected jsbsim:AIRCRAFT, or own:AIRCRAFT for an aircraft file and our own equations"


def simulator_of(
    plant: str, altitude: float, wing_area: float | None = None
) -> tuple[Simulator, str]:
    """Return the simulator that a name such as ``jsbsim:c172p`` stands for, and its full name.

    Args:
        plant: The name.
        altitude: Where it starts [m].
        wing_area: Reference area in place of the simulator's [m²].

    Raises:
        BadInput: There is none of that kind, or it cannot fly the aircraft.
        ConfigError: Its aircraft cannot be used.
    """
    kind, _, aircraft = plant.partition(":")
    if kind == "own" and aircraft:
        known = load_aircraft(aircraft)
        if wing_area is not None:
            known = known.model_copy(update={"wing_area_m2": wing_area})
        return OwnSimulator(known), plant
    if kind == "jsbsim" and aircraft:
        try:
            patch = {}
            if wing_area is not None:
                patch = {"metrics/wingarea": wing_area, "metrics/wingarea/@unit": "M2"}
            section = JsbSimPlant(kind="jsbsim", aircraft=aircraft, patch=patch)
            simulator = new_simulator(section, altitude)
        except SimulatorError as problem:
            raise BadInput(f"{plant}: {problem}", problem.hint) from problem
        return (
            simulator,
            f"{aircraft} of JSBSim {version('jsbsim')}, thrust at the centre of gravity",
        )
    raise BadInput(
        f"PLANT is {plant!r}, {_EXPECTED}", "as in gcs identify own:aerosonde --cruise 24"
    )
