"""Every formation link goes out and comes back: nothing jumps."""

from pathlib import Path

import numpy as np
import pytest

from gcs.fleet.flight import fly_and_record
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from gcs.scenario.sections import Impairments
from mavlink_defs import dialect
from mavlink_defs.capture.impairment import Impairment, Outage
from mavlink_defs.capture.tlog import read_tlog

pytestmark = pytest.mark.sitl
FROM_S, TO_S, DURATION_S = 0.3, 1.2, 2.0  # dropped after 0.25 s, faded out 0.5 s later


def test_no_command_jumps_when_all_edges_are_lost_and_when_they_return(
    scenario1: Scenario, tmp_path: Path
) -> None:
    whole = scenario1.model_copy(update={"duration_s": DURATION_S, "faults": ()})
    outage = Impairment(outages=(Outage(from_s=FROM_S, to_s=TO_S),))
    links = whole.links.model_copy(update={"impairments": Impairments(formation=outage)})
    flown = fly_and_record(whole.model_copy(update={"links": links}), tmp_path)
    said = "".join(
        message.text
        for _, message in read_tlog(tmp_path / "flight.tlog")
        if isinstance(message, dialect.MAVLink_statustext_message)
    )
    edges = 2 * len(whole.network.edges)  # each end says so
    assert said.count("edge dropped") == said.count("edge restored") == edges
    expected = fly_in_process(whole)
    assert not np.array_equal(flown.states, expected.states)
    assert (largest_steps(flown) <= 1.1 * largest_steps(expected)).all()


def largest_steps(flight: Recording) -> np.ndarray:
    """Return the largest change of each UAV's commands in a period after the links went out."""
    begin = round(FROM_S * 1e6 / flight.step_us)
    steps: np.ndarray = np.abs(np.diff(flight.signals["demand"][begin:], axis=0)).max(axis=0)
    return steps
