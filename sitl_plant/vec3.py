"""Numbers within limits, vectors of three and 3×3 matrices as tuples.

Compiled code keeps tuples in registers, where small numpy arrays would be allocated one by
one; the compiled step spends no time in the allocator. Matrices are tuples of rows.
"""

import math
from typing import TypeAlias

import numpy as np

from mavlink_defs.runtime.jit import compiled

Vec3: TypeAlias = tuple[float, float, float]
Mat3: TypeAlias = tuple[Vec3, Vec3, Vec3]


@compiled
def clamp(x: float, low: float, high: float) -> float:
    """Return x within low and high."""
    return min(max(x, low), high)


@compiled
def square(x: float) -> float:
    """Return x²: in plain Python x**2 is C's pow, which rounds some otherwise than a product."""
    return x * x


@compiled
def hypot(x: float, y: float) -> float:
    """Return √(x² + y²) as the C library rounds it, which Python's own does not."""
    return float(np.hypot(x, y))


@compiled
def clamp_each(a: Vec3, limit: float) -> Vec3:
    """Return a with each element within ±limit."""
    return clamp(a[0], -limit, limit), clamp(a[1], -limit, limit), clamp(a[2], -limit, limit)


@compiled
def vec3(a: np.ndarray) -> Vec3:
    """Return the three elements of an array of shape (3,)."""
    return a[0], a[1], a[2]


@compiled
def mat3(a: np.ndarray) -> Mat3:
    """Return the rows of an array of shape (3, 3)."""
    return ((a[0, 0], a[0, 1], a[0, 2]), (a[1, 0], a[1, 1], a[1, 2]), (a[2, 0], a[2, 1], a[2, 2]))


@compiled
def add(a: Vec3, b: Vec3) -> Vec3:
    """Return the sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def sub(a: Vec3, b: Vec3) -> Vec3:
    """Return the difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def scale(k: float, a: Vec3) -> Vec3:
    """Return the product k a."""
    return k * a[0], k * a[1], k * a[2]


@compiled
def dot(a: Vec3, b: Vec3) -> float:
    """Return the scalar product aᵀb."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def norm(a: Vec3) -> float:
    """Return the Euclidean length of a."""
    return math.sqrt(dot(a, a))


@compiled
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return the vector product a × b, the paper's S(a) b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled
def mul(m: Mat3, a: Vec3) -> Vec3:
    """Return the product of a matrix and a column, m a."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


@compiled
def mul_t(m: Mat3, a: Vec3) -> Vec3:
    """Return the product of a transposed matrix and a column, mᵀ a."""
    return (
        m[0][0] * a[0] + m[1][0] * a[1] + m[2][0] * a[2],
        m[0][1] * a[0] + m[1][1] * a[1] + m[2][1] * a[2],
        m[0][2] * a[0] + m[1][2] * a[1] + m[2][2] * a[2],
    )
