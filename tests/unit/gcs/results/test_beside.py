"""Our trigger beside a foreign autopilot: asked about the commands that it gave."""

import io
import math

import numpy as np
import pytest
from rich.console import Console

from ftc_autopilot.control.signals import no_signals
from gcs.reports.flight import flight_tables
from gcs.results.beside import beside_of
from gcs.results.figures import FlightSummary, figure_of
from gcs.results.recording import Ending, Steps
from gcs.results.summary import summary_of
from gcs.results.tally import Tally
from gcs.scenario.bundled import SCENARIOS
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.constants import THROTTLE

STEPS = 4000
BUNDLED = load_scenario(SCENARIOS / "paper" / "scenario1.yaml")


def foreign(**changes: object) -> Scenario:
    """Return a scenario in which an ArduPlane flies the third UAV."""
    tree = BUNDLED.model_dump() | changes
    tree["uavs"][2]["autopilot"] = {"kind": "ardupilot", "binary": "arduplane"}
    return Scenario.model_validate(tree)


def commands() -> np.ndarray:
    """Commands of 4 s at 50 Hz: a slow turn, noise below the thresholds, one that never moves."""
    t = np.floor(np.arange(STEPS) / 20) / 50.0
    noise = np.random.default_rng(3).normal(0.0, math.radians(0.1), STEPS // 20).repeat(20)
    aileron = np.radians(10.0) * np.sin(2.0 * t) + noise
    return np.stack([aileron, noise, np.zeros(STEPS), 20.0 + 5.0 * t], axis=1)


def steps_of(held: np.ndarray) -> Steps:
    steps = Steps.room(len(held), 3)
    steps.states[:] = steps.wind[:] = 0.0
    steps.signals[:] = no_signals(len(held))[:, None]
    steps.signals["V"][:] = 25.0
    steps.signals["held"][:, 2] = held
    changed = np.diff(held, axis=0, prepend=np.nan) != 0.0
    steps.signals["events"][:, 2] = changed @ [1, 2, 4, 8]
    return steps


def summary(scenario: Scenario, held: np.ndarray, *cuts: int) -> FlightSummary:
    tally, steps = Tally(scenario), steps_of(held)
    for begin, end in zip((0, *cuts), (*cuts, STEPS), strict=True):
        tally.add(steps.part(begin, end))
    ending = Ending("lockstep", STEPS, np.zeros((3, 4), np.int64), 1.0, None)
    return summary_of(tally, ending, scenario)


def test_it_counts_what_moves_by_more_than_the_threshold() -> None:
    # (25) and (29) once more, in plain words, with the thresholds before 14 s
    held, sent = commands(), np.full(4, np.nan)
    events, messages, apart = np.zeros(4, int), 0, np.zeros(4)
    for row in held:
        least = 0.01 * np.abs(sent) + [*[math.radians(1.0)] * 3, 0.5]
        fires = np.isnan(sent) | (np.abs(row - sent) >= least)
        sent = np.where(fires, row, sent)
        events += fires
        messages += fires.any()
        apart = np.maximum(apart, np.abs(row - sent))
    own = summary(foreign(), held, 1, 777).uavs[2]
    assert own.beside is not None
    found = [own.beside.events[name] for name in ("aileron", "elevator", "rudder", "throttle")]
    assert found == events.tolist()
    assert found[:3] == [pytest.approx(40, abs=25), 1, 1]
    assert own.beside.messages == messages
    assert own.beside.apart["aileron"] == pytest.approx(math.degrees(apart[0]))
    assert own.beside.apart["throttle"] == pytest.approx(apart[THROTTLE])
    assert own.channels["elevator"].events > 100, "it sends its noise, and the trigger does not"


def test_steps_that_it_missed_are_passed_over() -> None:
    held = commands()
    gap = held.copy()
    gap[1:20] = np.nan  # before anything moves
    assert summary(foreign(), gap).uavs[2].beside == summary(foreign(), held).uavs[2].beside


def test_tables_and_columns_have_it() -> None:
    flight = summary(foreign(), commands())
    out = io.StringIO()
    console = Console(file=out, width=120)
    for line in flight_tables(flight, foreign()):
        console.print(line)
    assert "Trigger per_channel on their commands" in out.getvalue()
    own = flight.uavs[2].beside
    figure = figure_of("beside_messages")
    assert own is not None
    assert figure is not None
    assert [figure.of(uav) for uav in flight.uavs] == [None, None, own.messages]
    assert FlightSummary.from_json(flight.to_json()) == flight


def test_a_trigger_that_leaves_the_choice_to_its_law_cannot_be_asked() -> None:
    assert beside_of(foreign(), 3) is not None
    assert beside_of(foreign(), 1) is None, "an autopilot of ours has its own"
    chosen = foreign(controller={"kind": "tube"}, trigger={"mode": "consequence"})
    assert beside_of(chosen, 3) is None
