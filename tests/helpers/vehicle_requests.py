"""Whatever a ground station may ask of a vehicle, and what the vehicle is before and after."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from vehicle_bench import ACCEPTED, UAV, Bench, of_type

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.hot.checkpoint import VEHICLE
from ftc_autopilot.hot.restart import saved_parts
from ftc_autopilot.vehicle.mission_checkpoint import load_mission, save_mission
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

Request = Callable[[Bench], bool]
"""Asks something of a vehicle; returns whether it was accepted."""

ORIGIN = Origin()
_COMMANDS = sorted(
    {number for number in dialect.enums["MAV_CMD"] if number < 53_000}  # the others are private
    - {dialect.MAV_CMD_INJECT_FAILURE}  # for the simulator
)
_OURS = [
    *(16, 17, 20, 21, 22, 112, 176, 177, 178, 179, 192, 224, 300, 400, 410, 510, 511, 512, 520),
    dialect.MAV_CMD_FTC_SET_SLOT,
]


def numbers() -> st.SearchStrategy[float]:
    """Draw a parameter: modes, item numbers, speeds, radii, and what no parameter should be."""
    usual = [0.0, 1.0, 2.0, 3.0, -1.0, 10.0, 11.0, 12.0, 15.0, 40.0, 45.0, 59.0, 300.0, 600.0]
    wild = [math.nan, math.inf, -math.inf, 1e30, -5.0, 0.5, 1e6, 2000.0]
    return st.one_of(st.sampled_from(usual), st.sampled_from(wild), st.floats(-1e3, 1e3, width=32))


def places() -> st.SearchStrategy[tuple[int, int]]:
    """Draw latitude and longitude [degE7], most of them near the origin."""
    metres = st.floats(-6e3, 6e3)
    near = st.builds(lambda north, east: place_of(ORIGIN, north, east, 0.0)[:2], metres, metres)
    wild = [(0, 0), (INT32_MAX, INT32_MAX), (91 * 10**7, 0), (-(10**9), 181 * 10**7)]
    far = place_of(ORIGIN, 150e3, 0.0, 0.0)[:2]
    return st.one_of(near, near, st.sampled_from([*wild, far]))


def altitudes() -> st.SearchStrategy[float]:
    """Draw an altitude [m]."""
    wild = [math.nan, math.inf, -500.0, -1.0, 5e4, 1e30]
    usual = [0.0, 90.0, 100.0, 150.0, 300.0, 684.0, 700.0]
    return st.one_of(st.sampled_from(usual), st.sampled_from(usual), st.sampled_from(wild))


FRAMES = st.sampled_from([0, 3, 5, 6, 6, 8])


@st.composite
def items(draw: st.DrawFn) -> MissionItem:
    """Draw a mission item; every other one is a waypoint that can be flown."""
    (x, y), z = draw(places()), draw(altitudes())
    if draw(st.booleans()):
        return mission_item(0, 16, (), x, y, draw(st.sampled_from([90.0, 100.0, 110.0])))
    command = draw(st.sampled_from([16, 17, 18, 19, 20, 22, 112, 177, 178, 179, 53_100, 21]))
    params = [draw(numbers()) for _ in range(4)]
    return mission_item(0, command, params, x, y, z, draw(FRAMES))


@st.composite
def requests(draw: st.DrawFn) -> Request:
    """Draw a request of any kind."""
    kinds = (_commands(), _commands(), _likely(), _likely(), _uploads(), _messages(), _movements())
    request: Request = draw(st.one_of(*kinds))
    return request


@st.composite
def _commands(draw: st.DrawFn) -> Request:
    number = draw(st.one_of(*[st.sampled_from(_OURS)] * 3, st.sampled_from(_COMMANDS)))
    p: Any = [draw(numbers()) for _ in range(4)]
    if number == dialect.MAV_CMD_DO_SET_MISSION_CURRENT:
        p[0] = float(draw(st.integers(-1, 6)))
    (x, y), z = draw(places()), draw(altitudes())
    message: Any
    if draw(st.booleans()):
        frame = draw(FRAMES)
        where: Any = (x, y, z)
        message = dialect.MAVLink_command_int_message(UAV, 1, frame, number, 0, 0, *p, *where)
    else:
        where = (x / 1e7, y / 1e7, z)
        message = dialect.MAVLink_command_long_message(UAV, 1, number, 0, *p, *where)
    return lambda bench: _answer(bench, message, "COMMAND_ACK", "result")


@st.composite
def _likely(draw: st.DrawFn) -> Request:
    """Draw a command that is accepted more often than not."""
    seq, mode = float(draw(st.integers(0, 4))), draw(st.sampled_from([10, 11, 12, 15]))
    (x, y), height = place_of(ORIGIN, 100.0, 100.0, 0.0)[:2], draw(st.integers(-80, 80))
    usual: dict[int, tuple[float, ...]] = {
        dialect.MAV_CMD_DO_SET_MISSION_CURRENT: (seq,),
        dialect.MAV_CMD_DO_SET_MODE: (1.0, mode),
        dialect.MAV_CMD_DO_CHANGE_SPEED: (0.0, 38.0 + seq),
        dialect.MAV_CMD_DO_SET_HOME: (0.0, 0.0, 0.0, 0.0, x / 1e7, y / 1e7, 584.0 + height),
        dialect.MAV_CMD_DO_REPOSITION: (-1.0, 1.0, 0.0, 0.0, x / 1e7, y / 1e7, 100.0),
    }
    number = draw(st.sampled_from(list(usual)))
    seven: Any = (*usual[number], *[0.0] * 7)[:7]
    message = dialect.MAVLink_command_long_message(UAV, 1, number, 0, *seven)
    return lambda bench: _answer(bench, message, "COMMAND_ACK", "result")


@st.composite
def _uploads(draw: st.DrawFn) -> Request:
    mission = draw(st.lists(items(), max_size=5))
    for seq, item in enumerate(mission, start=1):
        item.seq = seq
    whole = (mission_item(0, 16), *mission)
    return lambda bench: bench.upload_items(whole) == dialect.MAV_MISSION_ACCEPTED


@st.composite
def _messages(draw: st.DrawFn) -> Request:
    (x, y), z = draw(places()), draw(altitudes())
    kind, number, frame = draw(st.integers(0, 5)), draw(numbers()), draw(FRAMES)
    names = [b"K1_ROLL", b"TRIG_MODE", b"STEP_US", b"NONE", b"PHI_V0", b"TRIG_B1"]
    item = draw(items())
    item.target_system, item.target_component = UAV, 1
    item.current = draw(st.sampled_from([2, 2, 3]))
    seq = draw(st.integers(0, 6))
    target = dialect.MAVLink_set_position_target_global_int_message(
        0, UAV, 1, frame, 0b111111111000, x, y, z, *[0.0] * 8
    )
    cases: tuple[tuple[Any, str, str], ...] = (
        (item, "MISSION_ACK", "type"),
        (
            dialect.MAVLink_param_set_message(UAV, 1, draw(st.sampled_from(names)), number, 9),
            "",
            "",
        ),
        (dialect.MAVLink_mission_set_current_message(UAV, 1, seq), "", ""),
        (target, "", ""),
        (dialect.MAVLink_mission_clear_all_message(UAV, 1, 0), "MISSION_ACK", "type"),
        (dialect.MAVLink_set_mode_message(UAV, 1, draw(st.sampled_from([10, 11, 12, 7]))), "", ""),
    )
    return lambda bench: _answer(bench, *cases[kind])


@st.composite
def _movements(draw: st.DrawFn) -> Request:
    """Draw what happens without a request: time and the aircraft move on."""
    north, east = draw(st.floats(-5e3, 5e3)), draw(st.floats(-5e3, 5e3))
    steps = draw(st.integers(0, 5000))

    def move(bench: Bench) -> bool:
        bench.run()
        bench.hot.step += steps
        bench.hot.measured["position"] = (north, east, -100.0)
        if bench.vehicle.modes.path.flown:
            bench.controllers.uavs[0]["guidance"]["path_position"] += 0.04 * steps
        bench.now += 1.0
        bench.vehicle.handle_timer(bench.now)
        bench.vehicle.gcs_messages()
        return True

    return move


def _answer(bench: Bench, message: Any, name: str, field: str) -> bool:
    """Send a message; what has no answer is refused by a STATUSTEXT of warning."""
    answers = bench.say(message)
    if name:
        (ack,) = of_type(answers, name)
        return bool(getattr(ack, field) == ACCEPTED)
    return not any(text.severity <= 4 for text in of_type(answers, "STATUSTEXT"))


def start_flight(bench: Bench, mission: Sequence[MissionItem]) -> None:
    """Fly a mission."""
    bench.hot.measured["position"] = (0.0, 0.0, -100.0)
    assert bench.upload_items((mission_item(0, 16), *mission)) == ACCEPTED
    assert bench.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    bench.run()
    assert bench.command(dialect.MAV_CMD_MISSION_START) == ACCEPTED


def state_of(bench: Bench) -> dict[str, Any]:
    """Return all that a request may change: what a checkpoint has, and what stations see."""
    vehicle, kept = bench.vehicle, np.zeros(1, VEHICLE)
    vehicle.save(kept[0])
    own = bench.autopilots.own
    own["vehicle"] = kept
    memory = own.view(np.uint8)
    records = [memory[first:end] for first, end in saved_parts(own[0])]
    server, params = vehicle._plan.mission.server, vehicle._params._parameters
    _, mission = vehicle.mission_checkpoint()
    return {
        "records": [record.tobytes() for record in (*records, bench.controllers.paths)],
        "mission": [_content(item) for item in mission.items],
        "home": mission.home,
        "airspeed": mission.airspeed,
        "current": server.current,
        "mode": (vehicle.modes.mode, vehicle.modes.armed, vehicle.modes.current_item()),
        "params": [param.get() for param in params],
        "intervals": [dict(telemetry._intervals_us) for telemetry in vehicle.telemetry],
    }


def _content(item: MissionItem) -> bytes:
    """Return all of an item that is flown, as bytes: NaN is equal to itself there."""
    i = item
    numbers = (i.param1, i.param2, i.param3, i.param4, i.z, i.x, i.y, i.seq, i.command, i.frame)
    return np.array(numbers).tobytes()


def second_process(bench: Bench, scenario: Scenario, folder: Path) -> Bench:
    """Return the vehicle after the death of its process, with the next state of the plant."""
    second = Bench(scenario)
    old, new = bench.autopilots.own, second.autopilots.own
    bench.vehicle.save(old[0]["vehicle"])
    for first, end in saved_parts(old[0]):
        new.view(np.uint8)[first:end] = old.view(np.uint8)[first:end]
    second.controllers.paths[...] = bench.controllers.paths
    save_mission(folder / "mission", bench.vehicle.mission_checkpoint()[1])
    second.vehicle.resume(new[0]["vehicle"], load_mission(folder / "mission"))
    for name in bench.hot.measured.dtype.names or ():
        second.hot.measured[name] = bench.hot.measured[name]
    second.now = bench.now
    return second
