"""Every bundled aircraft flies missions, circles and ways home within its own limits."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsbsim_aircraft import needs_jsbsim
from vehicle_bench import ACCEPTED, of_type
from vehicle_fleet import ARM, SET_MODE, START, Member, VehicleFleet

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.guidance import aircraft_limits
from ftc_autopilot.guidance.aircraft_limits import HOME, guidance_problems, limits_of
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from gcs.results.recording import Steps
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from mavlink_defs import dialect
from mavlink_defs.config.problems import ConfigError
from mavlink_defs.constants import GUIDED, LOITER, RTL
from mavlink_defs.mission_files import mission_item
from sitl_plant.airframe import aerodynamics, thrust
from sitl_plant.airframe.aircraft import aircraft_record

SCENARIO_1 = Path("scenarios/paper/scenario1.yaml")
AIRCRAFT = sorted(path.stem for path in Path("aircraft").glob("*.yaml"))
SCENARIOS = sorted(path.stem for path in Path("scenarios/airframes").glob("*.yaml"))
SCENARIOS.remove("mixed_mission")  # a formation, whose guidance is given
SCENARIOS.remove("aerosonde_mission")  # a mission, without a profile
SCENARIOS.remove("minisgs_tube")  # flown by our equations it swings until it gives up its thrust
FLOWN_S, SETTLED_S = 60.0, 15.0
HEIGHT_M, SPEED_M_S, BANK_DEG = 20.0, 1.0, 3.0
"""What flying within limits may be off: they are of commands."""


def upload(member: Member) -> None:
    far = place_of(Origin(), 900.0, 300.0, 0.0)[:2], place_of(Origin(), 900.0, 2000.0, 0.0)[:2]
    height = member.vehicle.modes.path.here()[2]
    items = [mission_item(k, 16, (), *place, height) for k, place in enumerate(far, start=1)]
    member.upload([mission_item(0, 16), *items])
    assert member.command(START) == ACCEPTED


def guide(member: Member) -> None:
    north, east = place_of(Origin(), -800.0, 800.0, 0.0)[:2]
    place: Any = (north, east, member.vehicle.modes.path.here()[2])
    assert member.command(SET_MODE, 1.0, GUIDED) == ACCEPTED
    message = dialect.MAVLink_command_int_message(
        member.uav, 1, 6, dialect.MAV_CMD_DO_REPOSITION, 0, 0, -1.0, 1.0, 0.0, 0.0, *place
    )
    assert of_type(member.say(message), "COMMAND_ACK")[0].result == ACCEPTED


def home(member: Member) -> None:
    assert member.command(SET_MODE, 1.0, RTL) == ACCEPTED


def stay(member: Member) -> None:
    assert member.vehicle.modes.mode == LOITER


WAYS = (upload, stay, home, guide)


def all_aircraft() -> Scenario:
    """Return a scenario of each bundled aircraft four times, by a law that any of them takes."""
    uavs: list[dict[str, Any]] = []
    for name in AIRCRAFT:
        initial = {
            "north_m": 0.0,
            "east_m": 0.0,
            "altitude_m": 300.0,
            "airspeed_m_s": limits_of(PathFollowing(), load_aircraft(name)).cruise_m_s,
            "pitch_deg": 3.0,
        }
        for way in WAYS:
            uav = {"id": len(uavs) + 1, "name": f"{name} {way.__name__}", "aircraft": name}
            uavs.append({**uav, "initial": initial})
    tree = scenario_tree(SCENARIO_1) | {"uavs": uavs, "faults": [], "step_us": 2000}
    tree |= {"controller": {"kind": "surviving"}, "network": alone(len(uavs))}
    place = {"north_m": 3000.0, "east_m": 0.0, "height_m": 300.0}
    tree["mission"] = {"items": [{"waypoint": place}]}
    del tree["disturbance"], tree["profile"]  # no airspeed suits all
    return scenario_of(SCENARIO_1, tree)


def alone(count: int) -> dict[str, Any]:
    return {"leader_access": dict.fromkeys(range(1, count + 1), 1.0), "edges": []}


def bundled(name: str, *, own_plant: bool = False) -> Scenario:
    """Return a bundled scenario with the last of its UAVs four times, flown by our equations.

    Or by the plant that it names, which is slower.
    """
    path = Path(f"scenarios/airframes/{name}.yaml")
    tree = scenario_tree(path)
    first = [tree["uavs"][-1]] * len(WAYS)
    uavs = [{**uav, "id": k, "name": f"UAV {k}"} for k, uav in enumerate(first, start=1)]
    for key in ("faults", "formation", *(() if own_plant else ("plant",))):
        tree.pop(key, None)
    airspeed = first[0]["initial"]["airspeed_m_s"]
    tree["profile"] = [{**tree["profile"][0], "airspeed_m_s": airspeed}]
    return scenario_of(path, tree | {"uavs": uavs, "network": alone(len(WAYS))})


def check(scenario: Scenario) -> None:
    """Fly a scenario, UAV by UAV in another way, and look at speed, bank and height."""
    fleet = VehicleFleet(scenario)
    for k, member in enumerate(fleet.members):
        assert member.command(ARM, 1.0) == ACCEPTED
        WAYS[k % len(WAYS)](member)
    states: list[np.ndarray] = []
    fleet.fly(FLOWN_S, lambda steps: states.append(_seen(steps)))
    flown = np.concatenate(states)[round(SETTLED_S / FLOWN_S * sum(map(len, states))) :]
    for k, member in enumerate(fleet.members):
        uav = scenario.uavs[k]
        aircraft, (V, bank, height) = scenario.aircraft_of(uav.id), flown[:, k].T
        assert V.min() >= aircraft.airspeed_min_m_s - SPEED_M_S, uav.name
        assert V.max() <= aircraft.airspeed_max_m_s + SPEED_M_S, uav.name
        assert bank.max() <= scenario.guidance.bank_max_deg + BANK_DEG, uav.name
        assert np.abs(height - uav.initial.altitude_m).max() <= HEIGHT_M, uav.name
        limits = limits_of(scenario.guidance, aircraft)
        path = member.vehicle.modes.path.record
        assert set(path["airspeed"][: path["count"]]) == {limits.cruise_m_s}


def _seen(steps: Steps) -> np.ndarray:
    """Return airspeed [m/s], size of the bank [deg] and height [m], shape (steps, n, 3)."""
    V = np.linalg.norm(steps.states[:, :, 3:6] - steps.wind, axis=2)
    bank = np.degrees(np.abs(steps.states[:, :, 6]))
    return np.stack([V, bank, -steps.states[:, :, 2]], axis=2)


def test_the_paper_s_aircraft_has_the_numbers_that_guidance_was_found_with() -> None:
    inline = load_scenario(SCENARIO_1).aircraft
    assert inline.cruise_m_s is None
    for aircraft in (inline, load_aircraft("paper")):
        assert limits_of(PathFollowing(), aircraft) == HOME


@pytest.mark.parametrize("name", AIRCRAFT)
def test_what_is_given_is_kept_and_what_is_not_is_the_aircraft_s(name: str) -> None:
    aircraft = load_aircraft(name)
    low, high = aircraft.airspeed_min_m_s, aircraft.airspeed_max_m_s
    for least, most in ((None, None), (low + 1.0, None), (None, high - 1.0), (1.0, 500.0)):
        guidance = PathFollowing(airspeed_min_m_s=least, airspeed_max_m_s=most)
        limits = limits_of(guidance, aircraft)
        assert low <= limits.airspeed_min_m_s <= limits.cruise_m_s <= limits.airspeed_max_m_s
        assert limits.airspeed_max_m_s <= high
        assert least is None or limits.airspeed_min_m_s == max(least, low)
        assert most is None or limits.airspeed_max_m_s == min(most, high)
        assert not list(guidance_problems(guidance, aircraft))


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"airspeed_min_m_s": 30.0}, "airspeed_min_m_s: expected <= 24 m/s, the aircraft's airs"),
        ({"airspeed_max_m_s": 13.0}, "airspeed_max_m_s: expected >= 14 m/s, the aircraft's airs"),
        ({"cruise_m_s": 40.0}, r"cruise_m_s: expected \[14, 24\] m/s, the limits of guidance and"),
    ],
)
def test_airspeeds_that_an_aircraft_cannot_have_are_refused_without_a_mission(
    given: dict[str, float], problem: str
) -> None:
    path = Path("scenarios/airframes/skywalker_x8.yaml")
    with pytest.raises(ConfigError, match=problem):
        scenario_of(path, scenario_tree(path) | {"guidance": given})


def test_members_of_a_formation_that_differ_need_one_airspeed() -> None:
    path = Path("scenarios/airframes/mixed_mission.yaml")
    tree = scenario_tree(path)
    del tree["guidance"]
    with pytest.raises(ConfigError, match=r"cruise_m_s: missing; expected one airspeed for all"):
        scenario_of(path, tree)


def test_a_refusal_names_the_vehicle_s_own_range() -> None:
    member = VehicleFleet(load_scenario("scenarios/airframes/skywalker_x8.yaml")).members[0]
    assert member.command(ARM, 1.0) == ACCEPTED
    command = dialect.MAV_CMD_DO_CHANGE_SPEED
    assert member.command(command, 0.0, 18.0) == ACCEPTED
    message = dialect.MAVLink_command_long_message(1, 1, command, 0, 0.0, 40.0, *[0.0] * 5)
    answers = member.say(message)
    assert of_type(answers, "COMMAND_ACK")[0].result != ACCEPTED
    assert "must be 14 to 24 m/s" in "".join(one.text for one in of_type(answers, "STATUSTEXT"))


def test_every_bundled_aircraft_flies_within_its_limits() -> None:
    check(all_aircraft())


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_bundled_scenario_of_an_aircraft_does(name: str) -> None:
    check(bundled(name))


@needs_jsbsim
def test_what_was_designed_for_jsbsim_does_there() -> None:
    check(bundled("minisgs_tube", own_plant=True))


@pytest.mark.parametrize("name", AIRCRAFT)
def test_limits_have_the_same_bits_with_and_without_the_compiler(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    aircraft = load_aircraft(name)
    guidance, record = PathFollowing(), aircraft_record(aircraft)
    plain = limits_of(guidance, aircraft)
    drags = [aircraft_limits._drag(700.0, alpha, record) for alpha in np.linspace(-0.5, 0.5, 99)]
    compiled = [aerodynamics.drag(700.0, alpha, record) for alpha in np.linspace(-0.5, 0.5, 99)]
    assert drags == compiled
    monkeypatch.setattr(aircraft_limits, "_drag", aerodynamics.drag)
    monkeypatch.setattr(aircraft_limits, "_carried_linearly", aerodynamics.carried_linearly)
    monkeypatch.setattr(aircraft_limits, "_available_thrust", thrust.available_thrust)
    assert limits_of(guidance, aircraft) == plain
