"""The law flown over UDP, by the processes that `gcs fly` starts."""

import pytest

from gcs.pytest_plugin import Fly
from gcs.testing.results import FlightResult

first = pytest.mark.ftc_scenario("PACKAGE/first", duration_s=4.0)


@first
def test_it_flies_and_saves_messages(ftc_flight: FlightResult) -> None:
    ftc_flight.assert_completed()
    ftc_flight.assert_attitude_kept()
    assert (ftc_flight.saving or 0.0) > 0.5


@first
def test_it_tracks(ftc_flight: FlightResult) -> None:
    for uav in (1, 2, 3):
        ftc_flight.uav(uav).assert_error_below(airspeed_m_s=1.5, roll_deg=5.0, after_s=1.0)


def test_a_flight_in_process_has_the_same_bits(ftc_fly: Fly) -> None:
    wire = ftc_fly("PACKAGE/first", duration_s=0.5)
    in_process = ftc_fly("PACKAGE/first", duration_s=0.5, mode="in_process")
    assert (wire.recording.states == in_process.recording.states).all()


def test_a_larger_gain_tracks_roll_better(ftc_fly: Fly) -> None:
    tight, loose = (
        ftc_fly(
            "PACKAGE/first",
            mode="in_process",
            duration_s=2.0,
            controller={"attitude_gain": gain},
        )
        for gain in (4.0, 1.0)
    )
    tight.uav(1).assert_error_below(roll_deg=1.6, after_s=1.0)
    with pytest.raises(AssertionError, match="roll error"):
        loose.uav(1).assert_error_below(roll_deg=1.6, after_s=1.0)
