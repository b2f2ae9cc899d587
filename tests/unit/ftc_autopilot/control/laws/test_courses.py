"""Every law along a given course of motions, against recorded numbers."""

import math
from typing import Any

import pytest
from courses import SERVOS, Course, Pilot, fly_along, motion_at, neighbours_at, plant_of
from plain_faults import actuator_fault, add_fault

from ftc_autopilot.control.laws.backstepping import Backstepping
from ftc_autopilot.control.laws.pid import Pid
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.laws.surviving import Surviving
from ftc_autopilot.control.laws.tube import Tube
from ftc_autopilot.control.pairing import is_coupled
from ftc_autopilot.control.triggers.periodic import Periodic
from ftc_autopilot.control.triggers.static import Consequence, PerChannel
from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from mavlink_defs.faults.fault import Fault


def along_course(
    course: Course, pilot: Pilot, seconds: float, swing: float = 1.0, every: int = 5
) -> None:
    """Make steps, noting signals and the law's memory now and then."""
    steps = round(seconds / pilot.dt)
    for k in range(steps):
        t = k * pilot.dt
        neighbours_at(t, pilot.nominal, pilot.edges["known"])
        command = (43.0 if t < 0.3 * seconds else 46.0, 0.2, 0.05, 3.1 if t < 0.2 else -3.1)
        signals = pilot.step(motion_at(t, pilot.nominal, swing), command)
        if k in (0, 2) or (k + 1) % (steps // every) == 0:
            course.note(signals)
            course.note(pilot.state[pilot.law], "law.")
            course.note(pilot.state["trigger"], "trigger.")
    course.check()


LAWS: dict[str, tuple[Any, Any]] = {
    "proposed": (Proposed(omega_d_limit_deg_s=200.0, phi_v0=0.1, g_v0=0.2), PerChannel()),
    "backstepping": (Backstepping(), PerChannel()),
    "pid": (Pid(), PerChannel()),
    "surviving": (Surviving(), PerChannel()),
    "tube": (Tube(), Consequence()),
    "tube_by_clock": (Tube(), Periodic(period_s=0.02)),
}


@pytest.mark.parametrize("name", LAWS)
def test_a_law_along_a_course(name: str, scenario1: Scenario) -> None:
    law, trigger = LAWS[name]
    pilot = Pilot(law.with_servos(SERVOS), trigger, scenario1.aircraft, 0.004)
    along_course(Course(name), pilot, 0.8 if "tube" in name else 1.2)


FOREVER = {"return_confirm_s": 1e9, "trial_least_s": 1e9, "loss_start_s": 1e9}
"""Of the diagnosis: what is lost stays so, and nothing else is."""
LOSSES: dict[str, tuple[dict[int, float], dict[str, Any]]] = {
    "no_aileron": ({AILERON: 0.05}, {}),
    "no_rudder": ({RUDDER: 0.2}, {}),
    "neither": ({AILERON: -0.05, RUDDER: 0.3}, {}),
    "no_elevator": ({ELEVATOR: -0.04}, {"pitch_error_limit_deg": 0.0}),
    "no_elevator_yet": ({ELEVATOR: -0.04}, {"pitch_error_limit_deg": 60.0}),
    "no_thrust": ({ELEVATOR: -0.04, THROTTLE: 300.0}, {"pitch_error_limit_deg": 0.0}),
    "all_reported": (dict.fromkeys(range(4), 0.1), {"reconfigure": False}),
}


@pytest.mark.parametrize("name", LOSSES)
def test_the_surviving_law_without_an_actuator(name: str, scenario1: Scenario) -> None:
    stuck, parameters = LOSSES[name]
    law = Surviving.model_validate(parameters | {"diagnosis": FOREVER, "alpha_limit_deg": 6.0})
    pilot = Pilot(law.with_servos(SERVOS), PerChannel(), scenario1.aircraft, 0.01)
    for c, position in stuck.items():
        actuator = pilot.state["surviving"]["diagnosis"]["actuators"][c]
        actuator["lost"], actuator["stuck"] = 1, position
    pilot.state["surviving"]["rudder_mean"] = 0.6  # at its stop for long
    along_course(Course(f"surviving_{name}"), pilot, 1.0)


TUBES: dict[str, tuple[dict[str, Any], Any, tuple[Fault, ...]]] = {
    "healthy": ({}, Consequence(), ()),
    "clock": ({"tube_scale": 0.5}, Periodic(period_s=0.04, rudder_period_s=0.2), ()),
    "wide": ({"tube_scale": 3.0, "dwell_s": 0.1, "gain_s": 0.1}, Consequence(), ()),
    "no_rudder": ({}, Consequence(), (actuator_fault(RUDDER, 0.0, 20.0, 0.0, 0.3, math.inf),)),
    "no_aileron": (
        {"fallback_s": 0.2}, Consequence(), (actuator_fault(AILERON, 0.0, 2.0, 0.0, 0.3, 0.6),),
    ),
    "only_reported": (
        {"survive": False}, Consequence(), (actuator_fault(ELEVATOR, 0.0, -1.0, 0.0, 0.3, 0.5),),
    ),
    "crowded": (
        {
            "event_rate_limit": 3.0, "event_rate_cooldown_s": 0.1,
            "tube_scale": 0.1, "dwell_s": 0.0,
        }, Consequence(), (),
    ),
    "rescue": ({"fallback_error_deg": 2.0, "fallback_s": 0.1}, Consequence(), ()),
    "swinging": (
        {"adapt": False}, Consequence(), (actuator_fault(AILERON, 1.0, 4.0, 3.0, 0.1, math.inf),),
    ),
    "weak": (
        {"adaptation_memory_s": 0.5, "adaptation_prior": 1e-3},
        Consequence(),
        (actuator_fault(ELEVATOR, 0.8, 0.0, 0.0, 0.0, math.inf),),
    ),
    "late_clock": (
        {}, Periodic(period_s=0.02), (actuator_fault(RUDDER, 0.0, 9.0, 0.0, 0.2, math.inf),),
    ),
}  # fmt: skip


COUPLED: dict[str, tuple[Any, tuple[Fault, ...]]] = {
    "healthy": (Consequence(), ()),
    "clock": (Periodic(period_s=0.06, rudder_period_s=0.09), ()),
    "no_rudder": (Consequence(), (actuator_fault(RUDDER, 0.0, 20.0, 0.0, 0.3, math.inf),)),
}


def fly_tube(
    name: str, law: Tube, trigger: Any, faults: tuple[Fault, ...], scenario: Scenario
) -> None:
    plant = plant_of(scenario)
    for fault in faults:
        add_fault(plant.uavs[0]["faults"], fault, now_s=0.0)
    pilot = Pilot(law.with_servos(SERVOS), trigger, scenario.aircraft, 0.004)
    fly_along(Course(f"tube_{name}"), pilot, plant, 1.0)


@pytest.mark.parametrize("name", TUBES)
def test_the_tube_law_in_flight(name: str, scenario1: Scenario) -> None:
    parameters, trigger, faults = TUBES[name]
    fly_tube(name, Tube.model_validate(parameters), trigger, faults, scenario1)


@pytest.mark.parametrize("name", COUPLED)
def test_the_tube_law_with_aileron_and_rudder_together(name: str, scenario1: Scenario) -> None:
    """The aileron yaws three times as much: relative gain 0.67."""
    trigger, faults = COUPLED[name]
    tree = scenario1.model_dump(exclude_none=True)
    tree["aircraft"]["coefficients"]["cn_da"] *= 3.0
    scenario = Scenario.model_validate(tree)
    assert is_coupled(scenario.aircraft)
    fly_tube(f"coupled_{name}", Tube(), trigger, faults, scenario)
