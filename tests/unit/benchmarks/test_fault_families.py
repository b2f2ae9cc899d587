"""The table of fault families: every law flies the same faults, the worst beside the median."""

import random
from itertools import product

import pytest

from benchmarks.fault_families import FAMILIES, Flown, line, scenario_with
from ftc_autopilot.control.laws import LAWS


def test_every_law_can_fly_every_family(subtests: pytest.Subtests) -> None:
    for family, law in product(FAMILIES, ("surviving", "tube", "pid")):
        with subtests.test(family, law=law):
            faults, keys = FAMILIES[family](random.Random(1))
            scenario = scenario_with(law, "realistic", faults, keys)
            assert isinstance(scenario.controller, LAWS[law])
            assert len(scenario.faults) == len(faults)


def test_a_row_has_the_worst_flight_beside_the_median() -> None:
    quiet = Flown(False, False, False, 1.0, False, 0.2, 100)
    flown = [quiet, quiet._replace(error_deg=2.0), quiet._replace(large=True, error_deg=61.4)]
    row = line("weak_aileron", "pid", "realistic", flown)
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells == [
        *("weak_aileron", "pid", "realistic", "3"),
        *("0", "0", "1", "2.0, 61", "0", "3", "0.200, 0.200", "100"),
    ]
