"""ArduPlane's parameters as they follow from an aircraft: outputs, airspeeds, limits, first gains.

The gains are a start. Each rate controller feeds its target forward by what a steady rate takes of
the surface, and has as much proportional gain again; AUTOTUNE does better.
"""

import math
from typing import NamedTuple

from sitl_plant.airframe.config import Aircraft
from sitl_plant.ardupilot.config import ArduPilot, SurfaceOutput

_FULL_RAD = math.radians(45.0)
"""What ArduPlane's rate controllers call the full travel of a surface."""
_FRAMES_PER_S = 400.0  # at least, of the simulator: more cost time, and its loop has 50
_BANK_DEG = 45.0
_CIRCLE_BANK_DEG = 25.0
_FUNCTIONS = {"aileron": 4, "elevator": 19, "rudder": 21, "throttle": 70}
"""SERVOn_FUNCTION."""


class ArduParameter(NamedTuple):
    """A parameter, and why it has this value."""

    name: str
    value: float
    why: str


def parameters_of(aircraft: Aircraft, outputs: ArduPilot, step_us: int) -> list[ArduParameter]:
    """Return the parameters of an ArduPlane that is to fly an aircraft.

    Args:
        aircraft: The nominal aircraft.
        outputs: Which output moves which actuator.
        step_us: Control period of the plant [µs].
    """
    return [
        *_outputs(outputs),
        *_limits(aircraft),
        *_gains(aircraft),
        ArduParameter("SIM_RATE_HZ", 1e6 / (step_us * _periods(step_us)), "control periods"),
        ArduParameter("ARSPD_USE", 1, "the plant measures it"),
        ArduParameter("THR_FAILSAFE", 0, "there is no transmitter"),
        ArduParameter("LOG_DISARMED", 0, "nothing to log on the launcher"),
    ]


def parameter_text(parameters: list[ArduParameter]) -> str:
    """Return the file of --defaults."""
    return "".join(f"{one.name:<17} {one.value:<10.6g} # {one.why}\n" for one in parameters)


def _periods(step_us: int) -> int:
    """Return the control periods of a frame."""
    return max(math.floor(1e6 / (_FRAMES_PER_S * step_us)), 1)


def _outputs(outputs: ArduPilot) -> list[ArduParameter]:
    found = []
    for name, function in _FUNCTIONS.items():
        output = getattr(outputs, name)
        servo = f"SERVO{output.channel}"
        found.append(ArduParameter(f"{servo}_FUNCTION", function, name))
        found.append(ArduParameter(f"{servo}_MIN", output.min_us, "whole travel, in us"))
        found.append(ArduParameter(f"{servo}_MAX", output.max_us, "whole travel, in us"))
        if isinstance(output, SurfaceOutput):
            found.append(ArduParameter(f"{servo}_TRIM", output.trim_us, "in us"))
            found.append(ArduParameter(f"{servo}_REVERSED", output.reversed, "as in outputs"))
    return found


def _limits(aircraft: Aircraft) -> list[ArduParameter]:
    cruise, g = aircraft.design_airspeed, aircraft.gravity_m_s2 or 9.81
    pressure = 0.5 * aircraft.air_density_kg_m3 * cruise**2 * aircraft.wing_area_m2
    C = aircraft.coefficients
    alpha = (aircraft.mass_kg * g / pressure - C.cL0) / C.cL_alpha
    drag = pressure * (C.cD0 + C.cD_alpha * alpha + C.cD_alpha2 * alpha**2)
    share = min(max(drag / aircraft.thrust_limit_n, 0.0), 1.0)
    radius = cruise**2 / (g * math.tan(math.radians(_CIRCLE_BANK_DEG)))
    climb = max((aircraft.thrust_limit_n - drag) * cruise / (aircraft.mass_kg * g), 0.5)
    sink = max(drag * cruise / (aircraft.mass_kg * g), 0.5)
    return [
        ArduParameter("AIRSPEED_CRUISE", cruise, "m/s"),
        ArduParameter("AIRSPEED_MIN", max(math.floor(aircraft.airspeed_min_m_s), 5), "m/s"),
        ArduParameter("AIRSPEED_MAX", math.ceil(aircraft.airspeed_max_m_s), "m/s"),
        ArduParameter("SCALING_SPEED", round(cruise, 1), "m/s, that the gains are for"),
        ArduParameter("PTCH_TRIM_DEG", round(math.degrees(alpha), 2), "of level flight at cruise"),
        ArduParameter("TRIM_THROTTLE", round(100.0 * share), "%, of level flight at cruise"),
        ArduParameter("THR_MAX", 100, "%"),
        ArduParameter("ROLL_LIMIT_DEG", _BANK_DEG, "deg"),
        ArduParameter("PTCH_LIM_MAX_DEG", 20, "deg"),
        ArduParameter("PTCH_LIM_MIN_DEG", -20, "deg"),
        ArduParameter("WP_LOITER_RAD", math.ceil(radius), f"m, {_CIRCLE_BANK_DEG:g} deg of bank"),
        ArduParameter("WP_RADIUS", math.ceil(radius / 2.0), "m"),
        ArduParameter("TECS_CLMB_MAX", round(min(0.7 * climb, 10.0), 1), "m/s, 70 % of the excess"),
        ArduParameter("TECS_SINK_MIN", round(min(sink, 5.0), 1), "m/s, without thrust at cruise"),
        ArduParameter("TECS_SINK_MAX", round(min(2.0 * sink, 10.0), 1), "m/s, twice that"),
    ]


def _gains(aircraft: Aircraft) -> list[ArduParameter]:
    roll, pitch = _roll_feed(aircraft), _pitch_feed(aircraft)
    found = []
    for axis, feed in (("RLL", roll), ("PTCH", pitch)):
        why = f"start: full travel for a steady {math.degrees(_FULL_RAD / feed):.0f} deg/s"
        found.append(ArduParameter(f"{axis}_RATE_FF", round(feed, 4), why))
        found.append(ArduParameter(f"{axis}_RATE_P", round(feed, 4), "start: as FF"))
        found.append(ArduParameter(f"{axis}_RATE_I", round(feed, 4), "start: as FF"))
        found.append(ArduParameter(f"{axis}_RATE_D", 0, "start: none"))
    found.append(ArduParameter("RLL2SRV_TCONST", 0.5, "s"))
    found.append(ArduParameter("PTCH2SRV_TCONST", 0.5, "s"))
    return found


def _roll_feed(aircraft: Aircraft) -> float:
    """Return RLL_RATE_FF: the part of the travel that a steady roll of 1 rad/s takes at cruise."""
    C, V = aircraft.coefficients, aircraft.design_airspeed
    reduced = _per_rate(aircraft, aircraft.wing_span_m, V)
    deflection = abs(C.cl_p * reduced / C.cl_da) if C.cl_da else 1.0
    return _feed(deflection, aircraft.stops_deg[0])


def _pitch_feed(aircraft: Aircraft) -> float:
    """Return PTCH_RATE_FF: the same of a steady pull-up, whose lift takes an angle of attack."""
    C, V = aircraft.coefficients, aircraft.design_airspeed
    reduced = _per_rate(aircraft, aircraft.mean_chord_m, V)
    pressure = 0.5 * aircraft.air_density_kg_m3 * V**2 * aircraft.wing_area_m2
    alpha = aircraft.mass_kg * V / (pressure * C.cL_alpha)
    moment = C.cm_alpha * alpha + C.cm_q * reduced
    deflection = abs(moment / C.cm_de) if C.cm_de else 1.0
    return _feed(deflection, aircraft.stops_deg[1])


def _per_rate(aircraft: Aircraft, length: float, V: float) -> float:
    """Return what a derivative by a rate is multiplied by for 1 rad/s."""
    return length / (2.0 * V) if aircraft.rate_derivatives == "nondimensional" else 1.0


def _feed(deflection: float, stops_deg: tuple[float, float]) -> float:
    travel = math.radians(min(-stops_deg[0], stops_deg[1])) or 1.0
    return min(max(deflection / travel * _FULL_RAD, 0.02), 3.0)
