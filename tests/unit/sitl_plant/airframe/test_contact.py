"""An aircraft on the ground: rest, drops, bounces, rolling, sliding, falling over."""

import math
from typing import Any

import numpy as np
import pytest
from ground_flights import aircraft_with, energy, flown, mirrored, standing, thrown

from sitl_plant.airframe.aerodynamics import aerodynamics, force, moment
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.contact import POINTS
from sitl_plant.airframe.gear import Ground, Runway
from sitl_plant.airframe.standing import contact_facts
from sitl_plant.config import InitialState, PlantConfig, PlantUav
from sitl_plant.loop.fleet import PlantState, fly, new_plant_state, observe

NAMES = ("paper", "c172p", "pa28", "aerosonde", "skywalker_x8")
STEPS_US = (1000, 4000, 10_000)


def facts(plant: PlantState) -> dict[str, Any]:
    found = contact_facts(plant.uavs[0]["gear"])
    assert found is not None
    return found


# at rest


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("step_us", STEPS_US)
def test_at_rest_the_ground_carries_the_weight_and_nothing_moves(name: str, step_us: int) -> None:
    plant = standing(aircraft_with(name), step_us, yaw_deg=50.0)
    before = plant.uavs[0]["state"].copy()
    observe(plant, 0, 0, step_us)
    felt = np.linalg.norm(plant.uavs[0]["message"]["specific_force"])
    assert felt == pytest.approx(plant.uavs[0]["aircraft"]["g"], rel=1e-6)
    states, loss = flown(plant, step_us, 10.0)
    assert loss is None
    assert np.abs(states - before).max() < 1e-9
    assert facts(plant) == {
        "outcome": "on the ground",
        "reason": None,
        "touchdowns": 0,
        "worst": None,
        "off_centre_m": None,
    }


def test_all_wheels_give_way_as_far_as_the_file_says() -> None:
    plant = standing(aircraft_with("pa28", static_deflection_m=0.07))
    gear, down = plant.uavs[0]["gear"], plant.uavs[0]["state"][2]
    pitch = plant.uavs[0]["state"][7]
    for x, _, z in gear["at"][:3]:
        depth = down - math.sin(pitch) * x + math.cos(pitch) * z
        assert depth == pytest.approx(0.07, rel=0.1)


def test_a_tail_wheel_stands_with_its_nose_up() -> None:
    nose_up = standing(aircraft_with("paper", kind="tailwheel", third_m=None))
    assert math.degrees(nose_up.uavs[0]["state"][7]) == pytest.approx(8.7, abs=0.5)


@pytest.mark.parametrize("name", NAMES)
def test_without_any_airspeed_there_are_no_forces_of_the_air(name: str) -> None:
    aircraft = aircraft_record(aircraft_with(name))
    for v in ((0.0, 0.0, 0.0), (1e-200, -1e-170, 1e-300), (-1e-12, 0.0, 0.0)):
        air = aerodynamics(v, (3.0, -2.0, 1.0), aircraft)
        numbers = [*force(air, (0.3, -0.3, 0.3)), *moment(air, (0.3, -0.3, 0.3))]
        assert np.abs(numbers).max() < 1e-6


@pytest.mark.parametrize("wind", [{"north_m_s": 6.0}, {"east_m_s": -6.0}, {"north_m_s": -6.0}])
def test_brakes_hold_an_aircraft_in_any_wind(wind: dict[str, float]) -> None:
    plant = standing(aircraft_with("c172p"), wind={"steady": wind})
    plant.uavs[0]["gear"]["brake"] = 1.0
    states, loss = flown(plant, 1000, 12.0)
    assert loss is None
    assert np.abs(states[-1, :2]).max() < 0.02
    assert np.abs(states[-1] - states[-3000])[:9].max() < 1e-5


# drops and bounces


@pytest.mark.parametrize("step_us", STEPS_US)
def test_a_drop_follows_the_closed_form_of_a_spring_and_damper(step_us: int) -> None:
    """Heave alone: the wheels' springs and dampers have no moment about the centre of gravity."""
    deflection, ratio, sink = 0.05, 0.4, 0.2
    changed = {"static_deflection_m": deflection, "damping_ratio": ratio}
    level = {"main_m": (-0.4, 1.0, 1.3), "third_m": (1.2, 0.0, 1.3)}
    plant = standing(aircraft_with("c172p", vacuum=True, **changed, **level), step_us)
    rest = plant.uavs[0]["state"][2]
    above = 0.8 * deflection  # a step in which it first touches is less exact
    thrown(plant, above=above, w=sink)
    states, loss = flown(plant, step_us, 1.0)
    assert loss is None
    omega = math.sqrt(plant.uavs[0]["aircraft"]["g"] / deflection)
    damped = omega * math.sqrt(1.0 - ratio**2)
    t = (np.arange(len(states)) + 1) * step_us / 1e6
    sine = (sink - ratio * omega * above) / damped
    wave = sine * np.sin(damped * t) - above * np.cos(damped * t)
    exact = rest + np.exp(-ratio * omega * t) * wave
    assert np.abs(states[:, 2] - exact).max() < 2e-5 * deflection


@pytest.mark.parametrize("name", NAMES)
def test_a_drop_comes_to_rest_at_long_steps(name: str) -> None:
    plant = standing(aircraft_with(name, vacuum=True), 10_000)
    rest = plant.uavs[0]["state"].copy()
    thrown(plant, above=0.02, w=0.5, p=0.2, roll=0.02)
    states, loss = flown(plant, 10_000, 4.0)
    assert loss is None
    assert np.abs(states[-1, 3:6]).max() < 2e-2
    assert np.abs(states[-1] - rest)[[2, 6, 7]].max() < 1e-2


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("step_us", [1000, 10_000])
def test_no_bounce_gives_energy(seed: int, step_us: int) -> None:
    """Of an aircraft that is off the ground, after each touch it has less than before."""
    random = np.random.default_rng(seed)
    name = NAMES[seed % len(NAMES)]
    made = aircraft_with(name, vacuum=True, damping_ratio=0.05, sink_max_m_s=50.0, kind="belly")
    plant = standing(made, step_us)
    u, v, p, q, r = random.uniform((0, -2, -1, -0.5, -1), (20, 2, 1, 0.5, 1))
    roll, pitch = random.uniform((-0.2, -0.1), (0.2, 0.15))
    span = made.wing_span_m
    thrown(plant, above=0.3 * span, u=u, v=v, w=2.0, p=p, q=q, r=r, roll=roll, pitch=pitch)
    states, _ = flown(plant, step_us, 3.0)
    aircraft, at = plant.uavs[0]["aircraft"], plant.uavs[0]["gear"]["at"]
    energies = [energy(x, aircraft) for x in states if _lowest(x, at) > 0.0]
    assert plant.uavs[0]["gear"]["touchdowns"] > 0
    assert len(energies) > 10
    assert np.diff(energies).max() < 1e-6 * energies[0]


def _lowest(x: np.ndarray, at: np.ndarray) -> float:
    """Height of the lowest point [m]."""
    roll, pitch = x[6:8]
    normal = (-math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll))
    return float(-(x[2] + (at @ normal).max()))


@pytest.mark.parametrize(
    ("sink", "outcome"), [(1.0, "landed"), (2.6, "landed hard"), (4.0, "crashed")]
)
def test_the_sink_rate_decides_about_a_landing(sink: float, outcome: str) -> None:
    plant = standing(aircraft_with("c172p", vacuum=True, sink_hard_m_s=2.5, sink_max_m_s=3.5))
    thrown(plant, above=0.2, w=sink, u=20.0, pitch=0.0)  # 7 cm above the nose wheel's touch
    _, loss = flown(plant, 1000, 2.0)
    found = facts(plant)
    assert found["outcome"] == outcome
    assert found["worst"]["sink_m_s"] == pytest.approx(math.sqrt(sink**2 + 1.4), abs=0.05)
    assert found["worst"]["speed_m_s"] == pytest.approx(20.0, abs=0.2)
    text = "it hit the ground, sinking at 4.2 m/s (limit 3.5 m/s)"
    assert (loss or "").startswith(text) == (outcome == "crashed")
    assert found["reason"] == (text if outcome == "crashed" else None)


def test_bank_and_drift_have_limits_if_the_file_says_so() -> None:
    for limit, state, text in (
        ({"bank_max_deg": 8.0}, {"roll": -0.2}, "it hit the ground, banked by 11.5 deg"),
        ({"drift_max_m_s": 2.0}, {"v": 3.0}, "it hit the ground, drifting at 3.0 m/s"),
    ):
        plant = standing(aircraft_with("pa28", vacuum=True, sink_max_m_s=9.0, **limit))
        thrown(plant, above=0.6, u=30.0, w=0.2, **state)
        _, loss = flown(plant, 1000, 2.0)
        assert (loss or "").startswith(text)


# rolling and sliding


@pytest.mark.parametrize("brake", [0.0, 0.5, 1.0])
def test_friction_decelerates_the_roll(brake: float) -> None:
    """The weight shifts to the nose wheel, which has no brake."""
    level = {"third_m": (1.322, 0.0, 1.077), "static_deflection_m": 0.01}
    plant = standing(aircraft_with("pa28", vacuum=True, **level))
    gear, g = plant.uavs[0]["gear"], plant.uavs[0]["aircraft"]["g"]
    gear["brake"] = brake
    thrown(plant, u=25.0)
    states, loss = flown(plant, 1000, 3.0)
    assert loss is None
    height, ahead, behind = -states[-1, 2], gear["at"][2, 0], -gear["at"][0, 0]
    nose, main = gear["rolling"][2], gear["rolling"][0] + brake * gear["braked"][0]
    share = (ahead - height * nose) / (ahead + behind + height * (main - nose))
    expected = g * (main * share + nose * (1.0 - share))
    assert (states[1499, 3] - states[2499, 3]) / 1.0 == pytest.approx(expected, rel=0.01)


def test_what_has_braked_to_a_stop_stays_there() -> None:
    plant = standing(aircraft_with("pa28", vacuum=True))
    plant.uavs[0]["gear"]["brake"] = 1.0
    thrown(plant, u=2.0)
    states, loss = flown(plant, 1000, 4.0)
    assert loss is None
    assert states[-1, 0] > 0.4
    assert states[-1, 0] > 0.8 * states[:, 0].max()  # but for springs that swing back
    assert np.abs(states[-1, 3:6]).max() < 0.02


def test_a_wheel_holds_its_track_across_the_wind_and_ice_does_not() -> None:
    moved = []
    for grip in (0.6, 0.002):
        made = aircraft_with("pa28", side_friction=grip, rolling_friction=grip)
        plant = standing(made, wind={"steady": {"east_m_s": 8.0}})
        states, loss = flown(plant, 1000, 5.0)
        assert loss is None
        moved.append(float(np.abs(states[-1, 1])))
    assert moved[0] < 0.05
    assert moved[1] > 0.5


@pytest.mark.parametrize("kind", ["tricycle", "tailwheel"])
def test_the_steered_wheel_turns_the_aircraft_as_the_rudder_does(kind: str) -> None:
    plant = standing(aircraft_with("paper", vacuum=True, kind=kind, third_m=None))
    thrown(plant, u=5.0)
    plant.uavs[0]["controls"][2] = 0.5 * plant.uavs[0]["aircraft"]["stops"][2, 1]
    states, loss = flown(plant, 1000, 0.5)
    assert loss is None
    assert states[-1, 8] < -0.1  # to the left, as a positive rudder turns it in the air


def test_the_slope_pulls_downhill_and_brakes_hold() -> None:
    made, slope = aircraft_with("pa28", vacuum=True), math.radians(4.0)
    ground = {"slope_deg": 4.0, "uphill_deg": 30.0}
    rolling = standing(made, yaw_deg=30.0, ground=ground)
    states, _ = flown(rolling, 1000, 4.0)
    pulled = rolling.uavs[0]["aircraft"]["g"] * (math.sin(slope) - 0.03 * math.cos(slope))
    assert states[2999, 3] - states[3999, 3] == pytest.approx(pulled, rel=0.01)
    held = standing(made, yaw_deg=75.0, ground=ground)
    held.uavs[0]["gear"]["brake"] = 1.0
    states, _ = flown(held, 1000, 12.0)
    assert np.abs(states[-1, 3:6]).max() < 1e-6
    assert np.abs(states[-1, :2] - states[0, :2]).max() < 0.1


def test_left_and_right_are_alike() -> None:
    courses = []
    for side in (False, True):
        plant = standing(aircraft_with("paper", vacuum=True))
        thrown(plant, above=0.1, u=12.0, v=0.7, w=0.5, roll=0.1, yaw=0.2, p=0.3, r=-0.4)
        if side:
            plant.uavs[0]["state"][:] = mirrored(plant.uavs[0]["state"])
        plant.uavs[0]["controls"][2] = -0.1 if side else 0.1
        courses.append(flown(plant, 1000, 2.0)[0])
    assert np.abs(mirrored(courses[0]) - courses[1]).max() < 1e-9


# falling over


@pytest.mark.parametrize(
    ("name", "gear", "state", "text"),
    [
        (
            "pa28",
            {"side_friction": 1.5},
            {"u": 20.0, "v": 6.0},
            "it hit the ground with its wing tip",
        ),
        (
            "paper",
            {"kind": "tailwheel", "third_m": None, "brake_friction": 1.5},
            {"u": 15.0},
            "it hit the ground with its nose",
        ),
        (
            "paper",
            {"sink_max_m_s": 9.0},
            {"above": 1.5, "roll": 3.1, "u": 20.0},
            "it hit the ground with its wing tip",
        ),
        (
            "aerosonde",
            {"sink_max_m_s": 9.0},
            {"above": 2.0, "roll": 3.14, "u": 20.0},
            "it hit the ground with its body",
        ),
        ("c172p", {}, {"above": 0.1, "w": 50.0}, "it hit the ground, sinking at"),
    ],
)
@pytest.mark.parametrize("step_us", [1000, 10_000])
def test_what_falls_over_has_crashed(
    name: str, gear: dict[str, Any], state: dict[str, float], text: str, step_us: int
) -> None:
    plant = standing(aircraft_with(name, vacuum=True, **gear), step_us)
    plant.uavs[0]["gear"]["brake"] = float("brake_friction" in gear)
    thrown(plant, **state)
    _, loss = flown(plant, step_us, 3.0)
    assert (loss or "").startswith(text), loss
    assert facts(plant)["outcome"] == "crashed"


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("step_us", [1000, 100_000])
def test_whatever_hits_the_ground_stays_finite(name: str, step_us: int) -> None:
    for roll, pitch in ((0.0, 0.0), (math.pi, 0.0), (1.57, 0.1), (0.3, 1.5), (0.0, -1.5)):
        for state in ({"w": 50.0}, {"u": -30.0, "w": 5.0}, {"v": 40.0}, {"p": 20.0, "r": 20.0}):
            plant = standing(aircraft_with(name), step_us)
            thrown(plant, roll=roll, pitch=pitch, **state)
            states, _ = flown(plant, step_us, 0.5)
            assert np.isfinite(states[:-1]).all()


# starts, runways, the air


def test_a_launcher_holds_until_thrust_is_commanded_and_throws() -> None:
    launcher = {"speed_m_s": 20.0, "pitch_deg": 15.0, "length_m": 4.0, "height_m": 2.0}
    plant = standing(aircraft_with("aerosonde", launcher=launcher), yaw_deg=90.0)
    uav = plant.uavs[0]
    uav["controls"][3] = 0.4 * uav["aircraft"]["thrust_limit"]
    states, _ = flown(plant, 1000, 0.3)
    assert np.ptp(states, axis=0).max() == 0.0
    assert facts(plant)["outcome"] == "on the launcher"
    observe(plant, 0, 300, 1000)
    assert np.linalg.norm(uav["message"]["specific_force"]) == pytest.approx(uav["aircraft"]["g"])
    uav["controls"][3] = 0.6 * uav["aircraft"]["thrust_limit"]
    states, _ = flown(plant, 1000, 0.4)
    observe(plant, 0, 700, 1000)
    lifted, climbed = states[-1, 1] / math.cos(math.radians(15.0)), -states[-1, 2] - 2.0
    assert lifted == pytest.approx(4.0, rel=0.01)
    assert climbed == pytest.approx(4.0 * math.sin(math.radians(15.0)), rel=0.01)
    assert states[-1, 3] == pytest.approx(20.0, rel=0.01)
    assert uav["gear"]["launch_s"] == -1.0
    states, loss = flown(plant, 1000, 0.5)
    assert loss is None
    assert facts(plant)["outcome"] == "in the air"


def test_who_leaves_the_runway_has_left_it() -> None:
    for yaw_deg, outcome in ((0.0, "on the ground"), (20.0, "off the runway")):
        runway = {"heading_deg": 0.0, "length_m": 100.0, "width_m": 10.0, "north_m": -20.0}
        plant = standing(aircraft_with("pa28", vacuum=True), yaw_deg=yaw_deg, runway=runway)
        thrown(plant, u=10.0)
        flown(plant, 1000, 2.0)
        plant.uavs[0]["gear"]["flew"] = 0
        found = facts(plant)
        assert found["outcome"] == outcome
        assert found["off_centre_m"] == pytest.approx(
            abs(plant.uavs[0]["state"][1]), rel=1e-6, abs=1e-6
        )


def test_places_on_a_runway() -> None:
    runway = Runway(north_m=100.0, east_m=50.0, heading_deg=90.0, length_m=300.0, width_m=20.0)
    along, across = runway.along_and_across(95.0, 150.0)
    assert (float(along), float(across)) == pytest.approx((100.0, 5.0))
    assert runway.holds(95.0, 150.0)
    for north, east in ((100.0, 49.0), (100.0, 351.0), (111.0, 150.0), (89.0, 150.0)):
        assert not runway.holds(north, east)
    assert Ground(slope_deg=3.0, uphill_deg=90.0).altitude_m(70.0, 100.0) == pytest.approx(
        5.2408, rel=1e-4
    )


def test_in_the_air_gear_changes_no_bit() -> None:
    ends = []
    for kind in ("tricycle", None):
        initial = InitialState(north_m=0.0, east_m=0.0, altitude_m=200.0, airspeed_m_s=50.0)
        uav = PlantUav(id=1, initial=initial, aircraft=aircraft_with("c172p", kind=kind))
        plant = new_plant_state(PlantConfig(bind="127.0.0.1:1", uavs=(uav,)))
        plant.uavs[0]["controls"][:] = 0.1, -0.05, 0.02, 900.0
        for k in range(500):
            observe(plant, 0, k, 1000)
            fly(plant, k, 1000)
        ends.append((plant.uavs[0]["state"].tobytes(), plant.uavs[0]["message"].tobytes()))
    assert ends[0] == ends[1]


def test_the_points_are_named() -> None:
    assert len(POINTS) == len(standing(aircraft_with("paper")).uavs[0]["gear"]["at"])
