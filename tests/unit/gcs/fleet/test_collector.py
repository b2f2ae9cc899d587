"""Recordings of processes become the recording of a flight, whenever they are read."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.signals import SIGNALS, no_signals
from ftc_autopilot.hot.link import RECORD
from gcs.console.errors import FlightLost
from gcs.fleet.collector import Collector
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario
from mavlink_defs.runtime.spool import Spool

STEPS = 12


def plant_rows(begin: int, end: int) -> np.ndarray:
    rows = np.zeros(
        end - begin, [("states", "f8", (3, 12)), ("wind", "f8", (3, 3)), ("applied", "f8", (3, 4))]
    )
    rows["states"][:, 0, 0] = np.arange(begin, end)
    return rows


def autopilot_rows(steps: list[int]) -> np.ndarray:
    rows = np.zeros(len(steps), RECORD)
    rows["step"] = rows["signals"]["V"] = steps
    return rows


def finish(spools: dict[str, Spool], steps: int = STEPS) -> None:
    for name, spool in spools.items():
        if name == "plant":
            spool.finish(loss=None, steps=steps, wall_s=2.0)
        else:
            spool.finish(loss=None, repeats=[0, 1, 2, 3], heard_end=True)


@pytest.fixture
def short(scenario1: Scenario) -> Scenario:
    return scenario1.model_copy(update={"duration_s": STEPS / 1000})


names = ("plant", "uav1", "uav2", "uav3")
parts = st.lists(st.integers(1, STEPS - 1), unique=True, max_size=4).map(sorted)


@given(
    st.fixed_dictionaries(dict.fromkeys(names, parts)),
    st.lists(st.sampled_from(names), max_size=20),
    st.sets(st.integers(0, STEPS - 1)),
)
def test_steps_come_in_order_and_missing_ones_are_nan(
    tmp_path_factory: pytest.TempPathFactory,
    scenario1: Scenario,
    cuts: dict[str, list[int]],
    order: list[str],
    missed: set[int],
) -> None:
    """The processes write in any order, and the second autopilot misses some steps."""
    folder = tmp_path_factory.mktemp("processes")
    short = scenario1.model_copy(update={"duration_s": STEPS / 1000})
    spools = {name: Spool(folder / name) for name in names}
    collector = Collector(short, folder.joinpath)
    found: list[Steps] = []
    waiting = {
        name: list(zip([0, *ends], [*ends, STEPS], strict=True)) for name, ends in cuts.items()
    }
    for name in [*order, *(name for name in names for _ in range(5))]:
        if waiting[name]:
            begin, end = waiting[name].pop(0)
            flown = [k for k in range(begin, end) if name != "uav2" or k not in missed]
            rows = plant_rows(begin, end) if name == "plant" else autopilot_rows(flown)
            if len(rows):
                spools[name].write(begin, rows)
        collector.pass_on(found.append)
    finish(spools)
    collector.pass_on(found.append, over=True)
    whole = Steps.joined(found, 3)
    assert [steps.first for steps in found] == [0, *np.cumsum([s.length for s in found])[:-1]]
    assert np.array_equal(whole.states[:, 0, 0], np.arange(STEPS))
    expected = np.arange(STEPS, dtype=float)
    assert np.array_equal(whole.signals["V"][:, 0], expected)
    expected[sorted(missed)] = np.nan
    assert np.array_equal(whole.signals["V"][:, 1], expected, equal_nan=True)
    gone = whole.signals[sorted(missed), 1]
    assert gone.tobytes() == no_signals(len(missed)).tobytes()
    ending = collector.ending("lockstep")
    assert (ending.steps, ending.loss, ending.wall_s) == (STEPS, None, 2.0)
    assert ending.repeats.tolist() == [[0, 1, 2, 3]] * 3
    assert not list(folder.iterdir()), "the recordings of the processes are taken over"


@pytest.mark.parametrize("torn", names)
def test_a_torn_recording_is_reported(short: Scenario, tmp_path: Path, torn: str) -> None:
    spools = {name: Spool(tmp_path / name) for name in names}
    for name, spool in spools.items():
        spool.write(0, plant_rows(0, 5) if name == "plant" else autopilot_rows(list(range(5))))
    finish({name: spool for name, spool in spools.items() if name != torn}, steps=5)
    collector = Collector(short, tmp_path.joinpath)
    found: list[Steps] = []
    collector.pass_on(found.append, over=True)
    assert sum(steps.length for steps in found) == 5
    with pytest.raises(FlightLost, match=f"the recording ends early: {torn}$"):
        collector.ending("lockstep")


def test_steps_of_the_plant_that_are_gone_are_reported(short: Scenario, tmp_path: Path) -> None:
    spools = {name: Spool(tmp_path / name) for name in names}
    spools["plant"].write(0, plant_rows(0, 5))
    finish(spools)
    collector = Collector(short, tmp_path.joinpath)
    collector.pass_on(lambda _: None, over=True)
    with pytest.raises(FlightLost, match="lacks steps of the plant"):
        collector.ending("lockstep")


def test_a_recorded_row_has_all_signals() -> None:
    assert RECORD["signals"] == SIGNALS


def test_what_an_autopilot_writes_again_after_a_restart_counts_once(
    short: Scenario, tmp_path: Path
) -> None:
    spools = {name: Spool(tmp_path / name) for name in names}
    for name, spool in spools.items():
        spool.write(0, plant_rows(0, STEPS) if name == "plant" else autopilot_rows([0, 1, 2, 3]))
    collector = Collector(short, tmp_path.joinpath)
    found: list[Steps] = []
    collector.pass_on(found.append)
    for name in names[1:]:
        spools[name].write(2, autopilot_rows(list(range(2, STEPS))))
    finish(spools)
    collector.pass_on(found.append, over=True)
    assert np.array_equal(Steps.joined(found, 3).signals["V"][:, 0], np.arange(STEPS))
    assert collector.ending("lockstep", (1, 1, 1)).restarts == (1, 1, 1)
