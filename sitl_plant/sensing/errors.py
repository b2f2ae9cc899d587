"""What a sensor makes of the true values: scale, misalignment, bias, noise, range, resolution.

A sample is, with the truth x at the time of the measurement,

    y = (I + M) x + b + g + n, within the range, rounded to the resolution,

where M (scale factors on the diagonal, misalignments beside it) and b are drawn at turn-on, g is
a first-order Gauss-Markov process (IEEE Std 952-1997, annex C), and n is white.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.air.gaussian import normal, normals

AXES = 6
"""Most values in a sample: position and velocity of a GNSS receiver."""

_MATRIX = (3, 3)
_EACH = (AXES,)

ERRORS = np.dtype(
    [
        ("kind", "i8"),  # see `sitl_plant.sensing.units`
        ("imu", "i8"),  # which IMU it belongs to, from 0
        ("axes", "i8"),  # values in a sample
        ("seed", "i8"),
        ("system", "i8"),  # the aircraft's id
        ("channel", "i8"),  # first of its channels of random numbers
        ("every", "i8"),  # control periods from sample to sample
        ("late", "i8"),  # control periods from measurement to report
        ("matrix", "f8", _MATRIX),  # I + M, of the first three values
        ("bias", "f8", _EACH),
        ("noise", "f8", _EACH),  # standard deviation of a sample's white noise
        ("decay", "f8", _EACH),  # of the Gauss-Markov process, from sample to sample
        ("kick", "f8", _EACH),  # standard deviation of what drives it, per sample
        ("drift", "f8", _EACH),  # the process itself
        ("low", "f8", _EACH),
        ("high", "f8", _EACH),
        ("resolution", "f8", _EACH),
    ]
)
"""One sensor of one aircraft and its state, in the units of its samples."""

CHANNELS = 20
"""Channels of random numbers of one sensor: of its values, then of its turn-on errors."""

_PEAK_OF_ALLAN = 0.437 * math.sqrt(2.0)
"""Peak of the Allan deviation of a Gauss-Markov process in units of its standard deviation."""


class SensorErrors(NamedTuple):
    """Standard deviations of one sensor's errors, in the units of its samples, by value."""

    noise: Sequence[float]
    drift: Sequence[float]  # of the Gauss-Markov process
    correlation_s: float
    bias: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]
    resolution: Sequence[float]
    scale: float = 0.0
    misalignment: float = 0.0  # rad


def white_noise(density: float, period_s: float) -> float:
    """Return the standard deviation of samples of white noise of a one-sided density.

    The noise of a sampled signal lies below half its rate: density * sqrt(rate / 2). The Allan
    deviation of such samples is density / sqrt(2 tau), an angle random walk of density / sqrt(2).
    """
    return density / math.sqrt(2.0 * period_s)


def gauss_markov(bias_instability: float) -> float:
    """Return the standard deviation of the process whose Allan deviation has this as its peak.

    By IEEE Std 952-1997, annex C.1.1.5, the peak is at 1.89 correlation times, where it is 0.437
    times the driving density and the root of the correlation time.
    """
    return bias_instability / _PEAK_OF_ALLAN


def turn_on(sensor: np.void, errors: SensorErrors, period_s: float) -> None:
    """Write a sensor's errors to its record, and draw the errors of turn-on.

    Args:
        sensor: Record of dtype `ERRORS`, whose `axes`, `seed`, `system` and `channel` are set.
        errors: Its errors.
        period_s: Time from sample to sample [s].
    """
    n = int(sensor["axes"])
    key = int(sensor["seed"]), int(sensor["system"])
    decay = math.exp(-period_s / errors.correlation_s)
    for name in ("noise", "low", "high", "resolution"):
        sensor[name][:n] = getattr(errors, name)
    sensor["decay"] = decay
    first = int(sensor["channel"]) + AXES
    for k in range(n):
        drift, bias = normals(*key, first + k, 0)
        sensor["kick"][k] = errors.drift[k] * math.sqrt(1.0 - decay * decay)
        sensor["drift"][k] = errors.drift[k] * drift
        sensor["bias"][k] = errors.bias[k] * bias
    sensor["matrix"] = np.eye(3)
    for row in range(min(n, 3)):
        for column in range(min(n, 3)):
            size = errors.scale if row == column else errors.misalignment
            channel = first + 3 * row + column
            sensor["matrix"][row, column] += size * normal(*key, channel, 1)


@compiled
def is_due(sensor: np.void, step: int) -> bool:
    """Return whether a sensor has a new sample to report in a step.

    The one of step 0 comes at once: the aircraft was held there for longer than any latency.
    """
    measured = step - sensor["late"]
    return bool(step == 0 or (measured > 0 and measured % sensor["every"] == 0))


@compiled
def corrupt(sensor: np.void, measured: int, values: np.ndarray) -> None:
    """Turn the true values into a sample.

    Args:
        sensor: Record of dtype `ERRORS`; its Gauss-Markov process advances.
        measured: Step of the measurement.
        values: The true values, shape (AXES,), changed in place.
    """
    matrix = sensor["matrix"]
    x, y, z = values[0], values[1], values[2]
    for k in range(min(sensor["axes"], 3)):
        values[k] = matrix[k, 0] * x + matrix[k, 1] * y + matrix[k, 2] * z
    for k in range(sensor["axes"]):
        noise, kick = sensor["noise"][k], sensor["kick"][k]
        value = values[k] + sensor["bias"][k]
        if noise > 0.0 or kick > 0.0:
            white, driving = normals(
                sensor["seed"], sensor["system"], sensor["channel"] + k, measured
            )
            if measured > 0:
                sensor["drift"][k] = sensor["decay"][k] * sensor["drift"][k] + kick * driving
            value += sensor["drift"][k] + noise * white
        value = min(max(value, sensor["low"][k]), sensor["high"][k])
        if sensor["resolution"][k] > 0.0:
            value = round(value / sensor["resolution"][k]) * sensor["resolution"][k]
        values[k] = value
