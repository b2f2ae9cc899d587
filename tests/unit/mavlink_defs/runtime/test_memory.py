"""Bytes of records, which compiled and plain code read and write."""

import numpy as np

from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import bytes_of

INNER = np.dtype([("flag", "u1"), ("value", "<f8")])
OUTER = np.dtype([("before", "<i8"), ("inner", INNER), ("after", "u1")])


@compiled
def raise_flag(rows: np.ndarray, i: int) -> int:
    """Write the first byte of a nested record; return the sum of all of its bytes before."""
    memory = bytes_of(rows[i]["inner"])
    total = 0
    for k in range(len(memory)):
        total += int(memory[k])
    memory[0] = 7
    return total


def test_the_bytes_of_a_nested_record_are_its_own_memory() -> None:
    rows = np.zeros(3, OUTER)
    rows["before"], rows["after"] = -1, 9  # neighbours in memory, which stay as they are
    rows["inner"]["value"] = 1.5
    expected = sum(rows[1]["inner"].tobytes())
    assert raise_flag(rows, 1) == expected
    assert rows["inner"]["flag"].tolist() == [0, 7, 0]
    memory = bytes_of(rows[2]["inner"])
    assert memory.tobytes() == rows[2]["inner"].tobytes()
    memory[0] = 5
    assert rows["inner"]["flag"].tolist() == [0, 7, 5]
    assert (rows["before"].tolist(), rows["after"].tolist()) == ([-1] * 3, [9] * 3)
