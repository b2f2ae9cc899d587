"""Figures of a flight: what is counted where an autopilot knew nothing, and what was lost."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from ftc_autopilot.control.signals import SIGNALS, no_signals
from gcs.reports.flight import flight_tables
from gcs.results.figures import FlightSummary
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario
from gcs.scenario.sections import ScenarioFault

STEPS = 40


def straight(loss: str | None = None) -> Recording:
    """Two UAVs at 40 m/s, level to the North; the commands count the steps, all else is 0."""
    states = np.zeros((STEPS, 2, 12))
    states[:, :, 3] = 40.0
    signals = np.zeros((STEPS, 2), SIGNALS)
    signals["V"] = 40.0
    signals["path_position"] = np.nan
    signals["command"][..., 0] = signals["reference"][..., 0] = np.arange(STEPS)[:, None]
    return Recording(
        mode="real_time",
        step_us=100_000,
        uav_ids=(1, 2),
        states=states,
        wind=np.zeros((STEPS, 2, 3)),
        applied=np.zeros((STEPS, 2, 4)),
        signals=signals,
        repeats=np.zeros((2, 4), np.int64),
        wall_s=4.0,
        loss=loss,
    )


def scenario_of(scenario1: Scenario, steps: int = STEPS) -> Scenario:
    changes = {
        "uavs": scenario1.uavs[:2],
        "network": scenario1.network.model_copy(update={"edges": scenario1.network.edges[:1]}),
        "step_us": 100_000,
        "duration_s": steps / 10,
        "faults": (),
    }
    return scenario1.model_copy(update=changes)


def summary_of(recording: Recording, scenario1: Scenario) -> FlightSummary:
    return summarise(recording, scenario_of(scenario1))


def test_synchronisation_errors_are_between_the_true_states(scenario1: Scenario) -> None:
    """Each UAV holds an error of its own, and believes in none; half a turn is no obstacle."""
    flight = straight()
    flight.signals["reference"][..., 0] = [39.0, 42.0]
    flight.states[:, 0, 8], flight.states[:, 1, 8] = np.radians(175.0), np.radians(-175.0)
    law, seconds = scenario1.controller, STEPS / 10
    first, second = summary_of(flight, scenario1).uavs
    assert first.iae_sync["airspeed"] == pytest.approx((law.lambda1 + 3.0 * law.lambda2) * seconds)
    assert second.iae_sync["airspeed"] == pytest.approx(
        (2.0 * law.lambda1 + 3.0 * law.lambda2) * seconds
    )
    expected = law.lambda3 * 175.0 - law.lambda4 * 10.0
    assert first.iae_sync["yaw"] == pytest.approx(expected * seconds)
    assert first.iae_sync["roll"] == 0.0


def test_neighbour_messages_are_counted_to_each_neighbour_and_without_the_first_step(
    scenario1: Scenario,
) -> None:
    flight = straight()
    flight.signals["neighbour_message"][[3, 7, 8], 0] = 1
    summary = summary_of(flight, scenario1)
    assert [uav.neighbour_messages for uav in summary.uavs] == [3, 0]
    assert summary.uavs[0].neighbour_saving == pytest.approx(1 - 3 / 39)
    assert summary.neighbour_saving == pytest.approx(1 - 3 / 78)
    frame = 12 + 64 + 1  # header and checksum, values, and a step below 256
    assert summary.uavs[0].link_bytes["neighbour_messages"] == 3 * frame
    alone = scenario_of(scenario1).model_copy(
        update={"network": scenario1.network.model_copy(update={"edges": ()})}
    )
    assert summarise(flight, alone).uavs[0].neighbour_saving is None


@given(st.sets(st.integers(0, STEPS - 1), max_size=STEPS - 1))
def test_over_missing_steps_the_last_command_holds(missing: set[int]) -> None:
    flight = straight()
    gone = sorted(missing)
    flight.signals[gone, 0] = no_signals(len(gone))
    assert flight.missing.sum(axis=0).tolist() == [len(missing), 0]
    flown = sorted(set(range(STEPS)) - missing)
    held = [max((k for k in flown if k <= step), default=flown[0]) for step in range(STEPS)]
    for target in ("command", "reference"):
        error = flight.error(target)
        assert (error[:, 0, 0] == 40.0 - np.array(held)).all()
        assert (error[:, 1, 0] == 40.0 - np.arange(STEPS)).all()


def test_missing_steps_count_as_errors_but_not_as_periods(scenario1: Scenario) -> None:
    flight = straight()
    flight.signals[10:20, 0] = no_signals(10)
    flight.signals["events"][:10, :] = 1
    first, second = summary_of(flight, scenario1).uavs
    assert (first.active_steps, first.missing_steps) == (30, 10)
    assert (second.active_steps, second.missing_steps) == (40, 0)
    assert first.saving == 1.0 - 10 / (4 * 30)
    assert second.saving == 1.0 - 10 / (4 * 40)
    lag = sum(range(1, 11))  # of the command that holds over ten steps
    assert (first.iae["airspeed"] or 0.0) - (second.iae["airspeed"] or 0.0) == pytest.approx(
        0.1 * lag
    )


def test_an_autopilot_that_heard_nothing_has_no_figures(scenario1: Scenario) -> None:
    flight = straight()
    flight.signals[:, 0] = no_signals(STEPS)
    uav = summary_of(flight, scenario1).uavs[0]
    assert (uav.active_steps, uav.missing_steps, uav.saving) == (0, STEPS, None)
    for errors in (uav.iae, uav.iae_filtered, uav.max_error, uav.final_error):
        assert set(errors.values()) == {None}


def test_while_disarmed_nothing_is_commanded(scenario1: Scenario) -> None:
    flight = straight()
    disarmed = no_signals(20)
    disarmed["V"] = 40.0
    flight.signals[20:, 0] = disarmed
    uav = summary_of(flight, scenario1).uavs[0]
    assert (uav.active_steps, uav.missing_steps) == (20, 0)
    assert uav.iae["airspeed"] == pytest.approx(0.1 * sum(40 - k for k in range(20)))
    assert uav.final_error["airspeed"] is None


@pytest.mark.parametrize(
    ("angle", "turned", "attitude", "heading"),
    [
        (0, 1.6, 2.0, None),
        (1, -1.6, 2.0, None),
        (2, 1.6, None, 2.0),
        (2, 6.2, None, None),
        (0, 1.5, None, None),
    ],
)
def test_attitude_and_heading_are_lost_apart(
    scenario1: Scenario, angle: int, turned: float, attitude: float | None, heading: float | None
) -> None:
    flight = straight()
    flight.states[20:, 1, 6 + angle] = turned
    uav = summary_of(flight, scenario1).uavs[1]
    assert (uav.attitude_lost_at_s, uav.heading_lost_at_s) == (attitude, heading)


def test_a_flight_that_was_stopped_says_so(scenario1: Scenario) -> None:
    whole = summary_of(straight(), scenario1)
    assert (whole.completed, whole.loss) == (True, None)
    stopped = summarise(straight(), scenario_of(scenario1, 100))
    assert (stopped.completed, stopped.loss) == (False, "stopped at 4 s of 10 s")
    lost = summarise(straight("UAV 2 was lost"), scenario_of(scenario1, 100))
    assert (lost.completed, lost.loss) == (False, "UAV 2 was lost")


def test_decisions_of_the_diagnosis_stand_beside_the_injected_fault(scenario1: Scenario) -> None:
    flight = straight()
    flight.signals["phase"][10:30, 0, 0] = 2
    flight.signals["offset"][10:30, 0, 0] = math.radians(3.0)
    flight.signals["phase"][5, 1, 3] = 1  # a suspicion is no decision
    flight.signals["phase"][20:, 1, 3] = 2
    fault = {"uav": 1, "actuator": "aileron", "stuck_deg": 3.0, "start_s": 0.9, "end_s": 2.5}
    faults = (ScenarioFault.model_validate(fault),)
    scenario = scenario_of(scenario1).model_copy(update={"faults": faults})
    first, second = summarise(flight, scenario).uavs
    lost, back = first.diagnosis
    assert (lost.actuator, lost.phase, lost.time_s, lost.delay_s) == ("aileron", "lost", 1.0, 0.1)
    assert lost.stuck == pytest.approx(3.0)
    assert (back.phase, back.time_s, back.delay_s, back.stuck) == ("back", 3.0, 0.5, None)
    (false,) = second.diagnosis
    assert (false.actuator, false.time_s, false.delay_s) == ("throttle", 2.0, None)
    console = Console(width=1000)
    with console.capture() as captured:
        console.print(*flight_tables(summarise(flight, scenario), scenario), sep="\n")
    said = captured.get()
    assert "UAV 1 diagnosed its aileron as lost at 1.000 s, 100 ms after the fault's start" in said
    assert "UAV 2 diagnosed its throttle as lost at 2.000 s, without an injected fault" in said


def test_a_diagnosis_that_changes_its_mind_does_not_fill_the_screen(scenario1: Scenario) -> None:
    flight = straight()
    flight.signals["phase"][10:40:2, 0, 0] = 2
    scenario = scenario_of(scenario1)
    console = Console(width=1000)
    with console.capture() as captured:
        console.print(*flight_tables(summarise(flight, scenario), scenario), sep="\n")
    said = captured.get()
    assert said.count("UAV 1 diagnosed its") == 10
    assert "UAV 1 diagnosed 20 times more, last its aileron at 3.900 s" in said


def test_the_printed_report_says_what_the_tables_leave_out(scenario1: Scenario) -> None:
    flight = straight()
    flight.signals[10:20, 0] = no_signals(10)
    disarmed = no_signals(15)
    disarmed["V"] = 40.0
    flight.signals[25:, 1] = disarmed
    states = flight.states.copy()
    states[5:, 0, 6], states[8:, 1, 8] = math.pi, math.radians(100.0)
    flight = replace(flight, states=states)
    scenario = scenario_of(scenario1)
    console = Console(width=1000)
    with console.capture() as captured:
        console.print(*flight_tables(summarise(flight, scenario), scenario), sep="\n")
    said = captured.get()
    for line in (
        "UAV 1 lost its attitude: roll or pitch was more than 90° off first at 0.500 s",
        "UAV 2 lost its heading: yaw was more than 90° off first at 0.800 s",
        "UAV 1 missed 10 of 40 steps",
        "UAV 2 was disarmed for 15 of 40 steps",
    ):
        assert line in said
    assert "UAV 1 was disarmed" not in said


@given(st.booleans(), st.none() | st.text(), st.sets(st.integers(0, STEPS - 1)))
def test_a_summary_comes_back_from_its_json(
    scenario1: Scenario, early: bool, loss: str | None, missing: set[int]
) -> None:
    flight = straight(loss)
    flight.signals[sorted(missing), 0] = no_signals(len(missing))
    flight.signals["events"][::3, 1] = 5
    summary = summarise(flight, scenario_of(scenario1, STEPS + early))
    tree = json.loads(json.dumps(summary.to_json()))
    assert FlightSummary.from_json(tree) == summary
    assert json.dumps(FlightSummary.from_json(tree).to_json()) == json.dumps(tree)


@pytest.mark.parametrize("tree", [None, [], {}, {"scenario": "one"}, {"uavs": 3}])
def test_what_is_no_summary_is_refused(tree: object) -> None:
    with pytest.raises(ValueError, match="FlightSummary"):
        FlightSummary.from_json(tree)
