"""A whole scenario in one process: plant and controllers in one compiled loop, no sockets.

The loop calls the same functions as the processes, on the same payloads that would cross the
links, so its events are bit for bit those of a lockstep flight over UDP.
"""

import time
from collections.abc import Callable

import numpy as np

from ftc_autopilot.control.controller import SIGNALS
from ftc_autopilot.control.controllers import (
    Controllers,
    announce,
    controller_step,
    new_controllers,
    tell_neighbours,
)
from ftc_autopilot.control.reference import profile_record
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.faults import fault_from_params, fault_to_params
from mavlink_defs.profile import items_to_segments, segments_to_items
from mavlink_defs.runtime.jit import compiled
from sitl_plant.actuators import add_fault
from sitl_plant.fleet import PlantState, fly, new_plant_state, observe, receive_controls
from sitl_plant.plant import describe_loss

__all__ = ["fly_in_process"]

_CHUNK_STEPS = 500


def fly_in_process(
    scenario: Scenario, on_progress: Callable[[float, np.ndarray], None] | None = None
) -> Recording:
    """Fly a scenario to its end, or until it is lost.

    Args:
        scenario: The scenario.
        on_progress: Called every 500 steps with the simulated time [s] and the event counts so
            far, shape (n, 4).
    """
    fleet = new_plant_state(scenario.plant_config(speed=None))
    ids = tuple(uav.id for uav in scenario.uavs)
    configs = [scenario.autopilot_config(uav_id) for uav_id in ids]
    controllers = new_controllers(configs)
    sources = np.full(controllers.weights.shape, -1)
    for i, config in enumerate(configs):
        for d, neighbour in enumerate(config.neighbours):
            sources[i, d] = ids.index(neighbour.id)
            controllers.weights[i, d] = neighbour.weight
    _brief(scenario, fleet, controllers, ids)

    steps = scenario.steps
    states = np.zeros((steps, len(ids), 12))
    wind = np.zeros((steps, len(ids), 3))
    applied = np.zeros((steps, len(ids), N_CHANNELS))
    signals = np.zeros((steps, len(ids)), SIGNALS)
    exchange_initial_states(fleet, controllers, sources, scenario.step_us)
    begin = time.perf_counter()
    step, loss = 0, None
    while step < steps and loss is None:
        last = min(step + _CHUNK_STEPS, steps)
        step, lost = run_steps(
            fleet,
            controllers,
            sources,
            step,
            last,
            scenario.step_us,
            states,
            wind,
            applied,
            signals,
        )
        if lost >= 0:
            t = step * scenario.step_us / 1e6
            why = describe_loss(fleet.states[lost], fleet.air[lost, :3])
            loss = f"UAV {ids[lost]} was lost at {t:.3f} s: {why}"
        if on_progress is not None:
            on_progress(step * scenario.step_us / 1e6, controllers.states["events"])
    return Recording(
        mode="in_process",
        step_us=scenario.step_us,
        uav_ids=ids,
        states=states[:step],
        wind=wind[:step],
        applied=applied[:step],
        signals=signals[:step],
        repeats=np.zeros((len(ids), N_CHANNELS), np.int64),
        wall_s=time.perf_counter() - begin,
        loss=loss,
    )


def _brief(
    scenario: Scenario, fleet: PlantState, controllers: Controllers, ids: tuple[int, ...]
) -> None:
    """Set profile and faults, rounded as by transmission."""
    aircraft = scenario.aircraft
    items = segments_to_items(scenario.segments(), 0, 0)
    controllers.profiles[:] = profile_record(items_to_segments(items, aircraft.airspeed_limits))
    controllers.guidance["active"] = 1
    controllers.guidance["auto"] = 1
    controllers.guidance["start_step"] = 0
    for uav_id, fault in scenario.fault_commands():
        received = fault_from_params(fault_to_params(fault), aircraft.fault_limits)
        add_fault(fleet.faults[ids.index(uav_id)], received, now_s=0.0)


@compiled
def exchange_initial_states(
    fleet: PlantState, controllers: Controllers, sources: np.ndarray, step_us: int
) -> None:
    for i in range(len(sources)):
        observe(fleet, i, 0, step_us)
        announce(controllers, i, fleet.messages[i])
    _deliver(controllers, sources, 0)


@compiled
def run_steps(
    fleet: PlantState,
    controllers: Controllers,
    sources: np.ndarray,
    step: int,
    last: int,
    step_us: int,
    states: np.ndarray,
    wind: np.ndarray,
    applied: np.ndarray,
    signals: np.ndarray,
) -> tuple[int, int]:
    n = len(sources)
    lost = -1
    while step < last and lost < 0:
        for i in range(n):
            observe(fleet, i, step, step_us)
            mask = controller_step(controllers, i, fleet.messages[i], step_us)
            if mask != 0:
                receive_controls(fleet, i, controllers.actuators[i])
            tell_neighbours(controllers, i, step, step_us)
            states[step, i] = fleet.states[i]
            wind[step, i] = fleet.air[i, :3]
            signals[step, i] = controllers.signals[i]
        _deliver(controllers, sources, step)
        lost = fly(fleet, step, step_us)
        applied[step] = fleet.applied
        step += 1
    return step, lost


@compiled
def _deliver(controllers: Controllers, sources: np.ndarray, step: int) -> None:
    """Deliver the neighbour messages that were sent in a step."""
    for i in range(sources.shape[0]):
        for d in range(sources.shape[1]):
            j = sources[i, d]
            if j >= 0 and controllers.told[j]["step"] == step:
                controllers.neighbour_states[i, d] = controllers.told[j]
