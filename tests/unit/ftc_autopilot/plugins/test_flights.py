"""Laws and triggers of files, flown: three ways of writing one, copies, parameters, failures."""

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from own_laws import (
    COMPILED,
    COMPILER,
    GUIDANCE,
    HEAD,
    LAWS,
    TRIGGERS,
    C,
    build,
    write_guidance,
    write_law,
    write_trigger,
)
from vehicle_bench import Bench

from ftc_autopilot.control.controllers import Controllers, reset_controllers
from ftc_autopilot.hot.checkpoint import restore, save
from ftc_autopilot.hot.restart import with_checkpoint
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.vehicle.param_table import parameters_of
from gcs.fleet.in_process import begin, fly_in_process, fly_on
from gcs.results.recording import Recording, Steps
from gcs.results.summary import summarise
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged

BASE = "paper/scenario1"
WAYS = [
    way
    if way != "library"
    else pytest.param(way, marks=pytest.mark.skipif(COMPILER is None, reason="no C compiler"))
    for way in LAWS
]


def scenario(folder: Path, duration_s: float = 0.3, base: str = BASE, **changes: Any) -> Scenario:
    tree = scenario_tree(base) | {"duration_s": duration_s, "faults": []} | changes
    return scenario_of(folder / "s.yaml", tree)


def same(one: Recording, other: Recording) -> bool:
    names = ("demand", "held", "events", "error", "sync_error")
    signals = all(np.array_equal(one.signals[n], other.signals[n], equal_nan=True) for n in names)
    return signals and bool(np.array_equal(one.states, other.states))


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_a_law_written_three_times_flies_to_the_same_bits(tmp_path: Path) -> None:
    flights = [
        fly_in_process(scenario(tmp_path, controller={"kind": write_law(tmp_path / way, way)}))
        for way in LAWS
    ]
    assert flights[0].loss is None
    assert np.abs(flights[0].signals["demand"][-1]).min() > 0.0
    assert all(same(flights[0], other) for other in flights[1:])


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_a_trigger_written_three_times_sends_the_same(tmp_path: Path) -> None:
    flights = [
        fly_in_process(
            scenario(
                tmp_path,
                controller={"kind": "pid"},
                trigger={"mode": write_trigger(tmp_path / way, way), "nth": 11, "b2_deg": 0.1},
            )
        )
        for way in TRIGGERS
    ]
    sent = np.flatnonzero(flights[0].signals["events"][:, 0])
    assert len(sent) > 3
    assert set(sent % 11) == {0}
    assert all(same(flights[0], other) for other in flights[1:])


@pytest.mark.parametrize("way", WAYS)
def test_a_law_of_a_file_is_found_beside_the_scenario(tmp_path: Path, way: str) -> None:
    write_law(tmp_path / "laws", way)
    (tmp_path / "s.yaml").write_text(
        f"extends: {BASE}\nduration_s: 0.05\ncontroller: {{kind: laws/mine.py:Mine}}\n"
    )
    from gcs.scenario.model import load_scenario

    loaded = load_scenario(tmp_path / "s.yaml")
    assert loaded.controller.kind == f"{tmp_path / 'laws' / 'mine.py'}:Mine"
    assert loaded.autopilot_config(1).controller == loaded.controller.with_servos(
        loaded.servos.by_actuator()
    )
    assert fly_in_process(loaded).loss is None


def copied(controllers: Controllers) -> Controllers:
    return Controllers(*(array.copy() for array in controllers))


@pytest.mark.parametrize("way", WAYS)
def test_a_copy_of_a_flight_goes_on_as_the_flight_does(tmp_path: Path, way: str) -> None:
    flown = scenario(tmp_path, 0.2, controller={"kind": write_law(tmp_path, way)})
    flight = begin(flown)
    half = flown.model_copy(update={"duration_s": 0.1})
    fly_on(half, flight, Steps.room(200, 3).part)
    copy = flight._replace(
        fleet=deepcopy(flight.fleet),
        controllers=copied(flight.controllers),
    )
    ends = []
    for one in (flight, copy):
        steps = Steps.room(200, 3)
        fly_on(flown, one, steps.part, first=100)
        ends.append(steps.states[199].copy())
    assert np.array_equal(*ends)
    assert not np.array_equal(ends[0], steps.states[100])


@pytest.mark.parametrize("way", WAYS)
def test_a_law_keeps_its_state_over_a_restart_of_its_process(tmp_path: Path, way: str) -> None:
    name = write_law(tmp_path, way)
    config = scenario(tmp_path, controller={"kind": name}).autopilot_config(1)
    autopilot, _ = with_checkpoint(new_autopilots([config]), config, tmp_path / "checkpoint")
    controllers = autopilot.controllers
    state = controllers.uavs[0]["controller"]["plugin"]["own"]["numbers"]
    state[:2] = 2.5, np.int64(7).view("f8")
    save(autopilot.checkpoint, autopilot.own, autopilot.edges)
    reset_controllers(controllers)
    assert state[0] == 0.0
    assert restore(autopilot.checkpoint, autopilot.own, autopilot.edges[0])
    assert state[0] == 2.5
    assert state.view("i8")[1] == 7


@pytest.mark.parametrize("way", WAYS)
def test_its_numbers_are_parameters_of_the_vehicle(tmp_path: Path, way: str) -> None:
    trigger = {"mode": write_trigger(tmp_path / "t", "plain")}
    law = {"kind": write_law(tmp_path, way), "limit_deg": 12.0}
    flown = scenario(tmp_path, controller=law, trigger=trigger)
    bench = Bench(flown)
    found = parameters_of(flown.autopilot_config(1), bench.hot, bench.controllers)
    parameters: Any = {one.name: one for one in found}
    assert parameters["LIMIT_DEG"].get() == 12.0
    assert parameters["TRIG_NTH"].get() == 7
    assert parameters["CTRL_LAW"].get() == 5
    assert parameters["TRIG_MODE"].get() == 8
    parameters["LIMIT_DEG"].set(15.0)
    numbers = bench.controllers.uavs[0]["parameters"]["plugin"]["own"]["numbers"]
    assert numbers[3] == np.radians(15.0)
    parameters["TRIG_MODE"].set(0)
    parameters["TRIG_MODE"].set(8)
    with pytest.raises(ValueError, match="must be in"):
        parameters["TRIG_MODE"].set(9)


def test_the_mavlink_messages_of_its_state_are_made(tmp_path: Path) -> None:
    text = COMPILED.replace('("integral", "f8")', '("integral", "f8"), ("Phi_v", "f8")')
    (tmp_path / "mine.py").write_text(text)
    bench = Bench(scenario(tmp_path, controller={"kind": f"{tmp_path}/mine.py:Mine"}))
    bench.controllers.uavs[0]["controller"]["plugin"]["own"]["numbers"][1] = 3.5
    (telemetry,) = bench.vehicle.telemetry
    every: list[Any] = [telemetry.make(i) for i in telemetry.available]
    made = {message.get_type(): message for message in every}
    assert made["FTC_ADAPTATION"].phi_v == 3.5
    assert "FTC_DIAGNOSIS" in made


def failing(tmp_path: Path, body: str, decorator: str = "") -> str:
    text = f"""
import numpy as np
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command
from mavlink_defs.runtime.jit import compiled


class Bad(LawParameters):
    @staticmethod{decorator}
    def step(now, aircraft, gains, state):
        {body}
        return Command((0.0, 0.0, 0.0), 900.0, ALL)
"""
    (tmp_path / "bad.py").write_text(text)
    return f"{tmp_path}/bad.py:Bad"


COMPILED_ONE = "\n    @compiled"


@pytest.mark.parametrize(
    ("body", "decorator", "reason"),
    [
        ("if now.t > 0.1: 1 / 0", "", "bad.py:11: ZeroDivisionError: division by zero"),
        (
            "if now.t > 0.1: raise ValueError('too late')",
            COMPILED_ONE,
            "bad.py:12: ValueError: too late",
        ),
        ("if now.t > 0.1: return 3", "", "expected Command(delta, thrust, channels), delta three"),
        (
            "if now.t > 0.1: return Command((0.0, np.nan, 0.0), 900.0, ALL)",
            COMPILED_ONE,
            "it gave a command that is not finite",
        ),
        (
            "if now.t > 0.1: return Command((0.0, 0.0, 0.0), np.inf, ALL)",
            "",
            "it gave a command that is not finite",
        ),
    ],
)
def test_a_failure_ends_the_flight_and_names_the_law(
    tmp_path: Path, body: str, decorator: str, reason: str, capfd: pytest.CaptureFixture[str]
) -> None:
    flown = scenario(tmp_path, controller={"kind": failing(tmp_path, body, decorator)})
    assert capfd.readouterr().err.startswith(f"runs {tmp_path}/bad.py, code ")
    flight = fly_in_process(flown)
    assert flight.loss is not None
    assert flight.loss.startswith("UAV 1: the law bad.py:Bad failed at 0.101 s: ")
    assert reason in flight.loss
    assert len(flight.states) == 102
    summary = summarise(flight, flown)
    assert summary.loss == flight.loss
    assert summary.control_failed
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_a_status_of_a_library_ends_the_flight(tmp_path: Path) -> None:
    name = write_law(tmp_path, "library")
    build(
        tmp_path, C.replace("    return 0;\n}\n\nFTC", "    return in->t > 0.1 ? 42 : 0;\n}\n\nFTC")
    )
    flight = fly_in_process(scenario(tmp_path, controller={"kind": name}))
    assert flight.loss == "UAV 1: the law mine.py:Mine failed at 0.101 s: it returned 42"


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_a_library_is_initialised_before_its_first_step(tmp_path: Path) -> None:
    name = write_law(tmp_path, "library")
    init = """
static int32_t init(const void *parameters, void *memory, const struct ftc_aircraft *aircraft) {
    (void)parameters;
    ((struct state *)memory)->steps = (int64_t)aircraft->m;
    return ((struct state *)memory)->integral == 0.0 ? 0 : 9;
}

FTC_LAW"""
    text = C.replace("FTC_LAW", init).replace(", 0, step)", ", init, step)")
    build(tmp_path, text)
    flown = scenario(tmp_path, 0.05, controller={"kind": name})
    flight = begin(flown)
    fly_on(flown, flight, Steps.room(50, 3).part)
    numbers = flight.controllers.uavs["controller"]["plugin"]["own"]["numbers"]
    steps = np.ascontiguousarray(numbers[:, 1]).view("i8")
    assert steps.tolist() == [int(flown.aircraft.mass_kg) + 50] * 3


def test_a_trigger_that_fails_ends_the_flight(tmp_path: Path) -> None:
    text = TRIGGERS["plain"].replace('    state["steps"] += 1', '    state["steps"] += now.missing')
    (tmp_path / "mine.py").write_text(text)
    flight = fly_in_process(scenario(tmp_path, trigger={"mode": f"{tmp_path}/mine.py:Mine"}))
    assert flight.loss is not None
    assert flight.loss.startswith("UAV 1: the trigger mine.py:Mine failed at 0.000 s: ")
    assert (
        "mine.py:17: AttributeError: 'Candidates' object has no attribute 'missing'" in flight.loss
    )


def test_ctrl_c_in_a_plain_law_is_no_failure_of_the_law(tmp_path: Path) -> None:
    name = failing(tmp_path, "if now.t > 0.1: raise KeyboardInterrupt")
    with pytest.raises(KeyboardInterrupt):
        fly_in_process(scenario(tmp_path, controller={"kind": name}))


@pytest.mark.parametrize("slips", [False, True])
def test_a_law_that_extends_surviving_flies_as_it_does(tmp_path: Path, slips: bool) -> None:
    """Its state is as large as that of any law of ours; what slips holds its heading by bank."""
    changed: dict[str, Any] = {"trigger": {}}
    if slips:
        slipping = {"coefficients": {"cY_dr": 1.2}}
        aircraft = merged(load_aircraft("aerosonde").model_dump(), slipping)
        changed |= {"base": "airframes/aerosonde", "aircraft": aircraft}
    (tmp_path / "mine.py").write_text(
        """
from ftc_autopilot.control.laws.surviving import Surviving, surviving_law
from mavlink_defs.runtime.jit import compiled


class Mine(Surviving):
    kind: str = "mine"

    @staticmethod
    @compiled
    def step(now, aircraft, gains, state, signals):
        return surviving_law(now, aircraft, gains, state, signals)
"""
    )
    scenarios = [
        scenario(tmp_path, 0.4, controller={"kind": kind}, **changed)
        for kind in ("surviving", f"{tmp_path}/mine.py:Mine")
    ]
    assert [one.trigger.mode for one in scenarios] == ["scaled", "scaled"]
    flights = list(map(fly_in_process, scenarios))
    assert same(*flights)
    assert np.array_equal(flights[0].signals["phase"], flights[1].signals["phase"])


def test_a_changed_law_is_another_one_in_the_same_process(tmp_path: Path) -> None:
    name = write_law(tmp_path, "compiled")
    before = fly_in_process(scenario(tmp_path, 0.05, controller={"kind": name}))
    (tmp_path / "mine.py").write_text(COMPILED.replace("9.0 * aircraft", "8.0 * aircraft"))
    after = fly_in_process(scenario(tmp_path, 0.05, controller={"kind": name}))
    assert not np.array_equal(before.signals["demand"][:, :, 3], after.signals["demand"][:, :, 3])
    assert HEAD.count("9.0 * aircraft") == 1


def on_path(folder: Path, duration_s: float = 1.0, **guidance: Any) -> Scenario:
    tree = scenario_tree("missions/race_track") | {"duration_s": duration_s, "guidance": guidance}
    return scenario_of(folder / "s.yaml", tree)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_a_guidance_law_written_four_times_flies_to_the_same_bits(tmp_path: Path) -> None:
    flights = [
        fly_in_process(on_path(tmp_path, kind=write_guidance(tmp_path / way, way)))
        for way in GUIDANCE
    ]
    path = fly_in_process(on_path(tmp_path, kind="path"))
    assert flights[0].loss is None
    assert all(same(flights[0], other) for other in flights[1:])
    faster = flights[0].signals["command"][-1, :, 0] - path.signals["command"][-1, :, 0]
    assert (faster > 0.5).all()


def test_the_gains_of_path_are_those_that_a_law_declares(tmp_path: Path) -> None:
    """A law that changes nothing flies as `path`, with the gains that it has in common."""
    text = GUIDANCE["plain"].replace("    return airspeed,", "    return command or airspeed,")
    (tmp_path / "mine.py").write_text(
        text.replace("command or airspeed, ", "command or (airspeed, ").replace(
            "command[3]\n", "command[3])\n"
        )
    )
    name = f"{tmp_path}/mine.py:Mine"
    same_gain, less = (
        fly_in_process(on_path(tmp_path, 3.0, kind=name, cross_track_1_s=gain))
        for gain in (0.8, 0.2)
    )
    path = fly_in_process(on_path(tmp_path, 3.0, kind="path"))
    assert same(same_gain, path)
    assert not same(less, path)


def test_a_guidance_law_that_fails_ends_the_flight(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(GUIDANCE["plain"].replace("return airspeed,", "return"))
    flight = fly_in_process(on_path(tmp_path, kind=f"{tmp_path}/mine.py:Mine"))
    assert flight.loss is not None
    assert flight.loss.startswith("UAV 1: the guidance law mine.py:Mine failed at 0.000 s: ")
    assert "expected four numbers: airspeed, roll, pitch, yaw, got (" in flight.loss
