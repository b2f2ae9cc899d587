"""PX4's parameters of an aircraft: what PX4 takes, and what follows from the aircraft."""

import pytest

from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.foreign.px4.parameters import px4_parameters
from sitl_plant.sensing.config import NavigationSensors

RANGES = {  # of PX4's parameter reference
    "FW_AIRSPD_": (0.5, 80.0), "FW_PSP_OFF": (-90.0, 90.0), "FW_THR_": (0.0, 1.0),
    "FW_R_LIM": (35.0, 65.0), "FW_P_LIM_MAX": (0.0, 60.0), "FW_P_LIM_MIN": (-60.0, 0.0),
    "FW_T_CLMB_MAX": (1.0, 15.0), "FW_T_SINK_MIN": (1.0, 5.0), "FW_T_SINK_MAX": (1.0, 15.0),
    "NAV_LOITER_RAD": (25.0, 1000.0), "NAV_ACC_RAD": (0.05, 200.0), "FW_RR_": (0.0, 10.0),
    "FW_PR_": (0.0, 10.0), "FW_YR_": (0.0, 10.0), "TRIM_": (-0.5, 0.5), "RWTO_": (0.0, 1.0),
    "EKF2_GPS_DELAY": (0.0, 300.0), "SENS_GPS0_DELAY": (0.0, 300.0), "COM_DL_LOSS_T": (5.0, 300.0),
}  # fmt: skip


def of(name, **sensors):
    config = NavigationSensors.model_validate(sensors)
    return {one.name: one.value for one in px4_parameters(load_aircraft(name), config)}


@pytest.mark.parametrize("name", ["aerosonde", "c172p", "skywalker_x8", "paper"])
def test_px4_takes_each_value(name):
    found = of(name)
    for parameter, value in found.items():
        (limits,) = (limits for start, limits in RANGES.items() if parameter.startswith(start))
        assert limits[0] <= value <= limits[1], parameter
    speeds = [found[f"FW_AIRSPD_{one}"] for one in ("STALL", "MIN", "TRIM", "MAX")]
    assert speeds == sorted(speeds)
    assert len(set(speeds)) == 4


def test_the_delay_is_the_receivers():
    assert of("aerosonde", gnss={"latency_s": 0.05})["EKF2_GPS_DELAY"] == pytest.approx(50.0)
    assert of("aerosonde", gnss={"latency_s": 1.0})["SENS_GPS0_DELAY"] == 300.0


def test_faster_flight_takes_less_of_the_surfaces():
    aircraft, sensors = load_aircraft("aerosonde"), NavigationSensors()
    fast = aircraft.model_copy(update={"cruise_m_s": 29.0})
    slow = aircraft.model_copy(update={"cruise_m_s": 19.0})
    feeds = [
        {p.name: p.value for p in px4_parameters(one, sensors)}["FW_RR_FF"] for one in (slow, fast)
    ]
    assert feeds[0] > feeds[1]
