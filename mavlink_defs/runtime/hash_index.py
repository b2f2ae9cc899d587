"""Hash tables for compiled code: open addressing over an array of keys, which its owner keeps.

Keys are positive; 0 marks a free slot. The number of slots is a power of two, and at least one
is free. Nothing is ever taken out: who forgets a key fills the array anew.
"""

import numpy as np

from mavlink_defs.runtime.jit import compiled

_FACTOR = 0x9E3779B1


@compiled
def slot_of(keys: np.ndarray, key: int) -> int:
    """Return the slot that holds a key; the free one where it belongs if none does.

    Args:
        keys: Shape (2**n,) int64.
        key: What to look for, > 0.
    """
    mask = keys.size - 1
    wanted = int(key)
    slot = (((wanted ^ (wanted >> 29)) * _FACTOR) >> 13) & mask
    while keys[slot] != 0 and keys[slot] != wanted:
        slot = (slot + 1) & mask
    return int(slot)
