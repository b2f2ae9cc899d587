"""The battery that vehicles report: plausible at any time."""

from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.vehicle.battery import CELLS, battery_at

hours = st.floats(0.0, 1e4)


@given(hours, hours)
def test_it_drains_and_never_ends_a_simulation(a: float, b: float) -> None:
    early, late = (battery_at(3600.0 * hours) for hours in sorted((a, b)))
    assert early.cell_mv >= late.cell_mv >= 3500
    assert early.remaining_percent >= late.remaining_percent >= 20
    assert early.consumed_mah <= late.consumed_mah <= 8000
    assert early.time_left_s >= late.time_left_s > 0


def test_after_an_hour() -> None:
    battery = battery_at(3600.0)  # 1.8 A out of 10 Ah
    assert (battery.consumed_mah, battery.remaining_percent) == (1800, 82)
    volts = CELLS * (4.15 + 4.033) / 2.0
    assert abs(battery.consumed_hj / (1.8 * 3600.0 * volts / 100.0) - 1.0) < 1e-2
    assert battery.time_left_s == round(0.82 * 10.0 / 1.8 * 3600.0)
