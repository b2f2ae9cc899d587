"""Keyed hashes and random numbers for compiled code: HalfSipHash-2-4 and sfc32.

Both need no more than additions, shifts and rotations of 32-bit words, here kept in 64-bit
integers, so that compiled code and plain Python agree.

- J.-P. Aumasson, D. J. Bernstein, SipHash: a fast short-input PRF, 2012; HalfSipHash is its
  variant for 32-bit words, with an output of 64 bits here.
- C. Doty-Humphrey, PractRand (sfc32).
"""

import numpy as np

from mavlink_defs.runtime.jit import compiled

GENERATOR_SIZE = 4
_M = 0xFFFFFFFF
_V2, _V3 = 0x6C796765, 0x74656462
_WORD = 4  # bytes
_MIXING_ROUNDS = 12


@compiled
def keyed_hash(key: np.ndarray, data: np.ndarray, begin: int, end: int) -> tuple[int, int]:
    """Return the HalfSipHash-2-4 of data[begin:end].

    Args:
        key: Two 32-bit words, int64.
        data: Bytes, uint8.
        begin: Where to begin.
        end: Where to end.

    Returns:
        Its low and its high 32 bits.
    """
    k0, k1 = int(key[0]), int(key[1])
    v0, v1, v2, v3 = k0, k1 ^ 0xEE, _V2 ^ k0, _V3 ^ k1
    at = begin
    while at + _WORD <= end:
        word = _word(data, at, _WORD)
        v3 ^= word
        v0, v1, v2, v3 = _round(v0, v1, v2, v3)
        v0, v1, v2, v3 = _round(v0, v1, v2, v3)
        v0 ^= word
        at += _WORD
    word = _word(data, at, end - at) | (((end - begin) & 0xFF) << 24)
    v3 ^= word
    v0, v1, v2, v3 = _round(v0, v1, v2, v3)
    v0, v1, v2, v3 = _round(v0, v1, v2, v3)
    v0, v2 = v0 ^ word, v2 ^ 0xEE
    for _ in range(4):
        v0, v1, v2, v3 = _round(v0, v1, v2, v3)
    low = v1 ^ v3
    v1 ^= 0xDD
    for _ in range(4):
        v0, v1, v2, v3 = _round(v0, v1, v2, v3)
    return low, v1 ^ v3


@compiled
def _word(data: np.ndarray, at: int, size: int) -> int:
    word = 0
    for k in range(size):
        word |= int(np.int64(data[at + k])) << (8 * k)
    return word


@compiled
def _round(v0: int, v1: int, v2: int, v3: int) -> tuple[int, int, int, int]:
    v0 = (v0 + v1) & _M
    v1 = _turn(v1, 5) ^ v0
    v0 = _turn(v0, 16)
    v2 = (v2 + v3) & _M
    v3 = _turn(v3, 8) ^ v2
    v0 = (v0 + v3) & _M
    v3 = _turn(v3, 7) ^ v0
    v2 = (v2 + v1) & _M
    v1 = _turn(v1, 13) ^ v2
    return v0, v1, _turn(v2, 16), v3


@compiled
def _turn(x: int, n: int) -> int:
    """Return a 32-bit word rotated left by n bits."""
    return ((x << n) | (x >> (32 - n))) & _M


@compiled
def seed_generator(generator: np.ndarray, a: int, b: int, c: int) -> None:
    """Begin the sequence of three 32-bit words.

    Args:
        generator: Shape (GENERATOR_SIZE,) int64, written.
        a: First word.
        b: Second word.
        c: Third word.
    """
    generator[0], generator[1], generator[2], generator[3] = a & _M, b, c, 1
    for _ in range(_MIXING_ROUNDS):
        _next(generator)


@compiled
def uniform(generator: np.ndarray) -> float:
    """Return the next number of a sequence, uniform in [0, 1), a multiple of 2**-53."""
    high, low = _next(generator) >> 5, _next(generator) >> 6
    return float((high * 67108864.0 + low) / 9007199254740992.0)


@compiled
def _next(generator: np.ndarray) -> int:
    a, b, c, counter = (int(generator[0]), int(generator[1]), int(generator[2]), int(generator[3]))
    word = (a + b + counter) & _M
    generator[0] = b ^ (b >> 9)
    generator[1] = (c + (c << 3)) & _M
    generator[2] = (_turn(c, 21) + word) & _M
    generator[3] = (counter + 1) & _M
    return word
