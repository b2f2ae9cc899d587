"""Flights of the tube law whose aileron and rudder are coupled: they are planned together.

The aircraft is the Aerosonde with its older coefficients, whose source its file names.
"""

from typing import Any

import numpy as np
import pytest

from ftc_autopilot.control.diagnosis import LOST
from ftc_autopilot.control.laws.tube import parameters
from ftc_lab.design.airframe import airframe_of
from ftc_lab.design.rules import Conditions
from ftc_lab.design.scenario import design_of, plain, tree_of
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import UavSummary
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import scenario_of
from mavlink_defs.constants import AILERON, RUDDER, SURFACES

COUPLED = "aerosonde_first_edition"
REAL = Conditions(servo_lag_s=0.02, servo_rate_deg_s=400.0, gyro_noise_deg_s=0.3)
START_S, AGAIN_S = 20.0, 1.0  # of a fault; after the control check


def fly(aircraft: str = COUPLED, **keys: Any) -> tuple[Recording, UavSummary]:
    tree = plain(tree_of(design_of(airframe_of(aircraft, load_aircraft(aircraft)), "tube", REAL)))
    tree["controller"] |= keys.pop("controller", {})
    scenario = scenario_of(aircraft, tree | keys)
    flight = fly_in_process(scenario)
    return flight, summarise(flight, scenario).uavs[0]


def fault(actuator: str, **what: float) -> list[dict[str, Any]]:
    return [{"uav": 1, "actuator": actuator, "start_s": START_S, **what}]


def sent(flight: Recording, channel: int) -> np.ndarray:
    """Steps after the control check in which a channel was sent."""
    events = flight.signals["events"][round(AGAIN_S / flight.step_us * 1e6) :, 0]
    found: np.ndarray = np.flatnonzero(events >> channel & 1)
    return found


def largest_deg(flight: Recording) -> np.ndarray:
    """Largest errors of roll, pitch and yaw against the filtered reference, after 1 s."""
    errors: np.ndarray = np.degrees(np.abs(flight.error("reference")[1000:, 0, 1:])).max(axis=0)
    return errors


def test_a_coupled_aircraft_flies_as_well_as_another() -> None:
    """With no more than 1.5 times the messages of the Aerosonde without coupling."""
    flight, uav = fly()
    assert flight.loss is None
    assert np.all(largest_deg(flight) < (1.0, 1.0, 2.0))
    assert uav.diagnosis == ()
    assert uav.events <= 1.5 * fly("aerosonde")[1].events


def test_planned_one_after_the_other_it_loses_the_heading(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(parameters, "is_coupled", lambda _: False)
    flight, _ = fly()
    assert flight.loss is not None or largest_deg(flight)[2] > 90.0


def test_both_surfaces_are_sent_at_once_and_others_are_not() -> None:
    flight, _ = fly()
    assert sent(flight, AILERON).size > 10
    np.testing.assert_array_equal(sent(flight, AILERON), sent(flight, RUDDER))
    flight, _ = fly("aerosonde")
    assert not set(sent(flight, AILERON)) >= set(sent(flight, RUDDER))


def test_they_do_not_move_in_one_ratio() -> None:
    """So that what each does can be told apart: neither mode has less than a tenth of the moves."""
    flight, _ = fly()
    held = flight.signals["held"][1000:, 0][:, [AILERON, RUDDER]]
    moves = np.diff(held, axis=0)
    spread = np.linalg.svd(moves[np.abs(moves).any(axis=1)], compute_uv=False)
    assert spread[1] > 0.1 * spread[0]


@pytest.mark.slow
def test_no_healthy_actuator_is_blamed() -> None:
    for seed in range(1, 21):
        flight, uav = fly(seed=seed)
        assert uav.diagnosis == (), seed
        assert np.all(largest_deg(flight) < (1.0, 1.0, 2.0)), seed


@pytest.mark.parametrize("actuator", ["aileron", "rudder"])
def test_a_weak_surface_is_no_lost_one(actuator: str) -> None:
    flight, uav = fly(faults=fault(actuator, effectiveness=0.5))
    assert flight.loss is None
    assert uav.diagnosis == ()
    assert np.all(largest_deg(flight) < (5.0, 1.0, 2.0))


@pytest.mark.parametrize("stuck_deg", [-3.0, 0.0, 3.0])
@pytest.mark.parametrize("actuator", ["aileron", "rudder"])
def test_a_stuck_surface_is_found_and_told_from_the_other(actuator: str, stuck_deg: float) -> None:
    """One surface holds the roll then, and nothing the heading."""
    flight, _ = fly(faults=fault(actuator, stuck_deg=stuck_deg))
    assert flight.loss is None
    lost = flight.signals["phase"][:, 0] == LOST
    assert [name for j, name in enumerate(SURFACES) if lost[:, j].any()] == [actuator]
    found_s = np.argmax(lost[:, SURFACES.index(actuator)]) * flight.step_us / 1e6
    assert START_S < found_s < START_S + 0.5
    roll, pitch, _ = largest_deg(flight)
    assert roll < (14.0 if actuator == "rudder" else 10.0)
    assert pitch < 2.0


def test_by_the_clock_they_are_planned_together_when_both_are_due() -> None:
    trigger = {"mode": "periodic", "period_s": 0.2}
    flight, uav = fly(trigger=trigger, controller={"tube_scale": 0.5})
    assert np.all(largest_deg(flight) < (1.0, 1.0, 2.0))
    assert uav.diagnosis == ()
