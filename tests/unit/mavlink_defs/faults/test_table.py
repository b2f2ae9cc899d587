"""The faults that an aircraft has, whatever fails."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_defs.faults import FAMILIES
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import Family
from mavlink_defs.faults.sensors import SENSOR_FAULTS
from mavlink_defs.faults.table import FaultTable, no_faults

NAN = math.nan
GYROS = {"gyro": [1, 2], "airspeed": [1]}


class Bench:
    def __init__(self, family: Family) -> None:
        self.rows: np.ndarray = no_faults(family, 1)[0]
        self.table = FaultTable(family, self.rows, GYROS if family is SENSOR_FAULTS else None)
        self.one, self.other = family.targets[-1], family.targets[0]
        self.kind = family.kinds[0]

    def set(self, start_s: float, end_s: float, *, other: bool = False, now_s: float = 0.0) -> None:
        fault = Fault(self.other if other else self.one, self.kind, 0.0, start_s, end_s)
        self.table.set([fault], now_s)

    @property
    def starts(self) -> list[float]:
        return [fault.start_s for fault in self.table.faults]


@pytest.fixture(params=FAMILIES, ids=lambda family: family.key)
def bench(request: pytest.FixtureRequest) -> Bench:
    return Bench(request.param)


def test_an_overlapping_fault_replaces_the_old_one(bench: Bench) -> None:
    for now_s in (0.0, 1.0):
        bench.set(NAN, NAN, now_s=now_s)
    assert bench.starts == [1.0]


def test_faults_of_other_targets_and_other_times_stay(bench: Bench) -> None:
    bench.set(1.0, 2.0)
    bench.set(2.0, 3.0)
    bench.set(1.0, NAN, other=True)
    assert bench.starts[:3] == [1.0, 2.0, 1.0]


def test_those_that_are_over_go(bench: Bench) -> None:
    bench.set(1.0, 2.0)
    bench.set(5.0, 6.0, now_s=3.0)
    assert bench.starts == [5.0]


def test_clearing_one_target_leaves_the_others(bench: Bench) -> None:
    bench.set(1.0, NAN, other=True)
    bench.set(2.0, NAN)
    bench.table.clear(bench.other)
    assert bench.starts == [2.0]
    bench.table.clear()
    assert bench.starts == []
    assert (bench.rows["target"] == -1).all()


def test_a_full_table_refuses_another_fault_and_stays(bench: Bench) -> None:
    for k in range(len(bench.rows)):
        bench.set(k, k + 1.0)
    before = bench.rows.copy()
    with pytest.raises(OverflowError, match=rf"all {len(before)} .*slots"):
        bench.set(1.0, NAN, other=True)
    assert np.array_equal(bench.rows, before)


@given(st.sampled_from(FAMILIES), st.floats(-90.0, 90.0), st.data())
def test_a_fault_in_the_table_is_the_one_that_was_set(
    family: Family, value: float, data: st.DataObject
) -> None:
    target, kind = (
        data.draw(st.sampled_from(family.targets)),
        data.draw(st.sampled_from(family.kinds)),
    )
    share = 0.5 if kind.partial else 0.0
    fault = Fault(target, kind, value, 3.0, 4.0, share, 2.0, axis=1)
    rows = no_faults(family, 1)[0]
    FaultTable(family, rows).set([fault], 0.0)
    (back,) = FaultTable(family, rows).faults
    assert back._replace(value=value) == fault
    assert back.value == pytest.approx(value, rel=1e-15)


def test_all_instances_have_a_row_each_and_newer_ones_replace() -> None:
    table = Bench(SENSOR_FAULTS).table
    gyro, kinds = SENSOR_FAULTS.named("gyro"), {kind.name: kind for kind in SENSOR_FAULTS.kinds}
    table.set([Fault(gyro, kinds["off"], 0.0, 0.1)], 0.0)
    assert [fault.instance for fault in table.faults] == [1, 2]
    table.set([Fault(gyro, kinds["bias"], 3.0, 0.5, 1.0, instance=2)], 0.0)
    listed = [(fault.kind.name, fault.whose) for fault in table.faults]
    assert listed == [("off", "gyro 1"), ("bias", "gyro 2")]
    table.clear(gyro, 2)
    assert [fault.whose for fault in table.faults] == ["gyro 1"]


def test_what_is_not_there_has_no_number() -> None:
    table, kind = Bench(SENSOR_FAULTS).table, SENSOR_FAULTS.kinds[0]
    gyro, gps = SENSOR_FAULTS.named("gyro"), SENSOR_FAULTS.named("gps")
    assert table.numbers(Fault(gyro, kind)) == [1, 2]
    assert table.numbers(Fault(gyro, kind, instance=3)) == []
    assert table.numbers(Fault(gps, kind)) == []
