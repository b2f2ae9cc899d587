"""Checks of the aircraft of a scenario: their parameters, hardware, laws and simulators."""

from collections.abc import Sequence

from ftc_autopilot.control.config import law_problems
from ftc_autopilot.control.laws import Controller
from gcs.scenario.sections import Found, ScenarioUav
from mavlink_defs.config.models import Problems
from sitl_plant.actuators.config import Servos, servo_problems
from sitl_plant.air.config import Disturbance
from sitl_plant.airframe.config import Aircraft, Uncertainty, true_aircraft
from sitl_plant.airframe.gear import Ground
from sitl_plant.config import truth_problems
from sitl_plant.sensing.config import Navigation, Sensors
from sitl_plant.sensing.observability import navigation_problems, sensor_problems
from sitl_plant.simulators.config import OwnPlant, PlantSection, plant_problems


def uncertainty_problems(
    aircraft: Aircraft, uncertainty: Uncertainty, uavs: Sequence[ScenarioUav]
) -> Found:
    """Yield why there is no true aircraft with an uncertainty, of the scenario's or a UAV's own."""
    try:
        true_aircraft(aircraft, uncertainty)
    except Problems as exc:
        yield from (p._replace(loc=("uncertainty", *p.loc)) for p in exc.problems)
    for i, uav in enumerate(uavs):
        if uav.aircraft is not None:
            try:
                true_aircraft(uav.aircraft, uncertainty)
            except Problems as exc:
                for p in exc.problems:
                    yield ("uavs", i, "aircraft"), f"the uncertainty {p.text}"


def aircraft_law_problems(
    aircraft: Aircraft, controller: Controller, uavs: Sequence[ScenarioUav]
) -> Found:
    """Yield why a law cannot fly the aircraft."""
    if any(uav.aircraft is None for uav in uavs):
        yield from law_problems(controller, aircraft)
    for i, uav in enumerate(uavs):
        if uav.aircraft is not None:
            for loc, text in law_problems(controller, uav.aircraft):
                yield ("uavs", i, "aircraft"), f"{'.'.join(map(str, loc))}: {text}"


def hardware_problems(
    sensors: Sensors,
    navigation: Navigation,
    servos: Servos,
    uavs: Sequence[ScenarioUav],
    step_us: int,
) -> Found:
    """Yield what sensors and servos cannot do at a control period [µs]."""
    cannot = navigation_problems if navigation == "estimated" else sensor_problems
    for loc, text in cannot(sensors, step_us):
        yield ("sensors", *loc), text
    for loc, text in servo_problems(servos, step_us):
        yield ("servos", *loc), text
    for i, uav in enumerate(uavs):
        if uav.servos is not None:
            for loc, text in servo_problems(uav.servos, step_us):
                yield ("uavs", i, "servos", *loc), text


def simulator_problems(
    plant: PlantSection,
    disturbance: Disturbance,
    uncertainty: Uncertainty,
    ground: Ground,
    uavs: Sequence[ScenarioUav],
    step_us: int,
) -> Found:
    """Yield what simulators cannot do at a control period [µs]."""
    yield from plant_problems(plant, step_us)
    for i, uav in enumerate(uavs):
        if uav.plant is not None:
            for loc, text in plant_problems(uav.plant, step_us):
                yield ("uavs", i, *loc), text
    for own in [uav.plant or plant for uav in uavs]:
        if not isinstance(own, OwnPlant):
            yield from truth_problems(own, disturbance, uncertainty, ground)
            return
