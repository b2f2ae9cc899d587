import math

import pytest

from gcs.station.fault_text import describe_diagnosis, describe_fault
from mavlink_defs.faults import Fault


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (
            Fault(0, 1.0, -2.0, 0.3, 1.0, math.inf),
            "aileron at 100 % - 2 deg · cos 2π 0.3 Hz after 1 s, until cleared",
        ),
        (
            Fault(3, 0.0, 1.5, 0.0, math.nan, math.nan),
            "throttle stuck at 1.5 N from now, until cleared",
        ),
        (Fault(2, 0.5, 1.0, 0.0, math.nan, 22.0), "rudder at 50 % + 1 deg from now, 22] s"),
    ],
)
def test_faults_in_words(fault: Fault, expected: str) -> None:
    assert describe_fault(fault) == expected


@pytest.mark.parametrize(
    ("phases", "expected"),
    [
        ((0, 0, 0, 0), ("healthy", 0)),
        ((0, 1, 0, 1), ("elevator throttle?", 1)),
        ((2, 1, 0, 0), ("aileron lost", 2)),
    ],
)
def test_diagnoses_in_words(phases: tuple[int, ...], expected: tuple[str, int]) -> None:
    assert describe_diagnosis(phases) == expected
