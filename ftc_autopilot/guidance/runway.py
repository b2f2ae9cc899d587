"""Take-off and landing: their parameters, and the figures that an aircraft has for them.

V_s is the airspeed of level flight with the greatest lift. By the rules of the air for aeroplanes
(14 CFR 23.2115, 23.2125; FAA-H-8083-3C, chapters 6 and 9) an aeroplane leaves the ground at 1.1 to
1.2 V_s and approaches at 1.3 V_s.

The flare is exponential, h' = -(h + h_b)/τ (J. H. Blakelock, Automatic Control of Aircraft and
Missiles, 2nd ed., section 2-5): it leads to a level h_b below the runway, so that the aircraft
arrives with the sink h_b/τ. It begins where its sink is the approach's. τ is slow against the time
by which the aircraft's climb follows the command: the delay 3/ω of the reference filter, and
τ_γ = m V/(q̄ S (C_Lα + C_D0)), with which the path follows the pitch.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from ftc_autopilot.guidance.aircraft_limits import limits_of
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.guidance.runway_performance import (
    ROTATE,
    STEEPEST_SHARE,
    carried_linearly,
    drag_of,
    glide_of,
    landing_roll,
    stall_airspeed,
    take_off_roll,
)
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity, whole
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.gear import Gear

_APART_M = 20.0  # between two that have landed one after the other
_APPROACH = 1.3
"""Airspeed, relative to V_s."""
_IDLE_SHARE = 0.6
"""Share of the drag, which an idling engine leaves, that the usual slope takes; the rest is for
corrections."""
_FLARE = 1.5
"""Time constant of the flare, relative to the lag that it has to be slow against."""
_MOST_FLARE = 0.1
"""Acceleration of the flare, relative to gravity, at most."""
_RESERVE = 1.33
"""Length of a runway, relative to the roll that it takes."""
_WIDTH_M = 15.0
CANNOT_START, FROM_WHEELS, FROM_LAUNCHER = range(3)
"""How an aircraft takes off."""
STANDS = 0.5
"""Ground speed below which an aircraft stands, relative to V_s."""
_TAIL_RESERVE = math.radians(2.0)
"""Pitch that is kept between tail and ground [rad]."""


class RunwayParameters(Model):
    """How the aircraft takes off and lands; what is left open is its own.

    Attributes:
        length_m: Length of the runways; none: of the scenario's runway, or as long as needed.
        width_m: Width of the runways; none: of the scenario's runway, or 15.
        rotate_m_s: Airspeed at which it rotates; none: 1.15 of the stall's, or what its tail
            permits.
        approach_m_s: Airspeed of the approach; none: 1.3 of the stall's, within the limits of
            guidance.
        take_off_m: Height above home of a take-off for which no mission says one, and of the circle
            before a landing in AUTOLAND.
        acceleration_m_s2: Greatest acceleration of a take-off, for which thrust is given.
        reject_share: Share of the expected acceleration below which a take-off is rejected; 0:
            never.
        glide_deg: Slope of an approach that has the room; none: 3, or 0.6 of what an idling engine
            gives.
        touchdown_m_s: Sink at which it touches down.
        spacing_m: Distance from the member of a formation ahead from which the next one takes off.
        go_arounds: Approaches given up as not stable, at most; the next one is flown to its end.
    """

    length_m: float | None = quantity("m", default=None, gt=0.0)
    width_m: float | None = quantity("m", default=None, gt=0.0)
    rotate_m_s: float | None = quantity("m/s", default=None, gt=0.0)
    approach_m_s: float | None = quantity("m/s", default=None, gt=0.0)
    take_off_m: float = quantity("m", default=50.0, gt=0.0)
    acceleration_m_s2: float = quantity("m/s^2", default=5.0, gt=0.0)
    reject_share: float = quantity("", default=0.5, ge=0.0, lt=1.0)
    glide_deg: float | None = quantity("deg", default=None, gt=0.0, le=20.0)
    touchdown_m_s: float = quantity("m/s", default=0.3, gt=0.0, le=3.0)
    spacing_m: float = quantity("m", default=200.0, ge=20.0)
    go_arounds: int = whole("", default=2, ge=0)

    def on(self, length_m: float, width_m: float) -> Self:
        """Return the same with length and width of a runway, where they are open."""
        length, width = self.length_m or length_m, self.width_m or width_m
        return self.model_copy(update={"length_m": length, "width_m": width})


class RunwayFigures(NamedTuple):
    """Take-off and landing of one aircraft, SI units and radians.

    Attributes:
        stall: V_s.
        rotate: Airspeed at which it rotates.
        rotation: Pitch at which it leaves the ground.
        highest: Greatest pitch on the ground, clear of the tail.
        approach: Airspeed of the approach.
        acceleration: Greatest acceleration of a take-off.
        reject_share: Share of the expected acceleration below which it is rejected.
        slope: Usual slope of an approach, height per length.
        steepest: Steepest one.
        idle: Slope of the glide with an idling engine.
        lag: Time by which the climb follows the command.
        flare: Time constant τ of the flare.
        touchdown: Sink at touchdown.
        take_off_roll: Length that a take-off takes, in still air.
        landing_roll: Length from touchdown to standstill.
        length: Of the runways; 0: as long as needed.
        width: Of the runways.
        height: Of the centre of gravity, standing.
        pitch: Standing.
        steering: Angle of the steered wheel per rudder deflection.
        grip: Yawing moment at which it slides, at rest.
        rolling: Friction of the wheels, relative to their load.
        braking: Friction with brakes, or of a belly.
        starts: From its wheels, from a launcher, or not at all.
        lands: 1: it has gear, or a belly to land on.
        wheels: 1: it rolls on wheels; 0: on its belly.
        launch: Length of its launcher.
        span: Of the wing.
        go_arounds: Approaches given up, at most.
        glide: Airspeed of a glide without thrust.
        sink: Its sink.
        spacing: Distance from which the next member of a formation takes off.
        room: Way that who lands rolls on for each member behind: its landing roll, half of its
            flare, by which it may touch down late, and 20 m between them.
    """

    stall: float
    rotate: float
    rotation: float
    highest: float
    approach: float
    acceleration: float
    reject_share: float
    slope: float
    steepest: float
    idle: float
    lag: float
    flare: float
    touchdown: float
    take_off_roll: float
    landing_roll: float
    length: float
    width: float
    height: float
    pitch: float
    steering: float
    grip: float
    rolling: float
    braking: float
    starts: float
    lands: float
    wheels: float
    launch: float
    span: float
    go_arounds: float
    glide: float
    sink: float
    spacing: float
    room: float

    def flare_height(self, slope: float) -> float:
        """Return the height at which the flare of an approach begins, above touchdown [m]."""
        return max(self.approach * slope - self.touchdown, 0.0) * self.flare

    def slowing_length(self, airspeed: float, gravity: float) -> float:
        """Return the length of level flight in which it slows down to the approach [m].

        Args:
            airspeed: Before [m/s].
            gravity: Acceleration of gravity [m/s²].
        """
        return max(airspeed**2 - self.approach**2, 0.0) / (2.0 * _IDLE_SHARE * self.idle * gravity)

    def flare_length(self, slope: float) -> float:
        """Return the length of the flare along the ground, in still air [m]."""
        ratio = max(self.approach * slope / self.touchdown, 1.0)
        return self.approach * self.flare * math.log(ratio)


RUNWAY_FIGURES = np.dtype([(name, "f8") for name in RunwayFigures._fields])


def figures_of(
    runway: RunwayParameters, guidance: GuidanceParameters, aircraft: Aircraft, bandwidth: float
) -> RunwayFigures | None:
    """Return the figures of an aircraft; None of one without gear.

    Args:
        runway: What is asked for.
        guidance: Whose limits hold in the air.
        aircraft: The nominal aircraft.
        bandwidth: Of the reference filter [rad/s].
    """
    if aircraft.gear is None:
        return None
    record, limits = aircraft_record(aircraft), limits_of(guidance, aircraft)
    weight = aircraft.mass_kg * aircraft.gravity_m_s2
    stall = stall_airspeed(record, math.radians(limits.incidence_max_deg))
    approach = runway.approach_m_s or min(
        max(_APPROACH * stall, limits.airspeed_min_m_s), limits.airspeed_max_m_s
    )
    area = 0.5 * float(record["rho"]) * approach**2 * float(record["S"])
    at_zero, rise = carried_linearly(record)
    alpha = (weight / area - at_zero) / rise
    idle = float(drag_of(area, alpha, record)) / weight
    steepest = min(math.asin(min(STEEPEST_SHARE * idle, 1.0)), math.radians(limits.climb_max_deg))
    usual = min(math.radians(3.0), math.asin(min(_IDLE_SHARE * idle, 1.0)))
    if runway.glide_deg is not None:
        usual = math.radians(runway.glide_deg)
    lag = 3.0 / bandwidth + aircraft.mass_kg * approach / (area * rise)
    slope = math.tan(usual)
    flare = max(_FLARE * lag, approach * slope / (_MOST_FLARE * aircraft.gravity_m_s2))
    stance, tail = _stance_of(aircraft, aircraft.gear)
    acceleration = runway.acceleration_m_s2
    highest = min(tail - _TAIL_RESERVE, math.radians(limits.incidence_max_deg))
    half = 0.5 * float(record["rho"]) * float(record["S"])
    clear = math.sqrt(weight / (half * max(at_zero + rise * highest, 1e-6)))
    rotate = runway.rotate_m_s or max(ROTATE * stall, clear)
    touchdown = min(runway.touchdown_m_s, approach * slope)
    stops_within = landing_roll(record, approach, stance.braking)
    glide, sink = glide_of(record, stall, approach, limits.airspeed_max_m_s, flare, touchdown)
    return RunwayFigures(
        stall=stall,
        rotate=rotate,
        rotation=min((weight / (half * rotate**2) - at_zero) / rise, highest),
        highest=highest,
        approach=approach,
        acceleration=acceleration,
        reject_share=runway.reject_share,
        slope=slope,
        steepest=max(math.tan(steepest), slope),
        idle=idle,
        lag=lag,
        flare=flare,
        touchdown=touchdown,
        take_off_roll=take_off_roll(record, guidance, acceleration, rotate, stance.rolling),
        landing_roll=stops_within,
        length=runway.length_m or 0.0,
        width=runway.width_m or _WIDTH_M,
        **stance._asdict(),
        span=aircraft.wing_span_m,
        go_arounds=float(runway.go_arounds),
        glide=glide,
        sink=sink,
        spacing=runway.spacing_m,
        room=stops_within + 0.5 * flare * approach + _APART_M,
    )


class _Stance(NamedTuple):
    """What of a landing gear take-off and landing depend on: a part of `RunwayFigures`."""

    starts: float
    lands: float
    wheels: float
    height: float
    pitch: float
    steering: float
    grip: float
    rolling: float
    braking: float
    launch: float


def _stance_of(aircraft: Aircraft, gear: Gear) -> tuple[_Stance, float]:
    """Return how an aircraft stands on its gear, and rolls; the pitch at which its tail touches."""
    span = aircraft.wing_span_m
    main, third = gear.main(span), gear.third(span)
    pitch = math.remainder(math.atan2(main[2] - third[2], main[0] - third[0]), math.pi)
    height = math.cos(pitch) * main[2] - math.sin(pitch) * main[0] - gear.deflection(span)
    rolling, side, brake = gear.frictions
    weight = aircraft.mass_kg * aircraft.gravity_m_s2
    base, tail = abs(third[0] - main[0]), gear.hull(span)[2]
    on_main = abs(third[0]) / base
    starts = CANNOT_START if gear.kind == "belly" else FROM_WHEELS
    stop = min(map(abs, aircraft.stops_deg[2]))
    stance = _Stance(
        starts=starts if gear.launcher is None else FROM_LAUNCHER,
        lands=1.0,
        wheels=float(gear.kind != "belly"),
        height=height,
        pitch=pitch,
        steering=-gear.steer / math.radians(stop) if stop > 0.0 else 0.0,
        grip=side * weight * abs(main[0])
        if gear.steer > 0.0
        else 0.0,  # the wheel's load by its arm
        rolling=rolling,
        braking=rolling if gear.kind == "belly" else brake * on_main,
        launch=0.0 if gear.launcher is None else gear.launcher.length_m,
    )
    return stance, math.atan2(main[2] - tail[2], main[0] - tail[0])


def runway_record(figures: RunwayFigures) -> np.void:
    """Return figures as a record of dtype `RUNWAY_FIGURES`."""
    record: np.void = np.array([tuple(figures)], RUNWAY_FIGURES)[0]
    return record
