"""The table of fault families: every law flies the same faults, the worst beside the median."""

import math
import random
from itertools import product

import pytest

from benchmarks.fault_families import FAMILIES, Flown, fly, scenario_with, tables
from ftc_autopilot.control.laws import LAWS
from gcs.results.rivals import SIMPLEST_FIRST


def test_every_law_can_fly_every_family(subtests: pytest.Subtests) -> None:
    for family, law in product(FAMILIES, SIMPLEST_FIRST):
        with subtests.test(family, law=law):
            faults, keys = FAMILIES[family](random.Random(1))
            scenario = scenario_with(law, "realistic", faults, keys)
            assert isinstance(scenario.controller, LAWS[law])
            assert len(scenario.faults) == len(faults)


QUIET = Flown(False, False, 1.0, False, 0.2, 100.0, True)


def tables_without_rule(flown: list[Flown], rival: list[Flown]) -> list[list[str]]:
    shown = tables({("weak_aileron", "realistic"): {"pid": rival, "tube": flown}})
    return [
        [cell.strip() for cell in table.splitlines()[4].strip("|").split("|")][2:]
        for table in shown
    ]


def test_a_row_has_the_worst_flight_beside_the_median() -> None:
    flown = [QUIET, QUIET._replace(error_deg=2.0), QUIET._replace(off_heading=True, error_deg=61.4)]
    off, _, sent, found = tables_without_rule(flown, flown)
    assert off == ["0, 1, 2.0, 61.4"] * 2
    assert sent == ["100"] * 2
    assert found == ["0, 3, 0.200, 0.200"]  # a PID finds nothing


def test_what_pid_does_better_is_bold() -> None:
    flown = [QUIET._replace(error_deg=error) for error in (2.0, 3.0, 31.0)]
    rival = [QUIET._replace(error_deg=error, messages=3000.0) for error in (2.0, 2.8, 18.0)]
    off, _, sent, _ = tables_without_rule(flown, rival)
    assert off == ["0, 0, 2.8, 18.0", "0, 0, 3.0, **31.0**"]
    assert sent == ["3000", "100"]


def test_a_flight_that_was_lost_counts_as_worst_however_short() -> None:
    lost = fly("proposed", "realistic", FAMILIES["soon_after_start"](random.Random(2)))
    assert lost.overturned
    assert lost.off_heading
    assert (lost.error_deg, lost.messages) == (math.inf, math.inf)
    off, _, sent, _ = tables_without_rule([lost], [QUIET])
    assert off == ["0, 0, 1.0, 1.0", "**1**, **1**, **lost**, **lost**"]
    assert sent == ["100", "**lost**"]


def test_a_flight_may_be_lost_before_its_fault() -> None:
    rng = random.Random("weak_in_turns 1")
    drawn = [FAMILIES["weak_in_turns"](rng) for _ in range(4)][-1]
    assert fly("proposed", "realistic", drawn).error_deg == math.inf


def test_a_law_is_held_against_the_best_simpler_one_flight_by_flight() -> None:
    flown = [QUIET._replace(error_deg=error) for error in (2.0, 5.0, 31.0)]
    rivals = [QUIET._replace(error_deg=error, kept=False) for error in (1.0, 6.0, math.inf)]
    others = [QUIET._replace(error_deg=error) for error in (3.0, 4.0, 18.0)]
    by_law = {
        "pid": rivals,
        "proposed": others,
        "tube": [*flown[:2], flown[2]._replace(kept=False)],
    }
    _, kept, *_ = tables({("weak_aileron", "realistic"): by_law})
    cells = kept.splitlines()[4].strip("|").split("|")[2:]
    assert [cell.strip() for cell in cells] == ["0", "3", "**2**, -0.2, 1.0"]


def test_a_mission_has_a_table_of_places() -> None:
    on_path = [QUIET._replace(height_m=height, slot_m=1.0) for height in (2.0, 3.0)]
    flown = {
        ("brief", "ideal"): {"pid": on_path, "tube": on_path[::-1]},
        ("weak", "ideal"): {"pid": [QUIET], "tube": [QUIET]},
    }
    _, _, placed, *_ = tables(flown)
    assert placed.splitlines()[4:] == ["| brief | ideal | 3.0, 1.0 | 3.0, 1.0 |"]
