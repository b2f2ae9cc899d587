"""What can be identified, by its name: ``own:aerosonde``."""

from gcs.errors import BadInput
from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.simulators.base import Simulator
from sitl_plant.simulators.own import OwnSimulator

_EXPECTED = "expected own:AIRCRAFT, a bundled aircraft or a file flown by our own equations"


def simulator_of(plant: str) -> Simulator:
    """Return the simulator that a name such as ``own:aerosonde`` stands for.

    Raises:
        BadInput: There is none of that kind.
        ConfigError: Its aircraft cannot be used.
    """
    kind, _, aircraft = plant.partition(":")
    if kind == "own" and aircraft:
        return OwnSimulator(load_aircraft(aircraft))
    raise BadInput(
        f"PLANT is {plant!r}, {_EXPECTED}", "as in gcs identify own:aerosonde --cruise 24"
    )
