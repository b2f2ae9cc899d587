"""The flare near the ground: what is a touchdown, and how far the wings may bank."""

import math

import numpy as np
import pytest
from steps import on_path, situation_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.guidance.aircraft_limits import limits_of
from ftc_autopilot.guidance.laws import guidance_record
from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_autopilot.guidance.legs import Leg
from ftc_autopilot.guidance.path import path_record
from ftc_autopilot.guidance.runway import RunwayParameters, figures_of, runway_record
from ftc_autopilot.guidance.runway_phases import advance, bank_near_ground, nose_for
from ftc_autopilot.guidance.runway_state import FLARE, ROLL_OUT, RUNWAY_STATE
from gcs.scenario.aircraft_file import load_aircraft
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.airframe.aircraft import aircraft_record

CESSNA = load_aircraft("c172p")
RECORD = aircraft_record(CESSNA)
GUIDANCE = PathFollowing(**limits_of(PathFollowing(), CESSNA)._asdict())
LIMITS = guidance_record(GUIDANCE)["common"]
OMEGA = 1.0
FIGURES = figures_of(RunwayParameters(), GUIDANCE, CESSNA, OMEGA)
assert FIGURES is not None
RUNWAY = runway_record(FIGURES)
PATH = path_record([Leg(0.0, 0.0, 0.0, 0.0, math.inf, 0.0, 0.0, 36.67, 1)], 1)
PATH["landing"], PATH["around"] = 300.0, 500.0


def flaring(height: float, sink: float, alpha: float, push_g: float = 0.0) -> Situation:
    """Level wings at 37 m/s, pushed up by the air and by so much more."""
    measured = np.zeros(1, SIM_STATE)[0]
    measured["attitude"] = 0.0, alpha, 0.0
    measured["velocity"] = 37.0 * math.cos(alpha), 0.0, 37.0 * math.sin(alpha)
    by_air = motion_of(measured, RECORD).air.F[2] / RECORD["m"]
    measured["specific_force"] = 0.0, 0.0, by_air - push_g * RECORD["g"]
    place, velocity = (0.0, 0.0, -height), (37.0, 0.0, sink)
    now = situation_of(motion_of(measured, RECORD), place, velocity, velocity)
    return on_path(now, PATH, 0.0)._replace(bandwidth=OMEGA)


def state_in_the_flare() -> np.void:
    state: np.void = np.zeros(1, RUNWAY_STATE)[0]
    state["phase"] = FLARE
    return state


@pytest.mark.parametrize(
    ("alpha_deg", "push_g", "phase"),
    [(6.0, 0.2, FLARE), (6.0, 0.6, ROLL_OUT), (2.0, 0.2, FLARE), (2.0, 0.9, ROLL_OUT)],
)
def test_ground_effect_and_a_gust_are_no_touchdown(
    alpha_deg: float, push_g: float, phase: int
) -> None:
    """Near the ground a wing carries up to a fifth more than in free air."""
    state, now = state_in_the_flare(), flaring(0.7, 0.1, math.radians(alpha_deg), push_g)
    ground_effect = 0.2 * float(-now.motion.air.F[2]) / (RECORD["m"] * RECORD["g"])
    felt = now.motion.specific_force[2] - ground_effect * RECORD["g"]
    motion = now.motion._replace(specific_force=(0.0, 0.0, felt))
    advance(now._replace(motion=motion), PATH, RECORD, LIMITS, RUNWAY, state)
    assert state["phase"] == phase


@pytest.mark.parametrize(
    ("height", "sink", "bank_deg"), [(8.5, 1.9, 29.6), (5.0, 1.25, 10.6), (1.0, 0.5, 2.5)]
)
def test_the_bank_is_limited_by_the_height_that_the_flare_leaves(
    height: float, sink: float, bank_deg: float
) -> None:
    """In 3 s the flare, of 5.2 s, loses 2.3 s of its sink, and gusts of 23 m lose 1.4 m."""
    roll = bank_near_ground(
        1.0, flaring(height, sink, 0.05), PATH, LIMITS, RUNWAY, state_in_the_flare()
    )
    assert math.degrees(roll) == pytest.approx(bank_deg, abs=0.3)


@pytest.mark.parametrize(("sink", "phase"), [(0.0, ROLL_OUT), (0.1, ROLL_OUT), (-0.2, FLARE)])
def test_it_has_touched_down_when_it_neither_sinks_nor_rises(sink: float, phase: int) -> None:
    state, now = state_in_the_flare(), flaring(0.2, sink, 0.05)
    for _ in range(200):
        advance(now, PATH, RECORD, LIMITS, RUNWAY, state)
    assert state["phase"] == phase


@pytest.mark.parametrize("wheels", [0.0, 1.0])
def test_wheels_turn_to_the_runway_and_a_belly_does_not(wheels: float) -> None:
    figures = RUNWAY.copy()
    figures["wheels"] = wheels
    nose = nose_for(flaring(0.2, 0.3, 0.05), PATH, figures, state_in_the_flare())
    assert (nose == 0.0) if wheels else math.isnan(nose)
