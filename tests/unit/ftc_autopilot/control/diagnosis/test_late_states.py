"""States that are not consecutive, or commands that act late, blame no healthy actuator.

And what does fail is found all the same, once the filters have settled.
"""

from typing import Any

import pytest
from late_flights import When, at_once, fly_late, late, now_and_then, scenario_of_one, stopped

from gcs.scenario.model import Scenario

FLEETS = {
    "surviving": ("paper/scenario1", "surviving"),
    "tube": ("paper/scenario1", "realistic", "tube"),
    "small": ("airframes/aerosonde_designed",),
    "small, tube": ("airframes/aerosonde_designed_tube",),
}

DISTURBED: dict[str, tuple[When, When]] = {
    "stopped at the start": (stopped(0.0005, 1.0), at_once),
    "stopped for long": (stopped(1.2, 3.0), at_once),
    "kept waiting from the start": (now_and_then(0.0, 1.0, (0.01, 0.06), 1), at_once),
    "the plant catches up, at the start": (
        now_and_then(0.0, 1.0, (0.02, 0.15), 3),
        late(0.0, 1.0, 0.1, 3),
    ),
    "the plant catches up": (now_and_then(1.0, 1.0, (0.02, 0.15), 4), late(1.0, 1.0, 0.1, 4)),
    "commands come late in the check": (at_once, late(0.25, 1.0, 0.12, 5)),
    "all comes a little late": (late(0.1, 1.4, 0.03, 7), late(0.1, 1.4, 0.03, 8)),
}


def scenario_for(fleet: str, seconds: float, *faults: dict[str, Any]) -> Scenario:
    return scenario_of_one(*FLEETS[fleet], duration_s=seconds, faults=list(faults))


@pytest.mark.parametrize("fleet", FLEETS)
@pytest.mark.parametrize("disturbed", DISTURBED)
def test_what_comes_late_blames_nobody(fleet: str, disturbed: str) -> None:
    states_at, commands_at = DISTURBED[disturbed]
    seconds = 4.8 if "long" in disturbed else 2.4
    assert fly_late(scenario_for(fleet, seconds), states_at, commands_at) == []


STALL_END_S = 1.6
STALLS: dict[str, When] = {
    "stopped": stopped(1.0, 0.6),
    "kept waiting": now_and_then(1.0, 0.6, (0.02, 0.15), 9),
}


@pytest.mark.parametrize(("fleet", "stall"), [("surviving", "stopped"), ("tube", "kept waiting")])
@pytest.mark.parametrize(
    ("actuator", "start_s"), [("aileron", 1.3), ("elevator", 2.0), ("rudder", 1.7)]
)
def test_what_fails_is_found(fleet: str, stall: str, actuator: str, start_s: float) -> None:
    """In the stall, while the filters settle, and later."""
    stuck_deg = {"aileron": 5.0, "elevator": -4.0, "rudder": 15.0}[actuator]
    fault = {"uav": 1, "actuator": actuator, "stuck_deg": stuck_deg, "start_s": start_s}
    lost = fly_late(scenario_for(fleet, 3.6, fault), STALLS[stall])
    assert {name for _, name in lost} == {actuator}
    print(fleet, stall, actuator, lost)
    assert lost[0][0] < max(start_s, STALL_END_S) + 1.5


@pytest.mark.parametrize("actuator", ["aileron", "elevator", "rudder", "throttle"])
def test_who_never_sees_two_states_in_succession_finds_what_fails(actuator: str) -> None:
    stuck = {"aileron": 5.0, "elevator": -4.0, "rudder": 15.0, "throttle": 0.0}[actuator]
    unit = "n" if actuator == "throttle" else "deg"
    fault = {"uav": 1, "actuator": actuator, f"stuck_{unit}": stuck, "start_s": 1.5}
    seen = now_and_then(0.5, 4.0, (0.02, 0.06), 10)
    lost = fly_late(scenario_for("surviving", 4.5, fault), seen)
    assert {name for _, name in lost} == {actuator}


@pytest.mark.parametrize("fleet", FLEETS)
def test_who_never_does_blames_nobody(fleet: str) -> None:
    seen, acts = now_and_then(0.5, 4.0, (0.02, 0.06), 11), late(0.5, 4.0, 0.03, 12)
    assert fly_late(scenario_for(fleet, 4.5), seen, acts) == []
