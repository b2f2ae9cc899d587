"""One aircraft on the ground, by the plant's own equations."""

from typing import Any

import numpy as np

from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.airframe.config import Aircraft
from sitl_plant.config import InitialState, PlantConfig, PlantUav
from sitl_plant.loop.fleet import PlantState, fly, loss_of, new_plant_state
from sitl_plant.loop.period import time_s

AT_REST = {"north_m": 0.0, "east_m": 0.0, "on_ground": True}


def aircraft_with(name: str = "c172p", *, vacuum: bool = False, **gear: Any) -> Aircraft:
    """A bundled aircraft whose gear has other values, or none with `kind=None`."""
    tree = load_aircraft(name).model_dump()
    has_gear = gear.get("kind", "") is not None
    tree["gear"] = {**tree["gear"], "launcher": None, **gear} if has_gear else None
    if vacuum:
        tree["air_density_kg_m3"] = 1e-12
    return Aircraft.model_validate(tree)


def standing(
    aircraft: Aircraft, step_us: int = 1000, yaw_deg: float = 0.0, **sections: Any
) -> PlantState:
    """A plant with one aircraft that stands at the origin."""
    initial = InitialState.model_validate({**AT_REST, "yaw_deg": yaw_deg})
    uav = PlantUav(id=1, initial=initial, aircraft=aircraft)
    keys = {"bind": "127.0.0.1:1", "uavs": (uav,), "step_us": step_us, **sections}
    return new_plant_state(PlantConfig.model_validate(keys))


def thrown(plant: PlantState, *, above: float = 0.0, **state: float) -> None:
    """Lift the aircraft off the ground, and set entries of its state by name."""
    names = ("north", "east", "down", *"uvw", "roll", "pitch", "yaw", *"pqr")
    uav = plant.uavs[0]
    uav["state"][2] -= above
    for name, value in state.items():
        uav["state"][names.index(name)] = value
    uav["gear"]["touching"], uav["gear"]["load"], uav["gear"]["flew"] = 0, 0.0, 1


def flown(plant: PlantState, step_us: int, seconds: float) -> tuple[np.ndarray, str | None]:
    """Fly on from step 0; return the states after each step, and why the aircraft was lost."""
    states = []
    for k in range(round(seconds * 1e6 / step_us)):
        plant.uavs[0]["message"]["actuator_time_usec"] = 0
        lost = fly(plant, k, step_us)
        states.append(plant.uavs[0]["state"].copy())
        if lost >= 0:
            return np.array(states), f"{loss_of(plant, lost)} at {time_s(k, step_us):g} s"
    return np.array(states), None


def energy(x: np.ndarray, aircraft: np.void) -> float:
    """Kinetic energy, and what the height adds [J]."""
    v, omega = x[3:6], x[9:12]
    moving = aircraft["m"] * (v @ v) + omega @ aircraft["J"] @ omega
    return float(0.5 * moving - aircraft["m"] * aircraft["g"] * x[2])


def mirrored(x: np.ndarray) -> np.ndarray:
    """A state seen in the mirror between left and right."""
    signs = np.ones(12)
    signs[[1, 4, 6, 8, 9, 11]] = -1.0
    return x * signs
