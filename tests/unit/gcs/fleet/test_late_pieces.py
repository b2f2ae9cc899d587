"""Pieces of a standing fleet's recording that come late, out of order or twice.

What is recorded equals what an undisturbed flight records, step by step, or the gap is counted.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.hot.link import RECORD
from gcs.fleet.collector import Collector, Gap
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario
from mavlink_defs.runtime.spool import Spool

ROWS, PIECES = 10, 16  # of steps, of a flight
STEPS = ROWS * PIECES
PLANT = np.dtype([("states", "f8", (3, 12)), ("wind", "f8", (3, 3)), ("applied", "f8", (3, 4))])
IDS = (1, 2, 3)

Deliveries = Sequence[Sequence[int]]
"""Of each UAV's pieces: how many pieces of the plant later than its own they come."""


class Disturbed:
    """A flight whose autopilots deliver their pieces when they like."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        self.spools = {name: Spool(folder / name) for name in ("plant", "uav1", "uav2", "uav3")}
        self.collector = Collector(scenario, folder.joinpath)
        self.found: list[Steps] = []

    def write_plant(self, first: int) -> None:
        rows = np.zeros(ROWS, PLANT)
        rows["states"][:, 0, 0] = np.arange(first, first + ROWS)
        self.spools["plant"].write(first, rows)

    def write_autopilot(self, uav: int, first: int, missed: set[int]) -> None:
        steps = [k for k in range(first, first + ROWS) if k not in missed]
        if steps:
            rows = np.zeros(len(steps), RECORD)
            rows["step"] = rows["signals"]["V"] = steps
            self.spools[f"uav{uav}"].write(steps[0], rows)

    def fly(self, deliveries: Deliveries, repeats: set[int], missed: set[int]) -> None:
        """Write and collect all of it; pieces of `repeats` are delivered again a piece later."""
        due: dict[int, list[tuple[int, int]]] = {}
        for uav, delays in zip(IDS, deliveries, strict=True):
            for piece, delay in enumerate(delays):
                for later in (0, 1) if piece in repeats else (0,):
                    due.setdefault(piece + delay + later, []).append((uav, piece * ROWS))
        for tick in range(max(due) + 1):
            if tick < PIECES:
                self.write_plant(tick * ROWS)
            for uav, first in due.get(tick, ()):
                self.write_autopilot(uav, first, missed if uav == 2 else set())
            self.collector.pass_on_without_stragglers(self.found.append)
        self.collector.pass_on(self.found.append, over=True)

    def check(self, missed: set[int]) -> None:
        """Every step is there; each row is of its step, or counted as come too late."""
        whole = Steps.joined(self.found, len(IDS))
        assert np.array_equal(whole.states[:, 0, 0], np.arange(STEPS))
        for i, uav in enumerate(IDS):
            recorded = whole.signals["V"][:, i]
            there = ~np.isnan(recorded)
            assert np.array_equal(recorded[there], np.flatnonzero(there))
            gone = set(np.flatnonzero(~there).tolist()) - (missed if uav == 2 else set())
            late = self.collector.gaps.get(f"uav{uav}")
            assert (late.rows if late else 0) == len(gone)
            if late:
                assert (late.first, late.last) == (min(gone), max(gone))


delays = st.lists(st.sampled_from([0, 0, 0, 1, 4, 10]), min_size=PIECES, max_size=PIECES)


@given(
    st.tuples(delays, delays, delays),
    st.sets(st.integers(0, PIECES - 1), max_size=4),
    st.sets(st.integers(0, STEPS - 1), max_size=20),
)
def test_rows_are_of_their_steps_whenever_their_pieces_come(
    tmp_path_factory: pytest.TempPathFactory,
    scenario1: Scenario,
    deliveries: Deliveries,
    repeats: set[int],
    missed: set[int],
) -> None:
    flight = Disturbed(scenario1, tmp_path_factory.mktemp("processes"))
    flight.fly(deliveries, repeats, missed)
    flight.check(missed)


@pytest.mark.parametrize("late", [1, 4, 10])
@pytest.mark.parametrize("piece", range(6))
def test_an_autopilot_that_stands_still_is_late_with_all_that_follows(
    scenario1: Scenario, tmp_path: Path, late: int, piece: int
) -> None:
    """Its pieces up to some time come at once, as after a stop at a second of its start."""
    flight = Disturbed(scenario1, tmp_path)
    stopped = [max(late - (k - piece), 0) if k >= piece else 0 for k in range(PIECES)]
    flight.fly((stopped, [0] * PIECES, [0] * PIECES), set(), set())
    flight.check(set())
    known = flight.collector.gaps
    assert known.keys() <= {"uav1"}, "the others lose nothing"
    assert bool(known) == (late > 3)


def test_a_piece_of_the_plant_that_is_gone_is_a_gap_and_shifts_nothing(
    scenario1: Scenario, tmp_path: Path
) -> None:
    flight = Disturbed(scenario1, tmp_path)
    for first in (0, 2 * ROWS, 3 * ROWS):
        flight.write_plant(first)
        for uav in IDS:
            flight.write_autopilot(uav, first, set())
        flight.collector.pass_on(flight.found.append)
        flight.write_plant(first)  # again
    flight.collector.pass_on(flight.found.append, over=True)
    assert [steps.first for steps in flight.found] == [0, 2 * ROWS, 3 * ROWS]
    for steps in flight.found:
        expected = np.arange(steps.first, steps.first + steps.length)
        assert np.array_equal(steps.signals["V"][:, 2], expected)
        assert np.array_equal(steps.states[:, 0, 0], expected)
    assert flight.collector.gaps == {"plant": Gap(ROWS, ROWS, 2 * ROWS - 1)}
