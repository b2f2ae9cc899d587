"""PX4's parameters as they follow from an aircraft: airspeeds, limits, first gains.

They replace what PX4's airframe has, which is a plane at 15 m/s. The gains are a start: each rate
controller feeds its set-point forward by what a steady rate takes of the surface, and has as much
proportional and integral gain again; PX4's autotune does better.
"""

import math

from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.cruise import DerivedParameter, cruise_figures
from sitl_plant.sensing.config import NavigationSensors

_LONGEST_DELAY_MS = 300.0


def px4_parameters(aircraft: Aircraft, sensors: NavigationSensors) -> list[DerivedParameter]:
    """Return the parameters of a PX4 that is to fly an aircraft.

    Args:
        aircraft: The nominal aircraft.
        sensors: What it is sent.
    """
    figures = cruise_figures(aircraft)
    slowest = max(math.floor(aircraft.airspeed_min_m_s), 5)
    delay_ms = min(sensors.gnss.latency_s * 1e3, _LONGEST_DELAY_MS)
    sink, climb, circle = figures.sink_m_s, figures.climb_m_s, figures.circle_m
    return [
        DerivedParameter("FW_AIRSPD_TRIM", figures.airspeed, "m/s"),
        DerivedParameter("FW_AIRSPD_MIN", slowest, "m/s"),
        DerivedParameter("FW_AIRSPD_MAX", math.ceil(aircraft.airspeed_max_m_s), "m/s"),
        DerivedParameter("FW_AIRSPD_STALL", round(0.85 * slowest, 1), "m/s, 85 % of the least"),
        DerivedParameter("FW_PSP_OFF", round(figures.pitch_deg, 2), "deg, of level flight"),
        DerivedParameter("FW_THR_TRIM", round(figures.thrust, 2), "of level flight at cruise"),
        DerivedParameter("FW_THR_MIN", 0, "of the thrust"),
        DerivedParameter("FW_THR_MAX", 1, "of the thrust"),
        DerivedParameter("FW_R_LIM", 45, "deg"),
        DerivedParameter("FW_P_LIM_MAX", 20, "deg"),
        DerivedParameter("FW_P_LIM_MIN", -20, "deg"),
        DerivedParameter("FW_T_CLMB_MAX", _near(0.7 * climb, 1.0, 10.0), "m/s, 70 % of excess"),
        DerivedParameter("FW_T_SINK_MIN", _near(sink, 1.0, 5.0), "m/s, without thrust"),
        DerivedParameter("FW_T_SINK_MAX", _near(2.0 * sink, 2.0, 10.0), "m/s, twice that"),
        DerivedParameter("NAV_LOITER_RAD", _near(circle, 25.0, 1000.0), "m, 25 deg of bank"),
        DerivedParameter("NAV_ACC_RAD", _near(circle / 2.0, 10.0, 200.0), "m"),
        *_gains("RR", figures.roll_travel),
        *_gains("PR", figures.pitch_travel),
        DerivedParameter("FW_YR_FF", 0, "start: the fin turns it"),
        DerivedParameter("FW_YR_P", 0.1, "start"),
        DerivedParameter("FW_YR_I", 0.05, "start"),
        DerivedParameter("TRIM_PITCH", 0, "outputs are in the middle in level flight"),
        DerivedParameter("RWTO_TKOFF", 0, "it is launched"),
        DerivedParameter("EKF2_GPS_DELAY", delay_ms, "ms, latency_s of the receiver"),
        DerivedParameter("SENS_GPS0_DELAY", delay_ms, "ms, its name since"),
        DerivedParameter("COM_DL_LOSS_T", 300, "s of its time, which is faster than a station's"),
    ]


def _near(value: float, low: float, high: float) -> float:
    """Return the nearest value, to a tenth, that PX4 takes."""
    return round(min(max(value, low), high), 1)


def _gains(axis: str, travel: float) -> list[DerivedParameter]:
    feed = round(min(max(travel, 0.02), 5.0), 4)
    why = f"start: full travel for a steady {math.degrees(1.0 / feed):.0f} deg/s"
    return [
        DerivedParameter(f"FW_{axis}_FF", feed, why),
        DerivedParameter(f"FW_{axis}_P", feed, "start: as FF"),
        DerivedParameter(f"FW_{axis}_I", feed, "start: as FF"),
    ]
