"""Designed flights of an aircraft whose thrust depends on the airspeed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ftc_autopilot.common.phases import LOST
from ftc_lab.design.airframe import airframe_of
from ftc_lab.design.rules import Conditions
from ftc_lab.design.scenario import design_of, plain, sections_of, tree_of
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import scenario_of
from mavlink_defs.constants import ACTUATORS, THROTTLE
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.thrust import available_thrust

REAL = Conditions(servo_lag_s=0.02, servo_rate_deg_s=400.0, gyro_noise_deg_s=0.3)
NAME = "aerosonde_propeller"
FULL_THROTTLE = [
    {"start_s": 0.0, "airspeed_m_s": 21.33, "roll_deg": 0.0, "pitch_deg": 4.85, "yaw_deg": 0.0},
    {"start_s": 3.0, "airspeed_m_s": 30.0, "roll_deg": 0.0, "pitch_deg": 2.0, "yaw_deg": 0.0},
    {"start_s": 14.0, "airspeed_m_s": 30.0, "roll_deg": 0.0, "pitch_deg": 14.0, "yaw_deg": 0.0},
    {"start_s": 24.0, "airspeed_m_s": 30.0, "roll_deg": 0.0, "pitch_deg": 2.0, "yaw_deg": 0.0},
]


def with_propulsion(**keys: float) -> Aircraft:
    tree = load_aircraft(NAME).model_dump()
    return Aircraft.model_validate(tree | {"propulsion": tree["propulsion"] | keys})


STRONG = {"lag_s": 0.4, "torque_arm_m": -0.1, "pitch_arm_m": 0.05, "yaw_arm_m": 0.02}
"""Moments of the thrust that take degrees of each surface, and an engine."""


def flown(law: str, aircraft: Aircraft, **keys: Any) -> Recording:
    tree = plain(tree_of(design_of(airframe_of(NAME, aircraft), law, REAL)))
    tree |= {"aircraft": aircraft.model_dump(exclude_none=True), **keys}
    return fly_in_process(scenario_of(Path("designed.yaml"), tree))


def lost(flight: Recording) -> list[str]:
    found = (flight.signals["phase"][:, 0] == LOST).any(axis=0)
    return [name for name, one in zip(ACTUATORS, found, strict=True) if one]


@pytest.mark.parametrize("law", ["surviving", "tube"])
@pytest.mark.parametrize("keys", [{}, STRONG], ids=["source", "strong"])
def test_full_throttle_at_a_high_airspeed_blames_no_engine(
    law: str, keys: dict[str, float]
) -> None:
    """It climbs at 30 m/s, for which its propeller is too weak: it gets slower, and is not lost.

    When it may descend again it becomes as fast as it should be, and no faster.
    """
    aircraft = with_propulsion(**keys)
    flight = flown(law, aircraft, profile=FULL_THROTTLE)
    assert flight.loss is None
    assert lost(flight) == []
    s, record = flight.signals[:, 0], aircraft_record(aircraft)
    assert abs(s["offset"][-1, THROTTLE]) < 1.0
    climbing = slice(18_000, 24_000)
    most = [available_thrust(V, record) for V in s["V"][climbing].tolist()]
    applied = flight.applied[climbing, 0, THROTTLE]
    assert (applied / most).mean() > 0.93
    assert s["V"][climbing].max() < 29.5
    assert s["V"].max() < 30.4
    assert s["V"][-1] == pytest.approx(30.0, abs=0.4)
    errors = np.degrees(np.abs(flight.error("reference")[2000:, 0, 1:]).max(axis=0))
    assert errors.max() < 2.0


@pytest.mark.parametrize("law", ["surviving", "tube"])
@pytest.mark.parametrize("keys", [{}, STRONG], ids=["source", "strong"])
def test_a_weak_throttle_is_made_up_for(law: str, keys: dict[str, float]) -> None:
    fault = {"uav": 1, "actuator": "throttle", "effectiveness": 0.5, "start_s": 10.0}
    flight = flown(law, with_propulsion(**keys), faults=[fault])
    assert flight.loss is None
    assert lost(flight) == []
    errors = np.abs(flight.error("reference")[33_000:, 0])  # after the last step of the airspeed
    assert errors[:, 0].max() < 0.5
    assert np.degrees(errors[:, 1:]).max() < 2.0


@pytest.mark.parametrize("law", ["surviving", "tube"])
@pytest.mark.parametrize("keys", [{}, STRONG], ids=["source", "strong"])
@pytest.mark.parametrize("stuck_deg", [0.0, 3.0])
def test_a_lost_aileron_is_found_and_survived(
    law: str, keys: dict[str, float], stuck_deg: float
) -> None:
    fault = {"uav": 1, "actuator": "aileron", "stuck_deg": stuck_deg, "start_s": 10.0}
    flight = flown(law, with_propulsion(**keys), faults=[fault])
    assert flight.loss is None
    assert lost(flight) == ["aileron"]
    found = flight.time_s[flight.signals["phase"][:, 0, 0] == LOST][0]
    assert found < (11.0 if stuck_deg == 0.0 else 10.25)  # near its command it shows little
    roll = np.degrees(np.abs(flight.error("reference")[1000:, 0, 1]).max())
    assert roll < 6.0


def test_a_design_knows_lag_and_thrust_at_its_airspeed() -> None:
    """The gain of the speed by the engine's lag; guidance by what there is."""
    aircraft = with_propulsion(**STRONG)
    made = sections_of(design_of(airframe_of(NAME, aircraft), "surviving", Conditions()))
    law, guidance = plain(made.controller), plain(made.guidance)
    assert law["c_v"] == pytest.approx(0.3 / 0.4, rel=1e-3)
    flight = airframe_of(NAME, aircraft).flight
    most = available_thrust(24.0, aircraft_record(aircraft))
    assert guidance["acceleration_max_m_s2"] == pytest.approx(
        (most - flight.thrust_n) / 11.0, abs=0.01
    )
    rows = [{"airspeed_m_s": 24.0, "thrust_n": 20.0}, {"airspeed_m_s": 28.0, "thrust_n": 5.0}]
    weak = Aircraft.model_validate(aircraft.model_dump() | {"propulsion": {"thrust": rows}})
    made = sections_of(design_of(airframe_of("weak", weak), "surviving", Conditions()))
    assert 24.0 < plain(made.guidance)["airspeed_max_m_s"] < 28.0
