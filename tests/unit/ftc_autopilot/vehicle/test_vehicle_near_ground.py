"""Commands in take-off and landing of an aircraft that flies: none of them brings it down."""

import math
from typing import Any

import pytest
from flying_bench import FlyingBench
from vehicle_bench import ACCEPTED, ARM

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.guidance.runway_state import (
    AROUND,
    CLIMBING,
    FLARE,
    ROLL_OUT,
    STANDING,
    STOPPED,
)
from mavlink_defs import dialect
from mavlink_defs.constants import FORCE_DISARM, LOITER, RTL
from sitl_plant.air.turbulence import dryden
from sitl_plant.airframe.standing import contact_facts

SET_MODE = dialect.MAV_CMD_DO_SET_MODE
ON_FINAL: dict[str, Any] = {
    "uavs.0.initial": {"north_m": -900.0, "east_m": 0.0, "altitude_m": 15.0, "airspeed_m_s": 36.0},
    "mission.items": [
        {"waypoint": {"north_m": -800.0, "east_m": 0.0, "height_m": 15.0}},
        {"land": {"north_m": 0.0, "east_m": 0.0}},
    ],
}
IN_THE_AIR: dict[str, Any] = {
    "uavs.0.initial": {
        "north_m": 200.0,
        "east_m": 300.0,
        "altitude_m": 90.0,
        "yaw_deg": 60.0,
        "airspeed_m_s": 40.0,
    },
    "mission.items": [
        {"waypoint": {"north_m": 900.0, "east_m": 1500.0, "height_m": 90.0}},
        {"waypoint": {"north_m": 900.0, "east_m": 3500.0, "height_m": 90.0}},
    ],
}
PLACE = tuple(degrees * 1e-7 for degrees in place_of(Origin(), 300.0, -200.0, 0.0)[:2])


def on_final() -> FlyingBench:
    return FlyingBench("runway/circuit", ON_FINAL)


@pytest.mark.parametrize("mode", [LOITER, RTL])
def test_another_mode_after_lift_off_is_flown_at_the_height_of_the_take_off(mode: int) -> None:
    """It turned at the height that it had, and a wing tip hit the ground."""
    bench = FlyingBench("runway/circuit", {})
    bench.fly_to(CLIMBING)
    assert bench.command(SET_MODE, 1.0, mode) == ACCEPTED
    bench.fly_on(40.0)
    assert bench.loss is None
    assert abs(bench.height - 60.0) < 1.0


@pytest.mark.parametrize(
    ("place", "wind"), [((), (3.0, 2.0)), ((), (-3.0, 1.0)), ((math.nan,) * 4 + PLACE, (0.0, 4.0))]
)
def test_who_is_to_land_from_anywhere_lands(
    place: tuple[float, ...], wind: tuple[float, float]
) -> None:
    """On the runway from either end, or at a place that is commanded, into the wind."""
    steady = {"north_m_s": wind[0], "east_m_s": wind[1]}
    bench = FlyingBench("runway/circuit", {**IN_THE_AIR, "wind": {"steady": steady}})
    bench.fly_on(5.0)
    assert bench.command(dialect.MAV_CMD_NAV_LAND, *place) == ACCEPTED
    bench.fly_to(STOPPED)
    facts = contact_facts(bench.plant["gear"])
    assert facts is not None
    assert bench.loss is None
    assert abs(facts["worst"]["sink_m_s"]) < 1.0
    north, east, *_ = bench.plant["state"]
    if place:
        assert abs(north - 300.0) < 3.0
        assert -700.0 < east < -200.0
    else:
        assert bench.outcome == "landed"
        assert -150.0 < north < 450.0
        assert abs(east) < 3.0


def test_another_mode_in_the_flare_is_a_go_around() -> None:
    """It circled a metre above the ground."""
    bench = on_final()
    bench.fly_to(FLARE, lambda: bench.height < 0.5)
    assert bench.command(SET_MODE, 1.0, LOITER) == ACCEPTED
    bench.fly_to(AROUND)
    bench.fly_on(40.0)
    assert bench.loss is None
    assert abs(bench.height - 15.0) < 1.0


def test_a_roll_out_follows_the_runway_whatever_is_flown_next() -> None:
    """It followed the circle of LOITER, as far as it rolled."""
    bench = on_final()
    bench.fly_to(ROLL_OUT)
    assert bench.command(SET_MODE, 1.0, LOITER) == ACCEPTED
    bench.fly_on(20.0)
    assert bench.outcome == "landed"
    assert abs(bench.plant["state"][1]) < 1.0


def test_who_has_come_to_the_ground_disarmed_stands_there_when_it_is_armed() -> None:
    """It took itself for an aircraft in its flare, and flew on the ground."""
    bench = on_final()
    bench.fly_to(FLARE, lambda: bench.height < 1.0)
    assert bench.command(ARM, 0.0, FORCE_DISARM) == ACCEPTED
    bench.fly_on(60.0, lambda: bool(bench.plant["gear"]["load"] and bench.plant["state"][3] < 0.1))
    assert bench.command(SET_MODE, 1.0, LOITER) == ACCEPTED
    assert bench.command(ARM, 1.0) == ACCEPTED
    bench.fly_on(1.0)
    assert bench.runway["phase"] == STANDING


@pytest.mark.parametrize("seed", range(1, 9))
def test_a_gust_in_the_flare_is_no_touchdown(seed: int) -> None:
    """It took one for the ground, cut the thrust and lowered the nose in the air."""
    gusts = dryden("light", 0.0).model_dump()
    changes = {
        "uavs.0.initial": {"north_m": -800.0, "east_m": 0.0, "altitude_m": 9.0, "airspeed_m_s": 20},
        "mission.items": [
            {"waypoint": {"north_m": -750.0, "east_m": 0.0, "height_m": 9.0}},
            {"land": {"north_m": 0.0, "east_m": 0.0}},
        ],
        "wind": {"steady": {"north_m_s": -4.0}, "turbulence": gusts},
        "faults": [],
        "seed": seed,
    }
    bench = FlyingBench("runway/engine_lost", changes)
    bench.fly_to(ROLL_OUT)
    assert bench.plant["gear"]["touchdowns"] > 0
