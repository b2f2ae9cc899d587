"""SHA-256 (FIPS 180-4) for compiled code, as far as MAVLink signatures need it."""

import numpy as np

from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_bytes

_M = 0xFFFFFFFF
_KEY, _BLOCK = 32, 64  # bytes


def _root_bits(n: int, root: int) -> list[int]:
    """Return 32 bits after the point of the square or cube roots of the first n primes."""
    primes = [p for p in range(2, 312) if all(p % q for q in range(2, p))][:n]
    bits = []
    for p in primes:
        scaled = p << (32 * root)
        low, high = 0, 1 << 40
        while high - low > 1:  # integer root by bisection, so that every bit is right
            middle = (low + high) // 2
            low, high = (middle, high) if middle**root <= scaled else (low, middle)
        bits.append(low & _M)
    return bits


_H = np.array(_root_bits(8, 2), np.int64)
_K = np.array(_root_bits(64, 3), np.int64)


@compiled
def signature(key: np.ndarray, data: np.ndarray, size: int) -> int:
    """Return the first 48 bits of the SHA-256 of a key and data[:size].

    Args:
        key: 32 bytes, uint8.
        data: uint8, at most 300 bytes are covered.
        size: Number of bytes of `data`.
    """
    padded = np.zeros(384, np.uint8)
    copy_bytes(padded, 0, key, 0, _KEY)
    copy_bytes(padded, _KEY, data, 0, size)
    total = _KEY + size
    padded[total] = 0x80
    blocks = (total + 9 + _BLOCK - 1) // _BLOCK
    padded[_BLOCK * blocks - 2] = (total * 8) >> 8
    padded[_BLOCK * blocks - 1] = (total * 8) & 0xFF
    state, w = _H.copy(), np.zeros(64, np.int64)
    for block in range(blocks):
        _compress(state, w, padded[_BLOCK * block : _BLOCK * (block + 1)])
    return int((state[0] << 16) | (state[1] >> 16))


@compiled
def _compress(state: np.ndarray, w: np.ndarray, block: np.ndarray) -> None:
    for i in range(16):
        word = 0
        for k in range(4):
            word = (word << 8) | int(np.int64(block[4 * i + k]))
        w[i] = word
    for i in range(16, 64):
        x, y = w[i - 15], w[i - 2]
        s0 = _turn(x, 7) ^ _turn(x, 18) ^ (x >> 3)
        s1 = _turn(y, 17) ^ _turn(y, 19) ^ (y >> 10)
        w[i] = (w[i - 16] + s0 + w[i - 7] + s1) & _M
    a, b, c, d = state[0], state[1], state[2], state[3]
    e, f, g, h = state[4], state[5], state[6], state[7]
    for i in range(64):
        s1 = _turn(e, 6) ^ _turn(e, 11) ^ _turn(e, 25)
        t1 = h + s1 + ((e & f) ^ (~e & g)) + _K[i] + w[i]
        t2 = (_turn(a, 2) ^ _turn(a, 13) ^ _turn(a, 22)) + ((a & b) ^ (a & c) ^ (b & c))
        h, g, f, e = g, f, e, (d + t1) & _M
        d, c, b, a = c, b, a, (t1 + t2) & _M
    state[0], state[1] = (state[0] + a) & _M, (state[1] + b) & _M
    state[2], state[3] = (state[2] + c) & _M, (state[3] + d) & _M
    state[4], state[5] = (state[4] + e) & _M, (state[5] + f) & _M
    state[6], state[7] = (state[6] + g) & _M, (state[7] + h) & _M


@compiled
def _turn(x: int, n: int) -> int:
    """Return a 32-bit word rotated right by n bits."""
    return ((x >> n) | (x << (32 - n))) & _M
