"""What faults leave of HIL_SENSOR and HIL_GPS."""

import math
from typing import Any

import numpy as np
import pytest

from gcs.scenario.model import load_scenario
from mavlink_defs import dialect
from mavlink_defs.faults.spec import SensorFaultSpec
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.loop.fleet import fault_tables, new_plant_state
from sitl_plant.sensing.sense import sense

STEPS, ONSET_S = 400, 0.25
X_GYRO, X_ACC = dialect.HIL_SENSOR_UPDATED_XGYRO, dialect.HIL_SENSOR_UPDATED_XACC
X_MAG, PRESSURE = dialect.HIL_SENSOR_UPDATED_XMAG, dialect.HIL_SENSOR_UPDATED_ABS_PRESSURE
PITOT = dialect.HIL_SENSOR_UPDATED_DIFF_PRESSURE
PLANT = load_scenario("sensor_faults/pitot_off").plant_config()


def fly(*faults: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return HIL_SENSOR by step and IMU, HIL_GPS by step, and whether it was delivered."""
    fleet = new_plant_state(PLANT)
    sensing = fleet.sensing
    for keys in faults:
        fault = SensorFaultSpec.model_validate({"start_s": ONSET_S, **keys}).command()
        fault_tables(fleet, 0)["sensor"].set([fault], 0.0)
    motion = np.zeros(1, SIM_STATE)[0]
    imus, gps, delivered = [], [], []
    for step in range(STEPS):
        motion["step"], motion["time_usec"] = step, 1000 * step
        motion["velocity"] = 25.0, 0.0, 0.0
        motion["specific_force"] = 0.0, 0.0, -9.81
        delivered.append(sense(sensing, 0, step, motion))
        imus.append(sensing.imus[0].copy())
        gps.append(sensing.gps[0].copy())
    return np.array(imus), np.array(gps), np.array(delivered)


HEALTHY = fly()
AFTER = np.arange(STEPS) > 1000 * ONSET_S


@pytest.mark.parametrize(
    ("sensor", "bit"),
    [
        ("gyro", X_GYRO),
        ("accelerometer", X_ACC),
        ("magnetometer", X_MAG),
        ("barometer", PRESSURE),
        ("airspeed", PITOT),
    ],
)
def test_a_sensor_that_is_off_updates_no_field_and_others_do(sensor: str, bit: int) -> None:
    imus, _, delivered = fly({"sensor": sensor, "failure": "off", "instance": 1})
    healthy = HEALTHY[0]["fields_updated"]
    assert np.any(healthy[AFTER, 0] & bit)
    updated = imus["fields_updated"]
    assert not np.any(updated[AFTER, 0] & bit)
    assert np.array_equal(updated[~AFTER], healthy[~AFTER])
    assert np.array_equal(updated[:, 1], healthy[:, 1])  # the other IMU
    others = {X_GYRO, X_ACC, X_MAG, PRESSURE, PITOT} - {bit}
    for other in others:
        assert np.array_equal(updated[:, 0] & other, healthy[:, 0] & other)
    assert np.array_equal(delivered, HEALTHY[2])


def test_without_gps_no_sample_is_delivered() -> None:
    imus, _, delivered = fly({"sensor": "gps", "failure": "off"})
    assert HEALTHY[2][AFTER].any()
    assert not delivered[AFTER].any()
    assert np.array_equal(imus, HEALTHY[0])


def test_a_bias_of_one_gyro_is_in_its_record_alone() -> None:
    imus, gps, _ = fly({"sensor": "gyro", "instance": 2, "bias_deg_s": 3.0, "axis": "y"})
    added = imus["ygyro"].astype(float) - HEALTHY[0]["ygyro"]
    assert added[AFTER, 1] == pytest.approx(math.radians(3.0), abs=1e-6)
    assert np.all(added[:, 0] == 0.0)
    assert np.array_equal(imus["xgyro"], HEALTHY[0]["xgyro"])
    assert np.array_equal(gps, HEALTHY[1])


def test_a_blocked_pitot_shows_its_last_pressure() -> None:
    imus, _, _ = fly({"sensor": "airspeed", "failure": "stuck"})
    pressure = imus["diff_pressure"][:, 0]
    assert np.all(pressure[AFTER] == pressure[250])
    assert pressure[250] == HEALTHY[0]["diff_pressure"][250, 0]
    assert len(np.unique(HEALTHY[0]["diff_pressure"][AFTER, 0])) > 1


def test_a_gps_off_by_50_m_says_so_in_degrees_and_millimetres() -> None:
    _, gps, delivered = fly({"sensor": "gps", "failure": "wrong"})
    new = AFTER & delivered
    north_m = (gps["lat"] - HEALTHY[1]["lat"])[new] * 1e-7 * math.radians(6371e3)
    assert north_m == pytest.approx(50.0, rel=0.005)
    assert (gps["alt"] - HEALTHY[1]["alt"])[new] == pytest.approx(-50e3)
    assert np.array_equal(gps["vn"], HEALTHY[1]["vn"])
