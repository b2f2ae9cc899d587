"""All aircraft of a plant: their states, commands and faults as arrays."""

import math
from typing import Any, NamedTuple

import numpy as np

from mavlink_defs.constants import BRAKE, N_CHANNELS, THROTTLE
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS, MAX_FAULTS
from mavlink_defs.faults.table import FAULT, FaultTable, no_faults
from mavlink_defs.framing.codec import SIM_STATE, SIM_STEP
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.actuators.servo import SERVOS, begin_period, new_servos, sent_commands
from sitl_plant.air.disturbance import (
    Disturbances,
    disturbance_table,
    disturbances,
    disturbances_over,
)
from sitl_plant.air.turbulence import TURBULENCE, advance_turbulence, start_turbulence
from sitl_plant.air.wind import air_around, new_wind, turbulence_around
from sitl_plant.airframe.aerodynamics import FLOW
from sitl_plant.airframe.aircraft import AIRCRAFT, aircraft_record
from sitl_plant.airframe.contact import (
    GEAR,
    height_above_ground,
    launch,
    note_nearness,
)
from sitl_plant.airframe.gear import Ground
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.airframe.standing import contact_facts, describe_crash, new_gear, stand
from sitl_plant.airframe.stops import position_of, range_of
from sitl_plant.config import InitialState, PlantConfig, PlantUav
from sitl_plant.loop.period import (
    Environment,
    actuators_over,
    describe_loss,
    force_near_ground,
    is_lost,
    is_lost_on_ground,
    specific_force_at,
    step_aircraft,
    time_s,
)
from sitl_plant.sensing.failures import fault_table
from sitl_plant.sensing.sense import Sensing, sense, sensing_of
from sitl_plant.sensing.true_state import SENSORS, measure, new_sensors, true_motions
from sitl_plant.simulators.config import OwnPlant
from sitl_plant.vec3 import mul, norm, sub, vec3

OUTSIDE = np.dtype(
    [
        ("flies", "i8"),  # 1: a simulator flies the aircraft, not the plant's own equations
        ("advanced", "i8"),  # 1: it has done so; the period is still to be ended
        ("grounded", "i8"),  # 1: the aircraft had hit the ground when the period began
        ("controls", "f8", (N_CHANNELS,)),  # what its actuators do when the period ends [rad, N]
        ("wind", "f8", (3,)),  # velocity of the air around it, NED [m/s]
        ("specific_force", "f8", (3,)),  # as the simulator has it, body axes [m/s²]
    ]
)
"""An aircraft between the plant and the simulator that flies it."""

ADVANCE = -2
"""Result of `fly`: simulators are to be advanced before the period can end."""


UAV = np.dtype(
    [
        ("aircraft", AIRCRAFT),  # the true one
        ("state", "f8", (12,)),  # see `sitl_plant.airframe.rigid_body.State`
        (
            "air",
            "f8",
            (6,),
        ),  # motion of the air around it now, see `rigid_body.Air`
        ("controls", "f8", (N_CHANNELS,)),  # held: aileron, elevator, rudder [rad], thrust [N]
        ("applied", "f8", (N_CHANNELS,)),  # true positions and thrust at the last period's start
        ("faults", FAULT, (MAX_FAULTS,)),
        ("servos", SERVOS),
        ("gear", GEAR),
        ("turbulence", TURBULENCE),
        ("flow", FLOW),
        ("sensors", SENSORS),
        ("outside", OUTSIDE),
        ("message", SIM_STATE),  # the present state as the wire carries it
        ("step", SIM_STEP),  # of a flight by sensors, what is beyond them
    ]
)
"""One aircraft of the plant."""


class PlantState(NamedTuple):
    """All of n aircraft, in the order of the configuration."""

    uavs: np.ndarray  # (n,), dtype UAV
    sent: np.ndarray  # (n, depth, 4), see `sitl_plant.actuators.servo.sent_commands`
    truth: np.ndarray  # (n, depth, AXES), see `sitl_plant.sensing.true_state.true_motions`
    disturbance: np.ndarray  # (6, 3)
    disturbed: np.ndarray  # (7,): a step, -1 for none, and the disturbances at it
    wind: np.ndarray  # (1,), dtype WIND
    sensing: Sensing  # of no aircraft if all are handed their true states


_NOTHING_APPLIED = np.uint64(2**64 - 1)


def new_plant_state(config: PlantConfig) -> PlantState:
    """Return the state of a configuration's plant, at its start."""
    uavs = np.zeros(len(config.uavs), UAV)
    uavs["message"]["actuator_time_usec"] = _NOTHING_APPLIED
    uavs["servos"] = [new_servos(uav.servos, config.step_us) for uav in config.uavs]
    systems = [uav.id for uav in config.uavs]
    uavs["sensors"] = new_sensors(config.sensors, systems, config.seed, config.step_us)
    uavs["outside"]["flies"] = [not isinstance(uav.plant, OwnPlant) for uav in config.uavs]
    for own, uav in zip(uavs, config.uavs, strict=True):
        own["aircraft"] = aircraft_record(uav.aircraft)
        own["turbulence"] = turbulence_around(
            config.wind, uav.initial.altitude_m, uav.aircraft.wing_span_m
        )
        own["gear"] = new_gear(uav.aircraft, config.ground, config.runway)
        own["state"] = _initial_state(uav, own, config.ground)
        own["faults"] = no_faults(ACTUATOR_FAULTS, 1)[0]
    estimated = config.navigation == "estimated"
    fleet = PlantState(
        uavs,
        sent_commands(uavs["servos"]),
        true_motions(uavs["sensors"]),
        disturbance_table(config.disturbance),
        np.full(7, -1.0),
        new_wind(config.wind),
        new_sensing(config if estimated else config.model_copy(update={"uavs": ()})),
    )
    for i, uav in enumerate(config.uavs):
        start_turbulence(uavs[i]["turbulence"], uav.initial.airspeed_m_s, config.seed, uav.id)
        sample_air(fleet, i, 0.0)
        if not uav.initial.on_ground:  # the initial airspeed is one through the air
            uavs[i]["state"][3:6] += uavs[i]["air"][:3]
    return fleet


def new_sensing(config: PlantConfig) -> Sensing:
    """Return the sensors that a configuration's aircraft navigate by, before their first sample."""
    densities = {uav.id: uav.aircraft.air_density_kg_m3 for uav in config.uavs}
    navigation = config.sensors.navigation
    return sensing_of(navigation, config.origin, densities, config.seed, config.step_us)


def fault_tables(fleet: PlantState, i: int) -> dict[str, FaultTable]:
    """Return the faults that aircraft i can have, by the key of their family."""
    tables = {"actuator": FaultTable(ACTUATOR_FAULTS, fleet.uavs[i]["faults"])}
    if navigates(fleet):
        tables["sensor"] = fault_table(fleet.sensing.faults, i)
    return tables


def _initial_state(uav: PlantUav, own: np.void, ground: Ground) -> np.ndarray:
    """Return the state at t = 0, shape (12,); `own`, of dtype UAV, begins on the ground with it."""
    initial, gear = uav.initial, uav.aircraft.gear
    if initial.on_ground and gear is not None:
        place = initial.north_m, initial.east_m
        if gear.launcher is None:
            return stand(own["gear"], own["aircraft"], *place, math.radians(initial.yaw_deg))
        own["gear"]["launch_s"] = 0.0
        lifting = initial.model_copy(
            update={
                "altitude_m": ground.altitude_m(*place) + gear.launcher.height_m,
                "pitch_deg": gear.launcher.pitch_deg,
                "airspeed_m_s": 0.0,
            }
        )
        return _state_of(lifting)
    return _state_of(initial)


def _state_of(initial: InitialState) -> np.ndarray:
    angles = np.radians([initial.roll_deg, initial.pitch_deg, initial.yaw_deg])
    position = (initial.north_m, initial.east_m, -initial.altitude_m)
    return np.array([*position, initial.airspeed_m_s, 0.0, 0.0, *angles, 0.0, 0.0, 0.0])


@inlined
def receive_controls(fleet: PlantState, i: int, actuators: np.void) -> int:
    """Put an HIL_ACTUATOR_CONTROLS payload in force if it is newer than the last one.

    One from the future is refused: its time is the time of a state sent, and it would hold off all
    later ones.

    Args:
        fleet: The fleet.
        i: Index of the aircraft.
        actuators: Payload of dtype `mavlink_defs.framing.codec.ACTUATORS`.

    Returns:
        0 if it is in force, else NOT_NEWER, or OUT_OF_RANGE for a value that is no command.
    """
    message = fleet.uavs[i]["message"]
    last = message["actuator_time_usec"]
    if last != _NOTHING_APPLIED and actuators["time_usec"] <= last:
        return DropReason.NOT_NEWER
    if actuators["time_usec"] > message["time_usec"]:
        return DropReason.OUT_OF_RANGE
    controls = actuators["controls"]
    for c in range(N_CHANNELS):
        lowest = 0.0 if c == THROTTLE else -1.0
        if not lowest <= controls[c] <= 1.0:  # false for NaN, too
            return DropReason.OUT_OF_RANGE
    if not 0.0 <= controls[BRAKE] <= 1.0:
        return DropReason.OUT_OF_RANGE
    aircraft = fleet.uavs[i]["aircraft"]
    for c in range(N_CHANNELS):
        lowest, highest = range_of(aircraft, c)
        fleet.uavs[i]["controls"][c] = position_of(controls[c], lowest, highest)
    fleet.uavs[i]["gear"]["brake"] = controls[BRAKE]
    message["actuator_time_usec"] = actuators["time_usec"]
    return 0


@inlined
def observe(fleet: PlantState, i: int, step: int, step_us: int) -> None:
    """Write what aircraft i measures at a step into its FTC_SIM_STATE payload.

    Position and velocity are true; what else it senses has the errors of its sensors. In a flight
    by sensors the payload is true, and what they report is in `fleet.sensing`.
    """
    uav = fleet.uavs[i]
    message, x = uav["message"], uav["state"]
    message["time_usec"] = step * step_us
    message["step"] = step
    around = Environment(
        uav["servos"],
        uav["faults"],
        fleet.wind[0],
        uav["turbulence"],
        uav["aircraft"],
        uav["gear"],
        uav["flow"],
    )
    d_v, _ = _disturbances_at(fleet, step, step_us)
    air = vec3(uav["air"][:3]), vec3(uav["air"][3:])
    if uav["outside"]["flies"] == 1 or uav["gear"]["launch_s"] >= 0.0:
        force = vec3(uav["outside"]["specific_force"])
    elif uav["gear"]["near"] == 1:
        force = force_near_ground(x, step, step_us, d_v, air, around)
    else:
        force = specific_force_at(x, step, step_us, d_v, air, around)
    for k in range(3):
        message["position"][k] = x[k]
        message["velocity"][k] = x[3 + k]
        message["attitude"][k] = x[6 + k]
        message["rates"][k] = x[9 + k]
        message["specific_force"][k] = force[k]
        message["wind"][k] = uav["air"][k]
    if navigates(fleet):
        sense(fleet.sensing, i, step, message)
    else:
        measure(uav["sensors"], fleet.truth[i], step, message)


@inlined
def navigates(fleet: PlantState) -> bool:
    """Return whether autopilots are sent what sensors report, in place of the true state."""
    return len(fleet.sensing.sites) > 0


@inlined
def fly(fleet: PlantState, step: int, step_us: int) -> int:
    """Advance every aircraft from a step to the next.

    One that is below the ground at this step has hit it: so the record of its states has where.

    Returns:
        Index of the first aircraft that hit the ground or left the model's range of validity, or
        -1. Or `ADVANCE`: `loop.simulators` is to advance those that simulators fly, from what is
        in `fleet.uavs["outside"]`, after which a second call ends the period.
    """
    if fleet.uavs[0]["outside"]["advanced"] == 0 and _begin(fleet, step, step_us):
        return ADVANCE
    return _end(fleet, step, step_us)


@inlined
def _begin(fleet: PlantState, step: int, step_us: int) -> bool:
    """Begin a period, and fly what the plant flies; return whether simulators fly the others."""
    t, dt = time_s(step, step_us), step_us / 1e6
    now = _disturbances_at(fleet, step, step_us)
    disturbed = disturbances_over(now, fleet.disturbance, t, dt)
    if t + dt == time_s(step + 1, step_us):
        _note_disturbances(fleet, step + 1, disturbed[2])
    any_outside = False
    for i in range(len(fleet.uavs)):
        uav = fleet.uavs[i]
        outside = uav["outside"]
        gear = uav["gear"]
        if gear["has"] == 1:
            outside["grounded"] = gear["crash"] != 0
            note_nearness(uav["state"], dt, gear)
        else:
            outside["grounded"] = height_above_ground(vec3(uav["state"][0:3]), gear) < 0.0
        commanded = uav["message"]["actuator_time_usec"] != _NOTHING_APPLIED
        begin_period(
            uav["servos"], fleet.sent[i], uav["controls"], uav["faults"], step, t, commanded
        )
        around = Environment(
            uav["servos"],
            uav["faults"],
            fleet.wind[0],
            uav["turbulence"],
            uav["aircraft"],
            uav["gear"],
            uav["flow"],
        )
        V = norm(sub(vec3(uav["state"][3:6]), vec3(uav["air"][:3])))
        if gear["launch_s"] >= 0.0:
            actuators_over(t, dt, around, V, uav["applied"], outside["controls"])
            thrust = uav["controls"][THROTTLE]
            launch(uav["state"], dt, thrust, uav["aircraft"], gear, outside["specific_force"])
            continue
        if outside["flies"] == 0:
            step_aircraft(uav["state"], t, dt, disturbed, around, V, uav["applied"])
            continue
        any_outside = True
        actuators_over(t, dt, around, V, uav["applied"], outside["controls"])
        wind = mul(R1(vec3(uav["state"][6:9])), vec3(uav["air"][:3]))
        for k in range(3):
            outside["wind"][k] = wind[k]
    return any_outside


@inlined
def _end(fleet: PlantState, step: int, step_us: int) -> int:
    """End a period; return the index of the first aircraft that is lost, or -1."""
    dt, lost = step_us / 1e6, -1
    for i in range(len(fleet.uavs)):
        uav = fleet.uavs[i]
        uav["outside"]["advanced"] = 0
        if fleet.wind[0]["still"] == 0:
            V = norm(sub(vec3(uav["state"][3:6]), vec3(uav["air"][:3])))
            system, seed = uav["sensors"]["system"], uav["sensors"]["seed"]
            advance_turbulence(uav["turbulence"], V, dt, seed, system, step + 1)
            sample_air(fleet, i, time_s(step + 1, step_us))
        hit_ground = uav["outside"]["grounded"] == 1
        if uav["gear"]["near"] == 1 or uav["gear"]["launch_s"] >= 0.0:
            left = is_lost_on_ground(uav["state"], uav["air"][:3])
        else:
            left = is_lost(uav["state"], uav["air"][:3])
        if lost < 0 and (hit_ground or left):
            lost = i
    return lost


def contacts_of(fleet: PlantState) -> list[dict[str, Any] | None]:
    """Return what became of each aircraft on the ground, see `contact_facts`."""
    return [contact_facts(gear) for gear in fleet.uavs["gear"]]


def loss_of(fleet: PlantState, i: int) -> str:
    """Describe in what way aircraft i is lost."""
    uav = fleet.uavs[i]
    if uav["gear"]["crash"] != 0:
        return describe_crash(uav["gear"])
    return describe_loss(uav["state"], uav["air"][:3], float(uav["aircraft"]["stall"]))


@inlined
def _disturbances_at(fleet: PlantState, step: int, step_us: int) -> Disturbances:
    """Return the disturbances at a step, which all aircraft share: evaluated for the first one."""
    memory = fleet.disturbed
    if memory[0] != step:
        now = disturbances(fleet.disturbance, time_s(step, step_us))
        _note_disturbances(fleet, step, now)
    return vec3(memory[1:4]), vec3(memory[4:7])


@inlined
def _note_disturbances(fleet: PlantState, step: int, at_step: Disturbances) -> None:
    memory = fleet.disturbed
    memory[0] = step
    for k in range(3):
        memory[1 + k], memory[4 + k] = at_step[0][k], at_step[1][k]


@compiled
def sample_air(fleet: PlantState, i: int, t: float) -> None:
    """Note the motion of the air around aircraft i at a time [s]."""
    uav = fleet.uavs[i]
    x = uav["state"]
    air = air_around(fleet.wind[0], uav["turbulence"], vec3(x[0:3]), vec3(x[6:9]), t)
    for k in range(3):
        uav["air"][k], uav["air"][3 + k] = air[0][k], air[1][k]
