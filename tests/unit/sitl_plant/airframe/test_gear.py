"""Keys of gear, ground, runway and starts: what is refused, and the message."""

from typing import Any

import pytest
from pydantic import ValidationError

from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario
from mavlink_defs.config.files import problems_of
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.gear import Gear, Ground
from sitl_plant.airframe.standing import new_gear

ON_GROUND = {"north_m": 0.0, "east_m": 0.0, "on_ground": True}


def problem(model: Any, tree: dict[str, Any]) -> str:
    with pytest.raises(ValidationError) as found:
        model.model_validate(tree)
    return "; ".join(map(str, problems_of(model, found.value)))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"main_m": (0.1, 0.2, 0.3)}, "expected main_m and third_m on both sides of the centre"),
        ({"main_m": (-0.1, -0.2, 0.3)}, "main_m: expected the right one, y > 0 m, got -0.2"),
        ({"nose_m": (0.9, 0.0, 0.5)}, "expected nose_m above the ground at rest"),
        ({"third_m": (0.6, 0.0, -0.4)}, "above the ground at rest, by two static deflections"),
        ({"sink_hard_m_s": 3.0, "sink_max_m_s": 2.0}, "expected >= sink_hard_m_s = 3.0 m/s"),
        ({"kind": "skids"}, "kind"),
        ({"launcher": {}}, "speed_m_s"),
    ],
)
def test_gear_that_no_aircraft_stands_on_is_refused(changes: dict[str, Any], text: str) -> None:
    tree = load_aircraft("paper").model_dump()
    assert text in problem(Aircraft, tree | {"gear": tree["gear"] | changes})


def test_without_weight_nothing_stands() -> None:
    tree = load_aircraft("paper").model_dump() | {"gravity_m_s2": 0.0}
    assert "gravity_m_s2: expected > 0 m/s^2 of an aircraft with gear" in problem(Aircraft, tree)


@pytest.mark.parametrize(
    ("initial", "text"),
    [
        ({"altitude_m": 3.0}, "altitude_m: expected nothing of an aircraft that stands"),
        ({"airspeed_m_s": 20.0}, "airspeed_m_s: expected nothing of an aircraft that stands"),
        ({"on_ground": False}, "altitude_m: missing; expected a number in m, or 'on_ground: true'"),
        (
            {"on_ground": False, "altitude_m": 1.0, "airspeed_m_s": 0.0},
            "airspeed_m_s: expected > 0 m/s, or 'on_ground: true', got 0.0",
        ),
    ],
)
def test_a_start_is_on_the_ground_or_in_the_air(
    scenario1: Scenario, initial: dict[str, Any], text: str
) -> None:
    tree = scenario1.model_dump() | {"aircraft": load_aircraft("paper").model_dump()}
    tree["uavs"][0]["initial"] = ON_GROUND | initial
    assert text in problem(Scenario, tree)


def test_an_aircraft_without_gear_cannot_start_on_the_ground(scenario1: Scenario) -> None:
    tree = scenario1.model_dump()
    tree["uavs"][1]["initial"] = ON_GROUND
    expected = "uavs[1].initial.on_ground: the aircraft has no gear to stand on: add `gear`"
    assert expected in problem(Scenario, tree)


@pytest.mark.parametrize(("ground", "least"), [({}, 0.2156), ({"slope_deg": 10.0}, 3.742)])
def test_nobody_starts_in_the_ground(
    scenario1: Scenario, ground: dict[str, Any], least: float
) -> None:
    tree = scenario1.model_dump() | {"aircraft": load_aircraft("paper").model_dump()}
    tree["ground"] = ground
    place = {"north_m": 20.0, "east_m": 0.0, "airspeed_m_s": 40.0}
    tree["uavs"][0]["initial"] = {**place, "altitude_m": least + 0.01}
    Scenario.model_validate(tree)
    tree["uavs"][0]["initial"] = {**place, "altitude_m": least - 0.01}
    expected = f"uavs[0].initial.altitude_m: expected >= {least:.4g} m, above the ground there"
    assert expected in problem(Scenario, tree)


def test_the_ground_of_a_simulator_is_level(scenario1: Scenario) -> None:
    tree = scenario1.model_dump() | {"plant": {"kind": "jsbsim", "aircraft": "c172p"}}
    tree |= {"ground": {"slope_deg": 2.0}, "disturbance": {}, "uncertainty": {}}
    assert "ground: changes the plant's own equations" in problem(Scenario, tree)


def test_limits_follow_from_the_wing_loading() -> None:
    """CS-23.473: 4.4 (W/S)^1/4 ft/s, with 20 lb/ft² 9.30 ft/s, within 7 and 10 ft/s."""
    gear = Gear(kind="tricycle")
    assert gear.sinks(20.0 * 47.88)[0] == pytest.approx(9.305 * 0.3048, rel=1e-3)
    assert gear.sinks(1.0) == pytest.approx((7.0 * 0.3048, 8.4 * 0.3048))
    assert gear.sinks(1e5) == pytest.approx((10.0 * 0.3048, 12.0 * 0.3048))
    assert Gear(kind="belly", sink_max_m_s=1.0).sinks(1e3) == (1.0, 1.0)
    assert Gear(kind="belly", sink_hard_m_s=2.0).sinks(1e3) == pytest.approx((2.0, 2.4))


@pytest.mark.parametrize("kind", ["tricycle", "tailwheel", "belly"])
@pytest.mark.parametrize("name", ["paper", "aerosonde", "c172p", "minisgs", "pc7", "skywalker_x8"])
def test_a_kind_is_enough_for_every_aircraft(name: str, kind: str) -> None:
    tree = load_aircraft(name).model_dump() | {"gear": {"kind": kind}}
    gear = new_gear(Aircraft.model_validate(tree), Ground(), None)
    assert 0.0 < gear["longest_step"] < 0.02
    assert gear["stiffness"][:3].sum() > 0.0
