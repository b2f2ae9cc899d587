"""Sets of system ids in messages."""

from hypothesis import given
from hypothesis import strategies as st

from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.system_ids import bits_of, systems_of


@given(st.sets(st.integers(0, 255)))
def test_systems_arrive_as_they_were_sent(systems: set[int]) -> None:
    sent = dialect.MAVLink_ftc_fleet_message(bits_of(systems))
    received = parse(FramePacker(1, 1).pack(sent))
    assert isinstance(received, dialect.MAVLink_ftc_fleet_message)
    assert systems_of(received.members) == systems


@given(st.integers(0, 255))
def test_each_system_has_the_bit_that_the_dialect_gives_it(system: int) -> None:
    expected = [0] * 32
    expected[system // 8] = 1 << system % 8
    assert bits_of([system, system]) == expected
