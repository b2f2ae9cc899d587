"""Memory that the C library's allocator keeps for later, though nothing is in it."""

import ctypes
import gc


def give_memory_back() -> None:
    """Collect garbage, and give free memory back to the system.

    What imports and models leave behind, half of a ground station's memory, lies between what
    stays: the allocator gives none of it back by itself.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc has it
    if trim is not None:
        trim(0)
