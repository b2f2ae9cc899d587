"""What sensors report: HIL_SENSOR and HIL_GPS of a true motion."""

from typing import Any

import numpy as np
import pytest

from ftc_autopilot.common.geography import place_of
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing.codec import SIM_STATE
from mavlink_defs.origin import Origin
from sitl_plant.config import PlantConfig
from sitl_plant.loop.fleet import new_sensing
from sitl_plant.sensing.geomagnetism import magnetic_field
from sitl_plant.sensing.sense import Sensing, sense

STEP_US = 1000
IMU = 0b111111  # accelerometer and gyro
MAGNETOMETER = 0b111 << 6
BAROMETER = (
    dialect.HIL_SENSOR_UPDATED_ABS_PRESSURE
    | dialect.HIL_SENSOR_UPDATED_PRESSURE_ALT
    | dialect.HIL_SENSOR_UPDATED_TEMPERATURE
)
PITOT = dialect.HIL_SENSOR_UPDATED_DIFF_PRESSURE


def config_of(scenario1: Scenario, navigation: dict[str, Any], **more: Any) -> PlantConfig:
    plant = scenario1.plant_config().model_dump()
    tree = plant | {"step_us": STEP_US, "sensors": {"navigation": navigation}} | more
    return PlantConfig.model_validate(tree)


def motion_at(step: int, **fields: Any) -> np.void:
    """An aircraft that stands still, but for some fields of its true motion."""
    message = np.zeros(1, SIM_STATE)[0]
    message["time_usec"], message["step"] = step * STEP_US, step
    for name, value in fields.items():
        message[name] = value
    return message


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """From body to NED axes, of elementary rotations."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def reports(sensing: Sensing, names: tuple[str, ...], steps: int, i: int = 0) -> np.ndarray:
    """Fields of the IMUs of an aircraft that stands still, shape (steps, IMUs, fields)."""
    rows = []
    for step in range(steps):
        sense(sensing, i, step, motion_at(step))
        rows.append([[float(imu[name]) for name in names] for imu in sensing.imus[i]])
    return np.array(rows)


GYRO = ("xgyro", "ygyro", "zgyro")


@pytest.mark.parametrize("seed", range(5))
def test_ideal_sensors_report_the_truth_in_the_units_of_the_messages(
    scenario1: Scenario, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    origin = Origin(latitude_deg=47.0, longitude_deg=8.0, altitude_m=400.0)
    config = config_of(scenario1, {"grade": "ideal"}, origin=origin.model_dump())
    sensing = new_sensing(config)
    angles = rng.uniform([-3.0, -1.4, -3.0], [3.0, 1.4, 3.0])
    velocity, wind = rng.normal([40.0, 0.0, 0.0], 3.0), rng.normal(0.0, 3.0, 3)
    true = {
        "rates": rng.normal(0.0, 1.0, 3),
        "specific_force": rng.normal(0.0, 20.0, 3),
        "attitude": angles,
        "position": rng.uniform([-5000.0, -5000.0, -2000.0], [5000.0, 5000.0, 0.0]),
        "velocity": velocity,
        "wind": wind,
    }
    assert sense(sensing, 0, 0, motion_at(0, **true))
    near = 1e-6  # what float32 holds
    for imu in sensing.imus[0]:
        assert [imu[name] for name in GYRO] == pytest.approx(true["rates"], rel=near)
        force = [imu["xacc"], imu["yacc"], imu["zacc"]]
        assert force == pytest.approx(true["specific_force"], rel=near)
    first, gps = sensing.imus[0, 0], sensing.gps[0]
    field = rotation(*angles).T @ magnetic_field(origin)
    assert [first["xmag"], first["ymag"], first["zmag"]] == pytest.approx(field, abs=near)
    altitude = 400.0 - true["position"][2]
    pressure = 1013.25 * (1.0 - 2.25577e-5 * altitude) ** 5.25588
    assert first["abs_pressure"] == pytest.approx(pressure, abs=0.01)
    assert first["pressure_alt"] == pytest.approx(altitude, rel=near)
    assert first["temperature"] == pytest.approx(15.0 - 0.0065 * altitude, abs=1e-4)
    ahead, rho = (velocity - wind)[0], config.uavs[0].aircraft.air_density_kg_m3
    assert first["diff_pressure"] == pytest.approx(rho / 2.0 * ahead**2 / 100.0, rel=near)
    place, over_ground = place_of(origin, *true["position"]), rotation(*angles) @ velocity
    assert (gps["lat"], gps["lon"], gps["alt"]) == (place.latitude, place.longitude, place.altitude)
    assert [gps["vn"], gps["ve"], gps["vd"]] == pytest.approx(100.0 * over_ground, abs=0.51)
    assert gps["vel"] == pytest.approx(100.0 * np.hypot(*over_ground[:2]), abs=0.51)
    course = np.degrees(np.arctan2(over_ground[1], over_ground[0])) % 360.0
    assert gps["cog"] == pytest.approx(100.0 * course, abs=0.51)
    assert (gps["fix_type"], gps["eph"], gps["epv"]) == (3, 80, 120)
    assert gps["satellites_visible"] == 14


def test_each_sensor_reports_at_its_rate_and_says_so(scenario1: Scenario) -> None:
    sensing = new_sensing(config_of(scenario1, {}))
    for step in range(60):
        sense(sensing, 0, step, motion_at(step))
        expected = IMU
        expected |= MAGNETOMETER | PITOT if step % 10 == 0 else 0
        expected |= BAROMETER if step % 20 == 0 else 0
        assert sensing.imus[0]["fields_updated"].tolist() == [expected, IMU]
        assert sensing.imus[0]["time_usec"].tolist() == [step * STEP_US] * 2
    assert sensing.imus[0]["id"].tolist() == [0, 1]
    assert not sensing.imus[0, 1]["abs_pressure"]


def test_gnss_is_delivered_late_with_the_time_of_its_measurement(scenario1: Scenario) -> None:
    config = config_of(scenario1, {"grade": "ideal"})
    sensing, delivered = new_sensing(config), []
    for step in range(600):
        position = (0.04 * step, 0.0, -100.0)  # 40 m/s to the north
        if sense(sensing, 0, step, motion_at(step, position=position)):
            delivered.append(step)
            measured = int(sensing.gps[0]["time_usec"]) // STEP_US
            assert measured == max(step - 200, 0)
            place = place_of(config.origin, 0.04 * measured, 0.0, -100.0)
            assert sensing.gps[0]["lat"] == place.latitude
    assert delivered == [0, 300, 400, 500]


def test_an_aircraft_held_at_its_start_has_a_fix(scenario1: Scenario) -> None:
    """It has been there for longer than the receiver's latency."""
    config = config_of(scenario1, {"grade": "ideal"})
    sensing = new_sensing(config)
    position = (3000.0, 20.0, -100.0)
    for _ in range(3):
        assert sense(sensing, 0, 0, motion_at(0, position=position))
    place = place_of(config.origin, *position)
    gps = sensing.gps[0]
    assert (gps["time_usec"], gps["lat"], gps["lon"]) == (0, place.latitude, place.longitude)


def test_a_latency_is_exact(scenario1: Scenario) -> None:
    gyro = {"latency_s": 0.004, "rate_hz": 500.0}
    sensing = new_sensing(config_of(scenario1, {"grade": "ideal", "gyro": gyro}))
    for step in range(40):
        sense(sensing, 0, step, motion_at(step, rates=(float(step), 0.0, 0.0)))
        fresh = bool(sensing.imus[0, 1]["fields_updated"] & dialect.HIL_SENSOR_UPDATED_XGYRO)
        assert fresh == (step == 0 or (step > 4 and step % 2 == 0))
        assert sensing.imus[0, 1]["xgyro"] == max((step - 4) // 2 * 2, 0)


def test_range_and_resolution(scenario1: Scenario) -> None:
    gyro = {"range_deg_s": 100.0, "resolution_deg_s": 0.25}
    sensing = new_sensing(config_of(scenario1, {"grade": "ideal", "gyro": gyro}))
    sense(sensing, 0, 0, motion_at(0, rates=np.radians([150.0, -150.0, 10.3])))
    found = np.degrees([float(sensing.imus[0, 0][name]) for name in GYRO])
    assert found == pytest.approx([100.0, -100.0, 10.25], abs=1e-4)


def test_a_pitot_tube_shows_forward_flow_only(scenario1: Scenario) -> None:
    sensing = new_sensing(config_of(scenario1, {"grade": "ideal"}))
    sense(sensing, 0, 0, motion_at(0, velocity=(5.0, 30.0, 0.0), wind=(10.0, 0.0, 0.0)))
    assert sensing.imus[0, 0]["diff_pressure"] == 0.0


def test_a_second_call_for_a_step_makes_the_same(scenario1: Scenario) -> None:
    config = config_of(scenario1, {})
    once, again = new_sensing(config), new_sensing(config)
    for step in range(410):
        delivered = sense(once, 0, step, motion_at(step))
        assert [sense(again, 0, step, motion_at(step)) for _ in range(3)] == [delivered] * 3
        assert np.array_equal(once.imus, again.imus)
    assert once.gps[0] == again.gps[0]


def test_the_same_seed_makes_the_same_bits_and_another_seed_others(scenario1: Scenario) -> None:
    config = config_of(scenario1, {})
    first, same = (reports(new_sensing(config), GYRO, 50) for _ in range(2))
    assert np.array_equal(first, same)
    other = reports(new_sensing(config_of(scenario1, {}, seed=config.seed + 1)), GYRO, 50)
    assert not np.array_equal(first, other)


def test_aircraft_imus_and_axes_have_errors_of_their_own(scenario1: Scenario) -> None:
    fine = {"resolution_deg_s": 0.0}
    sensing, steps = new_sensing(config_of(scenario1, {"gyro": fine})), 2000
    both = [reports(sensing, GYRO, steps, i).reshape(steps, -1) for i in (0, 1)]
    noise = np.hstack(both)
    correlation = np.corrcoef(noise.T)[np.triu_indices(noise.shape[1], 1)]
    assert np.abs(correlation).max() < 4.5 / np.sqrt(steps)
    biases = sensing.sensors["bias"][:2, :, :3].ravel()
    drawn = biases[biases != 0.0]
    assert len(set(drawn.tolist())) == len(drawn)


def test_errors_do_not_depend_on_the_rest_of_the_fleet(scenario1: Scenario) -> None:
    config = config_of(scenario1, {})
    alone = config.model_copy(update={"uavs": config.uavs[1:2]})
    found = reports(new_sensing(alone), GYRO, 20)
    assert np.array_equal(found, reports(new_sensing(config), GYRO, 20, 1))


def test_what_is_not_fitted_reports_nothing(scenario1: Scenario) -> None:
    none = {name: {"fitted": False} for name in ("magnetometer", "barometer", "pitot", "gnss")}
    sensing = new_sensing(config_of(scenario1, {"imus": 3, **none}))
    for step in range(410):
        assert not sense(sensing, 0, step, motion_at(step))
        assert sensing.imus[0]["fields_updated"].tolist() == [IMU] * 3
