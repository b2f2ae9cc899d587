"""Contact of an aircraft with the ground: forces, what lasts from step to step, and its judgement.

Each point is a spring and damper along the ground's normal, which pushes only, and one along and
one across its wheel, whose force friction limits: a point that does not slide is held where it
is, without any drift, and one that slides takes with it what it is held at.

Sources: JSBSim reference manual, ground reactions (springs, dampers, friction along and across,
steering); P. A. Cundall, O. D. L. Strack, A discrete numerical model for granular assemblies,
Géotechnique 29 (1979), for friction with memory; B. L. Stevens, F. L. Lewis, Aircraft Control and
Simulation, for the equations of motion. See docs/explanation/ground.md.
"""

import math
from typing import NamedTuple, TypeAlias

import numpy as np

from mavlink_defs.runtime.jit import apart, compiled
from sitl_plant.airframe.aerodynamics import aerodynamics, force
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.airframe.rigid_body import R1, Air, State, load_state
from sitl_plant.vec3 import (
    Mat3,
    Vec3,
    add,
    clamp,
    cross,
    dot,
    mat3,
    mul,
    mul_t,
    norm,
    scale,
    sub,
    vec3,
)

POINTS = (
    *("right wheel", "left wheel", "third wheel"),
    *("right wing tip", "left wing tip", "nose", "tail", "body"),
)
"""The points of an aircraft that can touch the ground; the last is its centre of gravity."""
WHEELS = 3
N_POINTS = len(POINTS)
_RIGHT_TIP, _LEFT_TIP, _NOSE, _BODY = 3, 4, 5, 7
THIRD = 2

TOUCHDOWN = np.dtype(
    [
        ("time", "f8"),  # s
        ("sink", "f8"),  # speed into the ground [m/s]
        ("bank", "f8"),  # against the ground [rad]
        ("pitch", "f8"),  # rad
        ("drift", "f8"),  # speed across the aircraft's heading [m/s]
        ("speed", "f8"),  # over the ground [m/s]
        ("position", "f8", (3,)),  # NED [m]
    ]
)
"""A touchdown, by the last state in the air."""

GEAR = np.dtype(
    [
        ("has", "i8"),  # 1: the aircraft has gear, 0: it must not touch the ground
        ("belly", "i8"),  # 1: it may lie on wing tips and nose
        ("normal", "f8", (3,)),  # into the ground, NED
        ("at", "f8", (N_POINTS, 3)),  # body axes [m]
        ("stiffness", "f8", (N_POINTS,)),  # N/m
        ("damping", "f8", (N_POINTS,)),  # N s/m
        ("rolling", "f8", (N_POINTS,)),  # friction along
        ("side", "f8", (N_POINTS,)),  # friction across
        ("braked", "f8", (N_POINTS,)),  # friction along that full brake adds
        (
            "steer",
            "f8",
        ),  # of the third wheel, to the right, by the rudder's share of its stop [rad]
        ("reach", "f8"),  # of the farthest point [m]
        ("longest_step", "f8"),  # of the integration on the ground [s]
        ("sink_hard", "f8"),  # m/s
        ("sink_max", "f8"),  # m/s
        ("bank_max", "f8"),  # rad
        ("drift_max", "f8"),  # m/s
        ("launch_speed", "f8"),  # m/s
        ("launch_length", "f8"),  # m
        ("runway", "f8", (4,)),  # north, east of its threshold, length, half its width [m]; 0: none
        ("runway_heading", "f8"),  # rad
        # what changes
        ("launch_s", "f8"),  # time on the launcher, 0: held, -1: not on it
        ("brake", "f8"),  # 0 to 1, as commanded
        ("near", "i8"),  # 1: the ground may be touched in this period
        ("flew", "i8"),  # 1: it has been out of its reach
        ("touching", "i8", (N_POINTS,)),  # 1: it touches
        ("held", "f8", (N_POINTS, 3)),  # where friction holds a point that touches, NED [m]
        ("load", "f8"),  # of the ground, as a share of the weight
        ("crash", "i8"),  # one of CRASHES, 0: none
        ("touchdowns", "i8"),
        ("worst", TOUCHDOWN),  # the one with the largest sink
        ("off_runway", "i8"),  # 1: it has been on the ground beside its runway
        ("off_centre", "f8"),  # farthest from its centre line on the ground [m]
    ]
)
"""An aircraft's gear, the ground under it, and what happens between the two."""

SINK, BANK, DRIFT, WING, NOSE, BODY = range(1, 7)

Reaction: TypeAlias = tuple[Vec3, Vec3]
"""Force [N] and moment about the centre of gravity [N m], body axes."""

_AHEAD = math.sqrt(3.0)
"""Speed along the x axis by that across it, where the flow is 30° beside the axis."""
_NONE: Vec3 = (0.0, 0.0, 0.0)


@compiled
def height_above_ground(position: Vec3, gear: np.void) -> float:
    """Return how far a position NED [m] is above the ground [m]."""
    return -dot(vec3(gear["normal"]), position)


@apart(x=np.zeros(12), gear=GEAR)
def note_nearness(x: np.ndarray, dt: float, gear: np.void) -> None:
    """Note whether an aircraft with gear, its state of shape (12,), may touch the ground.

    Args:
        x: The state, in the order of `State`.
        dt: In a period of this length [s].
        gear: Its gear.
    """
    height = height_above_ground(vec3(x[0:3]), gear)
    gear["near"] = height < gear["reach"] + 2.0 * dt * norm(vec3(x[3:6]))
    if gear["near"] == 0:
        gear["flew"], gear["load"] = 1, 0.0
        gear["touching"][:] = 0


class Touch(NamedTuple):
    """A point that touches the ground; body axes."""

    pressed: float  # against the ground [N]
    x: Vec3  # unit vector along its wheel
    y: Vec3  # and across
    stretched: Vec3  # how far it is from where friction holds it [m]
    moving: Vec3  # velocity [m/s]
    grip_x: float  # largest friction along [N]
    grip_y: float  # and across [N]


@compiled
def ground_reaction(state: State, rudder: float, gear: np.void) -> Reaction:
    """Return force and moment of the ground.

    Args:
        state: State of the aircraft.
        rudder: Position of the rudder as a share of its stop.
        gear: Record of dtype `GEAR`.
    """
    p, _, phi, _ = state
    R = R1(phi)
    n = mul_t(R, vec3(gear["normal"]))
    lowered = -height_above_ground(p, gear)
    F, M = _NONE, _NONE
    for i in range(N_POINTS):
        r = vec3(gear["at"][i])
        depth = lowered + dot(n, r)
        if depth <= 0.0:
            continue
        touch = _touch(i, depth, state, R, n, rudder, gear)
        k, c = gear["stiffness"][i], gear["damping"][i]
        along = -k * dot(touch.x, touch.stretched) - c * dot(touch.x, touch.moving)
        across = -k * dot(touch.y, touch.stretched) - c * dot(touch.y, touch.moving)
        along = clamp(along, -touch.grip_x, touch.grip_x)
        across = clamp(across, -touch.grip_y, touch.grip_y)
        f = add(scale(-touch.pressed, n), add(scale(along, touch.x), scale(across, touch.y)))
        F, M = add(F, f), add(M, cross(r, f))
    return F, M


@compiled
def hold_points(state: State, rudder: float, gear: np.void) -> float:
    """Note which points touch the ground and where friction holds them; arguments as above.

    Returns:
        The force along the ground's normal [N].
    """
    p, _, phi, _ = state
    R = R1(phi)
    n = mul_t(R, vec3(gear["normal"]))
    lowered = -height_above_ground(p, gear)
    load = 0.0
    for i in range(N_POINTS):
        r = vec3(gear["at"][i])
        depth = lowered + dot(n, r)
        if depth <= 0.0:
            gear["touching"][i] = 0
            continue
        touch, k = _touch(i, depth, state, R, n, rudder, gear), gear["stiffness"][i]
        along = clamp(dot(touch.x, touch.stretched), -touch.grip_x / k, touch.grip_x / k)
        across = clamp(dot(touch.y, touch.stretched), -touch.grip_y / k, touch.grip_y / k)
        kept = mul(R, sub(r, add(scale(along, touch.x), scale(across, touch.y))))
        for axis in range(3):
            gear["held"][i, axis] = p[axis] + kept[axis]
        gear["touching"][i] = 1
        load += touch.pressed
    return load


@compiled
def _touch(
    i: int, depth: float, state: State, R: Mat3, n: Vec3, rudder: float, gear: np.void
) -> Touch:
    """Return how a point touches, given its depth in the ground [m] and the normal, body axes."""
    p, v, _, omega = state
    r = vec3(gear["at"][i])
    moving = add(v, cross(omega, r))
    pressed = max(gear["stiffness"][i] * depth + gear["damping"][i] * dot(n, moving), 0.0)
    x, y = _wheel_axes(n, rudder * gear["steer"] if i == THIRD else 0.0)
    stretched = _NONE
    if gear["touching"][i] == 1:
        stretched = add(mul_t(R, sub(p, vec3(gear["held"][i]))), r)
    along = gear["rolling"][i] + gear["brake"] * gear["braked"][i]
    return Touch(pressed, x, y, stretched, moving, along * pressed, gear["side"][i] * pressed)


@compiled
def _wheel_axes(n: Vec3, heading: float) -> tuple[Vec3, Vec3]:
    """Return unit vectors along and across a wheel in the ground, body axes.

    Args:
        n: The ground's normal, body axes.
        heading: Of the wheel, to the right of the x axis [rad].
    """
    ahead = (math.cos(heading), math.sin(heading), 0.0)
    along = sub(ahead, scale(dot(ahead, n), n))
    length = norm(along)
    if length < 1e-6:  # it stands on its nose, or tail
        along = sub((0.0, 0.0, 1.0), scale(n[2], n))
        length = norm(along)
    along = scale(1.0 / length, along)
    return along, cross(n, along)


@apart(aircraft=AIRCRAFT, gear=GEAR)
def beside_the_ground(
    state: State,
    delta: Vec3,
    d_v: Vec3,
    d_omega: Vec3,
    surrounding: Air,
    aircraft: AircraftRecord,
    gear: np.void,
) -> tuple[Vec3, Vec3, Air]:
    """Return disturbances of the motion with the ground's, and the air around the aircraft.

    Of air from the side or behind, as wind around an aircraft that stands, no file says anything:
    it counts as if it came from 30° at most beside the x axis, at the same airspeed, with the force
    along this axis in proportion to the motion along it.

    Args:
        state: State of the aircraft.
        delta: Aileron, elevator, rudder [rad].
        d_v: Disturbance of the acceleration, body axes [m/s²].
        d_omega: Disturbance of the angular acceleration, body axes [rad/s²].
        surrounding: Motion of the air.
        aircraft: The aircraft.
        gear: Its gear.
    """
    _, v, _, omega = state
    F, M = ground_reaction(state, rudder_share(delta[2], aircraft), gear)
    d_v = add(d_v, scale(1.0 / aircraft["m"], F))
    d_omega = add(d_omega, mul(mat3(aircraft["J_inv"]), M))
    through = sub(v, surrounding[0])
    least = _AHEAD * max(abs(through[1]), abs(through[2]))
    if through[0] < least:
        turned = (max(abs(through[0]), least), through[1], through[2])
        turned = scale(norm(through) / norm(turned), turned)
        air = aerodynamics(turned, sub(omega, surrounding[1]), aircraft)
        excess = (through[0] / turned[0] - 1.0) * force(air, delta)[0]
        d_v = add(d_v, (excess / aircraft["m"], 0.0, 0.0))
        surrounding = sub(v, turned), surrounding[1]
    return d_v, d_omega, surrounding


@compiled
def rudder_share(rudder: float, aircraft: AircraftRecord) -> float:
    """Return a position of the rudder [rad] as a share of the stop on its side."""
    stop = -aircraft["stops"][2, 0] if rudder < 0.0 else aircraft["stops"][2, 1]
    return rudder / stop if stop > 0.0 else 0.0


@compiled
def note_contact(
    before: State, t: float, place: Vec3, load: float, aircraft: AircraftRecord, gear: np.void
) -> None:
    """Note what a step has brought an aircraft on the ground, and whether it is a crash.

    Args:
        before: State when the step began.
        t: That time [s].
        place: Position at its end, NED [m].
        load: Force of the ground at its end [N].
        aircraft: The aircraft.
        gear: Its gear; points that touch are noted.
    """
    stood = gear["load"] > 0.0
    gear["load"] = load / (aircraft["m"] * aircraft["g"])
    if load > 0.0 and not stood:
        _note_touchdown(before, t, gear)
    if load > 0.0:
        _note_place(place, gear)
    if gear["crash"] != 0:
        return
    touching, lies = gear["touching"], gear["belly"] == 1
    if touching[_BODY] == 1:
        gear["crash"] = BODY
    elif (touching[_RIGHT_TIP] == 1 or touching[_LEFT_TIP] == 1) and not lies:
        gear["crash"] = WING
    elif touching[_NOSE] == 1 and not lies:
        gear["crash"] = NOSE


@compiled
def note_outside(
    before: np.ndarray,
    t: float,
    after: np.ndarray,
    load: float,
    aircraft: AircraftRecord,
    gear: np.void,
) -> None:
    """Note the same of an aircraft that a simulator has flown over a period near the ground.

    Its wheels are the simulator's, what else touches the ground is judged by its place here.

    Args:
        before: State when the period began, shape (12,).
        t: That time [s].
        after: State at its end, shape (12,).
        load: Force of the ground on its wheels, as a share of the weight.
        aircraft: The aircraft.
        gear: Its gear.
    """
    p, _, phi, _ = load_state(after)
    n = mul_t(R1(phi), vec3(gear["normal"]))
    lowered = -height_above_ground(p, gear)
    for i in range(N_POINTS):
        is_wheel = i < WHEELS
        touches = load > 0.0 if is_wheel else lowered + dot(n, vec3(gear["at"][i])) > 0.0
        gear["touching"][i] = touches
    note_contact(load_state(before), t, p, load * aircraft["m"] * aircraft["g"], aircraft, gear)


@compiled
def _note_touchdown(before: State, t: float, gear: np.void) -> None:
    p, v, phi, _ = before
    n = mul_t(R1(phi), vec3(gear["normal"]))
    along, across = _wheel_axes(n, 0.0)
    sink, bank = dot(n, v), math.atan2(n[1], n[2])
    drift = dot(across, v)
    gear["touchdowns"] += 1
    worst = gear["worst"]
    if gear["touchdowns"] == 1 or sink > worst["sink"]:
        worst["time"], worst["sink"], worst["bank"], worst["drift"] = t, sink, bank, drift
        worst["pitch"], worst["speed"] = math.asin(clamp(-n[0], -1.0, 1.0)), dot(along, v)
        for axis in range(3):
            worst["position"][axis] = p[axis]
    if sink > gear["sink_max"]:
        gear["crash"] = SINK
    elif abs(bank) > gear["bank_max"]:
        gear["crash"] = BANK
    elif abs(drift) > gear["drift_max"]:
        gear["crash"] = DRIFT


@compiled
def _note_place(place: Vec3, gear: np.void) -> None:
    """Note where an aircraft that touches the ground is, beside its runway or not."""
    north, east, length, half_width = gear["runway"]
    if length == 0.0:
        return
    c, s = math.cos(gear["runway_heading"]), math.sin(gear["runway_heading"])
    along = c * (place[0] - north) + s * (place[1] - east)
    across = c * (place[1] - east) - s * (place[0] - north)
    gear["off_centre"] = max(gear["off_centre"], abs(across))
    if along < 0.0 or along > length or abs(across) > half_width:
        gear["off_runway"] = 1


@apart(x=np.zeros(12), aircraft=AIRCRAFT, gear=GEAR, felt=np.zeros(3))
def launch(
    x: np.ndarray,
    dt: float,
    thrust: float,
    aircraft: AircraftRecord,
    gear: np.void,
    felt: np.ndarray,
) -> None:
    """Hold an aircraft on its launcher, or take it along the launcher by one period.

    Args:
        x: State, shape (12,), in the order of `State`.
        dt: Length of the period [s].
        thrust: Thrust as commanded [N]: more than half of the largest one lets go.
        aircraft: The aircraft.
        gear: Its gear.
        felt: Specific force at the end of the period, body axes [m/s²], shape (3,), written.
    """
    V, length = gear["launch_speed"], gear["launch_length"]
    acceleration = 0.0
    if gear["launch_s"] > 0.0 or thrust > 0.5 * aircraft["thrust_limit"]:
        acceleration = V * V / (2.0 * length)
        begun, ended = gear["launch_s"], min(gear["launch_s"] + dt, 2.0 * length / V)
        state = load_state(x)
        moved = mul(R1(state[2]), (0.5 * acceleration * (ended * ended - begun * begun), 0.0, 0.0))
        for axis in range(3):
            x[axis] += moved[axis]
        x[3] = acceleration * ended
        gear["launch_s"] = -1.0 if ended < begun + dt else ended
    lifting = mul_t(R1(vec3(x[6:9])), (0.0, 0.0, -aircraft["g"]))
    felt[0], felt[1], felt[2] = lifting[0] + acceleration, lifting[1], lifting[2]
