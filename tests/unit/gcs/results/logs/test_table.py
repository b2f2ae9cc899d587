"""The table of a flight: values between samples, gaps, order, and the clock that jumps."""

import numpy as np
import pytest

from gcs.console.errors import BadInput
from gcs.results.logs.clocks import longest_span, longest_stretch
from gcs.results.logs.names import UNITS, factor
from gcs.results.logs.shortcomings import shortcomings
from gcs.results.logs.table import FlightTable, LogChannel, by_name, channel


def made(name: str, time_s: object, values: object) -> LogChannel:
    found = channel(name, np.asarray(time_s, float), np.asarray(values, float))
    assert found is not None
    return found


def flight(*channels: LogChannel) -> FlightTable:
    return FlightTable("test", "csv", by_name(channels))


def test_values_between_samples_are_on_a_line() -> None:
    one = made("pitch", [0.0, 1.0], [0.1, 0.3])
    assert one.at(np.array([-0.1, 0.0, 0.25, 1.0, 1.1])) == pytest.approx(
        [np.nan, 0.1, 0.15, 0.3, np.nan], nan_ok=True
    )


def test_angles_go_the_short_way_round() -> None:
    one = made("yaw", [0.0, 1.0], np.radians([175.0, 185.0]))
    assert np.degrees(one.at(np.array([0.25, 0.75]))) == pytest.approx([177.5, -177.5])
    degrees = made("longitude", [0.0, 1.0], [179.0, -179.0])
    assert degrees.at(np.array([0.5])) == pytest.approx([-180.0])


@pytest.mark.parametrize("name", ["held_elevator", "output_3", "servo_1", "mode", "fault"])
def test_commands_and_flags_hold(name: str) -> None:
    assert made(name, [0.0, 1.0], [1.0, 2.0]).at(np.array([0.9, 1.0])).tolist() == [1.0, 2.0]


def test_nothing_is_said_inside_a_gap() -> None:
    one = made("p", [*np.arange(0.0, 1.0, 0.1), *np.arange(3.0, 4.0, 0.1)], np.ones(20))
    assert np.array(one.gaps) == pytest.approx(np.array([[0.9, 3.0]]))
    assert np.isnan(one.at(np.array([0.9, 0.95, 2.0, 3.0]))).tolist() == [False, True, True, False]


def test_a_command_that_is_stored_when_it_changes_has_no_gaps() -> None:
    one = LogChannel("held_rudder", "rad", np.array([0.0, 0.1, 9.0]), np.ones(3), by_event=True)
    assert one.gaps == ()
    assert one.at(np.array([5.0, 20.0])).tolist() == [1.0, 1.0]


def test_values_come_in_order_without_nan_and_the_later_of_one_time_counts() -> None:
    one = made("p", [2.0, 0.0, 1.0, 1.0, 3.0], [5.0, 1.0, 2.0, 3.0, np.nan])
    assert one.time_s.tolist() == [0.0, 1.0, 2.0]
    assert one.values.tolist() == [1.0, 3.0, 5.0]
    assert channel("p", np.zeros(2), np.full(2, np.nan)) is None


def test_rates_tell_rows_from_new_values() -> None:
    one = made("p", np.arange(0.0, 10.0, 0.05), np.repeat(np.arange(25), 8))
    assert one.rate_hz == pytest.approx(20.0)
    assert one.renewed_hz == pytest.approx(2.4, abs=0.1)


def test_a_grid_spans_what_channels_have_in_common() -> None:
    table = flight(made("p", np.arange(0.0, 5.0, 0.1), np.ones(50)), made("q", [2.0, 9.0], [0, 1]))
    times = table.grid(names=("p", "q"))
    assert times[0] == 2.0
    assert times[-1] == pytest.approx(4.9)
    assert np.diff(times) == pytest.approx(0.1)
    assert table.grid(2.0)[-1] == pytest.approx(9.0)
    assert table.on(times, ("q",))["q"][0] == 0.0
    with pytest.raises(BadInput, match="test has no r"):
        table.on(times, ("r",))
    with pytest.raises(BadInput, match="no time in common"):
        flight(made("p", [0.0, 1.0], [0, 0]), made("q", [2.0, 3.0], [0, 0])).grid(names=("p", "q"))


def test_a_grid_that_no_memory_holds_is_refused() -> None:
    bursts = np.add.outer(10.0 * np.arange(60.0), 1e-6 * np.arange(100.0)).ravel()
    with pytest.raises(BadInput, match=r"590 s at 1e\+06 Hz: 5.9e\+08 rows"):
        flight(made("p", bursts, np.ones(6000))).grid()


def test_a_place_at_zero_north_and_east_is_none() -> None:
    place = [made("latitude", [0, 1, 2], [0, 0, 45]), made("longitude", [0, 1, 2], [0, 0, 9])]
    found = by_name([*place, made("altitude", [0, 1, 2], [0, 0, 300])])
    assert {one.values.tolist()[0] for one in found.values()} == {45.0, 9.0, 300.0}


@pytest.mark.parametrize(
    ("times", "stretch", "text"),
    [
        ([0, 1, 2, 1.5, 3], slice(0, 5), ""),
        ([0, 1, 2, 0, 1, 2, 3], slice(3, 7), "jumps by -2 s after 2 s"),
        ([0, 1, 5000, 5001, 5002, 5003], slice(2, 6), "jumps by +4999 s after 1 s"),
        ([5, 6, 7, 8, 2, 3, 1000, 1001, 0], slice(4, 8), "and 1 times more"),
    ],
)
def test_the_longest_stretch_of_a_clock_that_jumps(
    times: list[float], stretch: slice, text: str
) -> None:
    found, remarks = longest_stretch(np.array(times, float))
    assert found == stretch
    assert text in "".join(remarks)
    assert bool(remarks) == bool(text)


def test_slow_messages_may_begin_earlier_and_those_of_another_boot_do_not_count() -> None:
    fast = np.append(np.arange(0.0, 1.0, 0.1), np.arange(500.0, 510.0, 0.1) - 400.0)
    fast[:10] += 7000.0
    slow = np.array([7000.0, 7001.0, 99.4, 104.0, 110.2, 7e8])
    begin, end, jumps = longest_span([fast, slow, np.empty(0)])
    assert (begin, end) == (99.4, 110.2)
    assert len(jumps) == 1
    assert longest_span([np.empty(0)]) == (0.0, 0.0, [])


def test_what_a_log_cannot_say() -> None:
    slow = flight(*(made(name, np.arange(20.0), np.arange(20.0)) for name in ("p", "q", "r")))
    remarks = list(shortcomings(slow))
    assert any(one.startswith("no attitude (roll, pitch, yaw)") for one in remarks)
    assert any(one.startswith("no airspeed") for one in remarks)
    assert any(one.startswith("no commands") for one in remarks)
    assert "p, q, r at 1 Hz: motions faster than 2 s are not in it" in remarks
    frozen = flight(*(made(name, np.arange(0, 9, 0.1), np.ones(90)) for name in ("p", "q", "r")))
    assert any("never change" in one for one in shortcomings(frozen))
    assert any("too short" in one for one in shortcomings(flight(made("p", [0, 1], [0, 1]))))


def test_units() -> None:
    assert factor("deg", UNITS["roll"]) == pytest.approx(np.pi / 180.0)
    assert factor("m/s2", UNITS["specific_force_x"]) == 1.0
    assert factor("kt", UNITS["V"]) == pytest.approx(0.514444, rel=1e-5)
    assert factor("deg", UNITS["V"]) is None
