"""Sets of system ids as messages carry them: bit s % 8 of byte s / 8 stands for system id s."""

from collections.abc import Iterable

_BYTES = 32


def bits_of(systems: Iterable[int]) -> list[int]:
    """Return the 32 bytes that stand for a set of system ids, each 0 to 255."""
    return list(sum(1 << system for system in set(systems)).to_bytes(_BYTES, "little"))


def systems_of(octets: Iterable[int]) -> frozenset[int]:
    """Return the set of system ids that 32 bytes stand for."""
    bits = int.from_bytes(bytes(octets), "little")
    return frozenset(system for system in range(8 * _BYTES) if bits >> system & 1)
