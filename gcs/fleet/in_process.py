"""A whole scenario in one process: plant and controllers in one compiled loop, no sockets.

The loop calls the same functions as the processes, on the same payloads that would cross the
links, so its events are bit for bit the same as in a lockstep flight over UDP.
"""

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ftc_autopilot.config import parts_of
from ftc_autopilot.control.controllers import (
    Controllers,
    ReferenceSource,
    begin_path,
    new_controllers,
)
from ftc_autopilot.control.plugin_failures import failure_of
from ftc_autopilot.control.reference import profile_record
from ftc_autopilot.control.stepping import (
    broadcast_if_triggered,
    controller_step,
    has_failed,
    hear,
    publish_own_state,
)
from ftc_autopilot.estimation.estimator import estimate
from ftc_autopilot.hot.navigation import estimator_of, write_estimate
from ftc_autopilot.warm_up import PARTS
from gcs.console.errors import BadInput
from gcs.fleet.failsafes import Failsafes
from gcs.fleet.foreign import check_foreign
from gcs.results.figures import FlightSummary
from gcs.results.mission_paths import paths_of
from gcs.results.recording import Ending, Recording, Steps
from gcs.results.summary import summary_of
from gcs.results.tally import Tally
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.framing.codec import SIM_STATE, copy_step
from mavlink_defs.profile import items_to_segments
from mavlink_defs.runtime.foreign import PluginError
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import borrowed, copy_record, copy_values
from sitl_plant.loop.fault_commands import faults_of
from sitl_plant.loop.fleet import (
    ADVANCE,
    PlantState,
    contacts_of,
    fly,
    loss_of,
    navigates,
    new_plant_state,
    observe,
    receive_controls,
)
from sitl_plant.loop.simulators import Outside, flown_by
from sitl_plant.simulators.base import SimulatorError

_CHUNK_STEPS = 2000

OnProgress = Callable[[float, np.ndarray], None]


def fly_in_process(scenario: Scenario, on_progress: OnProgress | None = None) -> Recording:
    """Fly a scenario to its end, or until it is lost, and keep every step in memory.

    Args:
        scenario: The scenario.
        on_progress: Called every 2000 steps with the simulated time [s] and the event counts so
            far, shape (n, 4).
    """
    flight = begin(scenario)
    everything = room_of(scenario, scenario.steps)
    ending = fly_on(scenario, flight, everything.part, on_progress=on_progress)
    return Recording.of(everything.part(0, ending.steps), ending, flight.ids, scenario.step_us)


def fly_in_steps(
    scenario: Scenario, on_steps: Callable[[Steps], None], on_progress: OnProgress | None = None
) -> Ending:
    """Fly a scenario to its end, or until it is lost, in memory that does not grow with time.

    Args:
        scenario: The scenario.
        on_steps: Called with every 2000 steps; their arrays are overwritten afterwards.
        on_progress: As of `fly_in_process`.
    """
    room = room_of(scenario, _CHUNK_STEPS)

    def reused(begin: int, end: int) -> Steps:
        return room.part(0, end - begin)._replace(first=begin)

    return fly_on(scenario, begin(scenario), reused, on_steps=on_steps, on_progress=on_progress)


def fly_and_summarise(scenario: Scenario, on_progress: OnProgress | None = None) -> FlightSummary:
    """Fly a scenario to its end, or until it is lost; return its figures and keep no step.

    The figures equal what `gcs.results.summary.summarise` computes, bit for bit. They take about a
    seventh of the processor time of the flight. `on_progress` is as of `fly_in_process`.
    """
    tally = Tally(scenario)
    return summary_of(tally, fly_in_steps(scenario, tally.add, on_progress), scenario)


def room_of(scenario: Scenario, steps: int) -> Steps:
    """Return room for so many steps of a flight of a scenario."""
    return Steps.room(steps, len(scenario.uavs), estimated=scenario.navigation == "estimated")


class Estimates(NamedTuple):
    """The estimators of n aircraft, and what they have estimated; of none by true states."""

    estimators: np.ndarray  # (n,), dtype ESTIMATOR
    histories: np.ndarray  # (n, imus, entries, TRAVEL), their memory
    measured: np.ndarray  # (n,), dtype SIM_STATE


class InProcessFlight(NamedTuple):
    """What changes in a flight, all of it arrays but the simulators."""

    ids: tuple[int, ...]
    fleet: PlantState
    estimates: Estimates
    controllers: Controllers
    outside: Outside
    sources: np.ndarray
    """Index of each neighbour of each controller, shape (n, n); -1 for none."""


def begin(scenario: Scenario) -> InProcessFlight:
    """Return a flight before its first step, with its faults.

    Raises:
        BadInput: A simulator, or a plug-in, cannot fly it, or it has a foreign autopilot.
    """
    check_foreign(scenario, over_udp=False)
    ids = tuple(uav.id for uav in scenario.uavs)
    configs = [scenario.autopilot_config(uav_id) for uav_id in ids]
    on_path = scenario.mission is not None
    has_gear = any(config.aircraft.gear is not None for config in configs)
    law, navigation = scenario.controller, scenario.navigation
    for part in parts_of(law, navigation, on_path=on_path, has_gear=has_gear):
        PARTS[part]()
    try:
        controllers = new_controllers(configs)
    except PluginError as problem:
        raise BadInput(str(problem)) from problem
    sources = np.full(controllers.edges.shape, -1)
    for i, config in enumerate(configs):
        for d, neighbour in enumerate(config.neighbours):
            sources[i, d] = ids.index(neighbour.id)
            controllers.edges[i, d]["weight"] = neighbour.weight
    plant = scenario.plant_config(speed=None)
    fleet = new_plant_state(plant)
    try:
        outside = Outside(plant, fleet)
    except SimulatorError as problem:
        raise BadInput(str(problem), problem.hint) from problem
    estimators = [estimator_of(config) for config in configs]
    estimates = Estimates(
        np.concatenate([estimator.state for estimator in estimators]),
        np.stack([estimator.history for estimator in estimators]),
        np.zeros(len(ids), SIM_STATE),
    )
    flight = InProcessFlight(ids, fleet, estimates, controllers, outside, sources)
    _brief(scenario, controllers)
    add_faults(scenario, fleet)
    exchange_initial_states(fleet, estimates, controllers, sources, scenario.step_us)
    return flight


def fly_on(
    scenario: Scenario,
    flight: InProcessFlight,
    room: Callable[[int, int], Steps],
    *,
    first: int = 0,
    on_steps: Callable[[Steps], None] | None = None,
    on_progress: OnProgress | None = None,
) -> Ending:
    """Fly from a step on to the end of the scenario, or until the flight is lost.

    Args:
        scenario: The scenario.
        flight: The flight, at that step; it is changed.
        room: Returns the arrays to write from one step up to another.
        first: The step.
        on_steps: As of `fly_in_steps`.
        on_progress: As of `fly_in_process`.
    """
    ids, fleet, estimates, controllers, outside, sources = flight

    def run(step: int, chunk: Steps) -> tuple[int, int]:
        def from_step(flown: int) -> tuple[int, int]:
            rest = chunk.part(flown, chunk.length)[1:]
            at, step_us = step + flown, scenario.step_us
            return run_steps(fleet, estimates, controllers, sources, at, step_us, *rest)

        return flown_by(outside, from_step)

    run(first, room(first, first))  # loads the code
    started, step, loss, failure = time.perf_counter(), first, None, None
    failsafes = Failsafes(scenario, controllers)
    measured = estimates.measured if navigates(fleet) else fleet.uavs["message"]
    while step < scenario.steps and loss is None:
        end = min(step + _CHUNK_STEPS, scenario.steps, failsafes.next_step + 1)
        chunk = room(step, end)
        flown, lost = run(step, chunk)
        step += flown
        if step > failsafes.next_step:
            failsafes.look(step - 1, measured)
        if lost >= 0:
            loss, failure = _why_lost(scenario, flight, lost, step)
        if on_steps is not None:
            on_steps(chunk.part(0, flown))
        if on_progress is not None:
            on_progress(step * scenario.step_us / 1e6, controllers.uavs["controller"]["events"])
    return Ending(
        mode="in_process",
        steps=step,
        repeats=np.zeros((len(ids), N_CHANNELS), np.int64),
        wall_s=time.perf_counter() - started,
        loss=loss,
        plugin_failed=failure is not None,
        contacts=contacts_of(fleet),
    )


def _why_lost(
    scenario: Scenario, flight: InProcessFlight, lost: int, step: int
) -> tuple[str, str | None]:
    """Return why a UAV was lost before a step, and how its plug-in failed, if that was why."""
    time_s, last_s = (k * scenario.step_us / 1e6 for k in (step, step - 1))
    failure = failure_of(flight.controllers.uavs[lost], scenario, last_s)
    if failure is not None:
        return f"UAV {flight.ids[lost]}: {failure}", failure
    why = flight.outside.failures.get(lost) or loss_of(flight.fleet, lost)
    return f"UAV {flight.ids[lost]} was lost at {time_s:.3f} s: {why}", None


def _brief(scenario: Scenario, controllers: Controllers) -> None:
    """Set profile or path, rounded as by transmission."""
    controllers.uavs["guidance"]["active"] = 1
    controllers.uavs["guidance"]["start_step"] = 0
    if scenario.mission is None:
        items = scenario.mission_items()
        for i, uav in enumerate(scenario.uavs):
            limits = scenario.aircraft_of(uav.id).airspeed_limits
            controllers.uavs[i]["profile"] = profile_record(items_to_segments(items, limits))
        controllers.uavs["guidance"]["follows"] = ReferenceSource.PROFILE
    else:
        controllers.paths[:] = paths_of(scenario)
        for guidance in controllers.uavs["guidance"]:
            begin_path(guidance)


def add_faults(scenario: Scenario, fleet: PlantState) -> None:
    """Add the faults of a scenario to its fleet, rounded as by transmission."""
    ids = [uav.id for uav in scenario.uavs]
    for uav_id, fault in scenario.fault_commands():
        i = ids.index(uav_id)
        limits = scenario.aircraft_of(uav_id).fault_limits
        faults_of(fleet, i, limits).set(fault.family, fault.params, time_s=0.0)


@compiled
def exchange_initial_states(
    fleet: PlantState,
    estimates: Estimates,
    controllers: Controllers,
    sources: np.ndarray,
    step_us: int,
) -> None:
    """Give every controller the initial states of its neighbours."""
    for i in range(len(sources)):
        observe(fleet, i, 0, step_us)
        if navigates(fleet):
            _estimate(fleet, estimates, i)
            publish_own_state(controllers.uavs[i], estimates.measured[i])
        else:
            publish_own_state(controllers.uavs[i], fleet.uavs[i]["message"])
    _deliver(controllers, sources, 0)


@compiled
def _estimate(fleet: PlantState, estimates: Estimates, i: int) -> None:
    """Let UAV i estimate its state from what its sensors report now."""
    copy_step(fleet.uavs[i]["message"], fleet.uavs[i]["step"])
    estimate(
        estimates.estimators[i],
        estimates.histories[i],
        fleet.sensing.imus[i],
        fleet.sensing.gps[i],
        fleet.sensing.sites[i]["delivered"] == 1,
        fleet.uavs[i]["step"],
        estimates.measured[i],
    )


@compiled
def run_steps(
    fleet: PlantState,
    estimating: Estimates,
    controllers: Controllers,
    sources: np.ndarray,
    first: int,
    step_us: int,
    states: np.ndarray,
    wind: np.ndarray,
    applied: np.ndarray,
    signals: np.ndarray,
    estimates: np.ndarray,
) -> tuple[int, int]:
    """Fly the steps from `first` on that there is room for; return how many, and the lost UAV.

    Or `ADVANCE`: simulators are to be advanced before the step that comes next can end.
    """
    fleet, controllers, sources = borrowed(fleet), borrowed(controllers), borrowed(sources)
    estimating, estimated = borrowed(estimating), navigates(fleet)
    measured = estimating.measured if estimated else fleet.uavs["message"]
    n = len(sources)
    k, lost = 0, -1
    while k < len(states) and lost < 0:
        if fleet.uavs[0]["outside"]["advanced"] == 0:
            for i in range(n):
                observe(fleet, i, first + k, step_us)
                if estimated:
                    if first + k > 0:  # else it has done so before the neighbours' first messages
                        _estimate(fleet, estimating, i)
                    write_estimate(measured[i], estimates[k, i])
                uav, path = controllers.uavs[i], controllers.paths[i]
                if estimated:
                    report = estimating.estimators[i]["report"]
                    uav["guidance"]["unplaced"] = 1 - report["placed"]
                mask = controller_step(uav, controllers.edges[i], path, measured[i], step_us)
                if mask != 0:
                    receive_controls(fleet, i, uav["actuators"])
                broadcast_if_triggered(uav, first + k, step_us)
                copy_values(states[k, i], fleet.uavs[i]["state"])
                copy_values(wind[k, i], fleet.uavs[i]["air"])
                copy_record(signals[k, i], uav["signals"])
            if first + k > 0:  # before the second step none polls for a second message of the first
                _deliver(controllers, sources, first + k)
        lost = fly(fleet, first + k, step_us)
        if lost == ADVANCE:
            break
        for i in range(n - 1, -1, -1):
            if has_failed(controllers.uavs[i]):
                lost = i
        for i in range(n):
            copy_values(applied[k, i], fleet.uavs[i]["applied"])
        k += 1
    return k, lost


@inlined
def _deliver(controllers: Controllers, sources: np.ndarray, step: int) -> None:
    """Deliver the neighbour messages that were sent in a step."""
    for i in range(sources.shape[0]):
        for d in range(sources.shape[1]):
            j = sources[i, d]
            if j >= 0 and controllers.uavs[j]["last_broadcast"]["step"] == step:
                hear(
                    controllers.uavs[i],
                    controllers.edges[i],
                    d,
                    controllers.uavs[j]["last_broadcast"],
                )
