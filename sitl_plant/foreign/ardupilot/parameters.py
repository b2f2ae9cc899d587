"""ArduPlane's parameters as they follow from an aircraft: outputs, airspeeds, limits, first gains.

The gains are a start. Each rate controller feeds its target forward by what a steady rate takes of
the surface, and has as much proportional gain again; AUTOTUNE does better.
"""

import math

from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.cruise import CruiseFigures, DerivedParameter, cruise_figures
from sitl_plant.foreign.ardupilot.config import ArduPilot, SurfaceOutput

_FULL_RAD = math.radians(45.0)
"""What ArduPlane's rate controllers call the full travel of a surface."""
_FRAMES_PER_S = 400.0  # at least, of the simulator: more cost time, and its loop has 50
_BANK_DEG = 45.0
_FUNCTIONS = {"aileron": 4, "elevator": 19, "rudder": 21, "throttle": 70}
"""SERVOn_FUNCTION."""


def parameters_of(aircraft: Aircraft, outputs: ArduPilot, step_us: int) -> list[DerivedParameter]:
    """Return the parameters of an ArduPlane that is to fly an aircraft.

    Args:
        aircraft: The nominal aircraft.
        outputs: Which output moves which actuator.
        step_us: Control period of the plant [µs].
    """
    figures = cruise_figures(aircraft)
    return [
        *_outputs(outputs),
        *_limits(aircraft, figures),
        *_gains(figures),
        DerivedParameter("SIM_RATE_HZ", 1e6 / (step_us * _periods(step_us)), "control periods"),
        DerivedParameter("ARSPD_USE", 1, "the plant measures it"),
        DerivedParameter("THR_FAILSAFE", 0, "there is no transmitter"),
        DerivedParameter("LOG_DISARMED", 0, "nothing to log on the launcher"),
    ]


def parameter_text(parameters: list[DerivedParameter]) -> str:
    """Return the file of --defaults."""
    return "".join(f"{one.name:<17} {one.value:<10.6g} # {one.why}\n" for one in parameters)


def acceleration(aircraft: Aircraft) -> float:
    """Return how fast its airspeed may grow [m/s²]: by half of the energy of TECS_CLMB_MAX."""
    figures = cruise_figures(aircraft)
    return 0.5 * aircraft.gravity_m_s2 * _climb(figures) / figures.airspeed


def _climb(figures: CruiseFigures) -> float:
    return round(min(0.7 * figures.climb_m_s, 10.0), 1)


def _periods(step_us: int) -> int:
    """Return the control periods of a frame."""
    return max(math.floor(1e6 / (_FRAMES_PER_S * step_us)), 1)


def _outputs(outputs: ArduPilot) -> list[DerivedParameter]:
    found = []
    for name, function in _FUNCTIONS.items():
        output = getattr(outputs, name)
        servo = f"SERVO{output.channel}"
        found.append(DerivedParameter(f"{servo}_FUNCTION", function, name))
        found.append(DerivedParameter(f"{servo}_MIN", output.min_us, "whole travel, in us"))
        found.append(DerivedParameter(f"{servo}_MAX", output.max_us, "whole travel, in us"))
        if isinstance(output, SurfaceOutput):
            found.append(DerivedParameter(f"{servo}_TRIM", output.trim_us, "in us"))
            found.append(DerivedParameter(f"{servo}_REVERSED", output.reversed, "as in outputs"))
    return found


def _limits(aircraft: Aircraft, figures: CruiseFigures) -> list[DerivedParameter]:
    cruise, radius = figures.airspeed, math.ceil(figures.circle_m)
    sink = figures.sink_m_s
    return [
        DerivedParameter("AIRSPEED_CRUISE", cruise, "m/s"),
        DerivedParameter("AIRSPEED_MIN", max(math.floor(aircraft.airspeed_min_m_s), 5), "m/s"),
        DerivedParameter("AIRSPEED_MAX", math.ceil(aircraft.airspeed_max_m_s), "m/s"),
        DerivedParameter("SCALING_SPEED", round(cruise, 1), "m/s, that the gains are for"),
        DerivedParameter("PTCH_TRIM_DEG", round(figures.pitch_deg, 2), "of level flight at cruise"),
        DerivedParameter(
            "TRIM_THROTTLE", round(100.0 * figures.thrust), "%, of level flight at cruise"
        ),
        DerivedParameter("THR_MAX", 100, "%"),
        DerivedParameter("ROLL_LIMIT_DEG", _BANK_DEG, "deg"),
        DerivedParameter("PTCH_LIM_MAX_DEG", 20, "deg"),
        DerivedParameter("PTCH_LIM_MIN_DEG", -20, "deg"),
        DerivedParameter("WP_LOITER_RAD", radius, "m, 25 deg of bank"),
        DerivedParameter("WP_RADIUS", math.ceil(figures.circle_m / 2.0), "m"),
        DerivedParameter("TECS_CLMB_MAX", _climb(figures), "m/s, 70 % of the excess"),
        DerivedParameter(
            "TECS_SINK_MIN", round(min(sink, 5.0), 1), "m/s, without thrust at cruise"
        ),
        DerivedParameter("TECS_SINK_MAX", round(min(2.0 * sink, 10.0), 1), "m/s, twice that"),
    ]


def _gains(figures: CruiseFigures) -> list[DerivedParameter]:
    found = []
    for axis, travel in (("RLL", figures.roll_travel), ("PTCH", figures.pitch_travel)):
        feed = min(max(travel * _FULL_RAD, 0.02), 3.0)
        why = f"start: full travel for a steady {math.degrees(_FULL_RAD / feed):.0f} deg/s"
        found.append(DerivedParameter(f"{axis}_RATE_FF", round(feed, 4), why))
        found.append(DerivedParameter(f"{axis}_RATE_P", round(feed, 4), "start: as FF"))
        found.append(DerivedParameter(f"{axis}_RATE_I", round(feed, 4), "start: as FF"))
        found.append(DerivedParameter(f"{axis}_RATE_D", 0, "start: none"))
    found.append(DerivedParameter("RLL2SRV_TCONST", 0.5, "s"))
    found.append(DerivedParameter("PTCH2SRV_TCONST", 0.5, "s"))
    return found
