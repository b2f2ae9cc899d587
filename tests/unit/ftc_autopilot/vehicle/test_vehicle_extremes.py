"""No message of the dialect, whatever its fields hold, can stop a vehicle."""

import math
from typing import Any

import pytest
from vehicle_bench import Bench

from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse

pytestmark = pytest.mark.slow

UAV = 1
GCS = FramePacker(255, 190)
LIMITS = {
    "uint8_t": 2**8,
    "uint16_t": 2**16,
    "uint32_t": 2**32,
    "uint64_t": 2**64,
    "int8_t": 2**7,
    "int16_t": 2**15,
    "int32_t": 2**31,
    "int64_t": 2**63,
}
FLOATS = (0.0, -0.0, math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-45)
CASES = range(len(FLOATS))


def value_of(name: str, kind: str, case: int) -> Any:
    if name == "target_system":
        return UAV
    if name == "target_component":
        return 1
    if kind == "char":
        return b"K1_ROLL" if case % 2 else b"\xff" * 4
    if kind in {"float", "double"}:
        return FLOATS[case]
    limit = LIMITS[kind]
    low = -limit if kind.startswith("int") else 0
    return (low, limit - 1, 0, 1, limit // 2, 2, limit - 2, 5)[case]


def message_with(cls: Any, case: int) -> Any:
    lengths = dict(zip(cls.ordered_fieldnames, cls.array_lengths, strict=True))
    values = {}
    for name, kind in zip(cls.fieldnames, cls.fieldtypes, strict=True):
        value = value_of(name, kind, case)
        values[name] = [value] * lengths[name] if lengths[name] and kind != "char" else value
    return cls(**values)


def listen(bench: Bench) -> None:
    """Everything that the vehicle says can be packed."""
    own = FramePacker(UAV, 1)
    for message in (*bench.vehicle.gcs_messages(), *bench.vehicle.simulator_messages()):
        assert parse(own.pack(message)) is not None


@pytest.mark.parametrize("running", [False, True])
def test_every_message_with_extreme_fields(running: bool, scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    if running:
        bench.run()
    for cls in dialect.mavlink_map.values():
        for case in CASES:
            received = parse(GCS.pack(message_with(cls, case)))
            assert received is not None, cls.msgname
            bench.now += 0.1
            bench.vehicle.receive(received, bench.now)
            bench.vehicle.handle_timer(bench.now)
            listen(bench)


@pytest.mark.parametrize("form", ["LONG", "INT"])
def test_every_command_with_extreme_parameters(form: str, scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.upload(scenario1)
    bench.run()
    for number in {*dialect.enums["MAV_CMD"], 0, 65535} & {*range(65536)}:
        for extreme in FLOATS:
            params: Any = [extreme] * 7
            if form == "LONG":
                message: Any = dialect.MAVLink_command_long_message(UAV, 1, number, 0, *params)
            else:
                fields: Any = (*params[:4], 2**31 - 1, -(2**31), extreme)
                message = dialect.MAVLink_command_int_message(UAV, 1, 0, number, 0, 0, *fields)
            received = parse(GCS.pack(message))
            assert received is not None
            bench.now += 2.0
            bench.vehicle.receive(received, bench.now)
            bench.vehicle.handle_timer(bench.now)
            listen(bench)


def test_the_vehicle_still_flies_after_all_that(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.run()
    for case in CASES:
        for name in ("set_attitude_target", "param_set", "command_long", "set_mode"):
            cls = getattr(dialect, f"MAVLink_{name}_message")
            bench.vehicle.modes.mode = 15
            received = parse(GCS.pack(message_with(cls, case)))
            assert received is not None
            bench.vehicle.receive(received, bench.now)
    assert all(math.isfinite(float(x)) for x in bench.controllers.uavs[0]["guidance"]["command"])
    assert math.isfinite(float(bench.controllers.uavs[0]["parameters"]["proposed"]["K1"][0, 1]))
