"""Flights that differ in late faults only share what comes before: most of their time."""

from copy import deepcopy

from gcs.fleet.in_process import InProcessFlight, add_faults, begin, fly_in_process, fly_on, room_of
from gcs.results.recording import Recording, Steps
from gcs.scenario.model import Scenario

SHARED_S = 18.9
"""Most fault files begin at 19 s."""


def fly_sharing_the_start(scenario: Scenario) -> Recording:
    """As `fly_in_process`, bit for bit."""
    if min(fault.start_s for fault in scenario.faults) < SHARED_S:
        return fly_in_process(scenario)
    first = round(SHARED_S * 1e6 / scenario.step_us)
    steps = room_of(scenario, scenario.steps)
    common = scenario.model_copy(update={"faults": (), "name": "shared", "description": ""})
    flown, before = _flown(common, first)
    for ours, theirs in zip(steps.part(0, first)[1:], before[1:], strict=True):
        ours[...] = theirs
    flight = deepcopy(flown)
    add_faults(scenario, flight.fleet)
    ending = fly_on(scenario, flight, steps.part, first=first)
    return Recording.of(steps.part(0, ending.steps), ending, flight.ids, scenario.step_us)


def _flown(scenario: Scenario, steps: int) -> tuple[InProcessFlight, Steps]:
    """Fly a scenario up to a step, once."""
    key = scenario.model_dump_json()
    if key not in _FLOWN:
        part = scenario.model_copy(update={"duration_s": steps * scenario.step_us / 1e6})
        flight, room = begin(part), room_of(part, steps)
        assert fly_on(part, flight, room.part).steps == steps
        _FLOWN[key] = flight, room
    return _FLOWN[key]


_FLOWN: dict[str, tuple[InProcessFlight, Steps]] = {}
