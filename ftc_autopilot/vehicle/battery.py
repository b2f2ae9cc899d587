"""The battery that a vehicle reports, as the avionics of a small aircraft have it.

It is there for ground stations, which take an aircraft without one for a defect, and has no
influence on the flight: a constant current drains it, and it never falls below a fifth, so that
an endless simulation is never ordered to land.
"""

from typing import NamedTuple

CELLS = 3
CURRENT_CA = 180
"""Current of autopilot, radio and servos [cA]."""

_CAPACITY_MAH = 10_000
_FULL_MV, _EMPTY_MV = 4_150, 3_500  # of a cell that is loaded
_MIN_SHARE = 0.2  # share that is always left


class Battery(NamedTuple):
    """The battery at one instant."""

    cell_mv: int
    remaining_percent: int
    consumed_mah: int
    consumed_hj: int
    time_left_s: int


def battery_at(boot_s: float) -> Battery:
    """Return the battery at a time since boot [s], at which it was full."""
    current_a = CURRENT_CA / 100.0
    lasts_s = 3.6 * _CAPACITY_MAH / current_a
    left = max(1.0 - boot_s / lasts_s, _MIN_SHARE)
    consumed_mah = (1.0 - left) * _CAPACITY_MAH
    cell_mv = _EMPTY_MV + left * (_FULL_MV - _EMPTY_MV)
    mean_v = CELLS * (cell_mv + _FULL_MV) / 2.0 / 1e3
    return Battery(
        cell_mv=round(cell_mv),
        remaining_percent=round(100.0 * left),
        consumed_mah=round(consumed_mah),
        consumed_hj=round(3.6 * consumed_mah * mean_v / 100.0),
        time_left_s=round(left * lasts_s),
    )
