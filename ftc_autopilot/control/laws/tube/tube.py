"""The tube: a path for every output, and how far the output may be from it.

The path is the reference as its filter goes on if the command stays, moved by the neighbours'
share of (31) and (32), which stays as well. The tube is wider while the reference is on its way,
since an error of alternating sign costs nothing there; and around an aircraft outside it lies a
funnel that leads back in.
"""

import math

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.control.laws.tube.parameters import OUTPUTS
from ftc_autopilot.control.step import Step
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import square

_YAW = 3


@compiled
def build_tube(now: Step, rows: int, gains: np.void, path: np.ndarray, width: np.ndarray) -> None:
    """Write the tube of every output after h, 2h, ...

    With z = y_r - c, ω the filter's bandwidth and E the error of (31) or (32) by its weight:

        y_r(s) = c + e^{-ωs} (z + (z' + ωz) s + (z'' + 2ωz' + ω²z) s²/2)
        D(s) = d + k |y_r(s) - c| + max(0, |E| - d - k |z|) e^{-s/τ}

    where |E| counts up to `return`·τ; what is beyond becomes part of the path, and shrinks at
    that rate.

    Args:
        now: The present step.
        rows: Steps h of the prediction.
        gains: Parameters, record made of `Tube`.
        path: Written, shape (4, at least rows).
        width: Half the width D, written, shape (4, at least rows).
    """
    errors, command, reference, bandwidth = now.errors, now.command, now.filtered, now.bandwidth
    own = (errors.V_tilde, errors.e[0], errors.e[1], errors.e[2])
    lam = errors.lambda_omega
    e = errors.e_prime
    weighted = (errors.V_tilde_prime / errors.lambda_v, e[0] / lam, e[1] / lam, e[2] / lam)
    h, tau, scale = gains["prediction_step_s"], gains["funnel_s"], gains["tube_scale"]
    filter_step, funnel_step = math.exp(-bandwidth * h), math.exp(-h / tau)
    for o in range(OUTPUTS):
        target = command[o]
        filtered, slope, bend = reference[o]
        z = filtered - target
        error, neighbours = weighted[o], own[o] - weighted[o]
        if o == 0:
            d, rate = scale * gains["width_m_s"], gains["return_m_s2"]
        else:
            z, error, neighbours = wrap(z), wrap(error), wrap(neighbours)
            if o == _YAW and now.by_bank != 0:  # the error is against the direction of flight
                target, z, slope, bend = 0.0, 0.0, 0.0, 0.0
            d, rate = scale * gains["width_rad"][o - 1], gains["return_rad_s"][o - 1]
        k = scale * gains["widening"][o]
        inside = d + k * abs(z)
        beyond = max(abs(error) - max(rate * tau, inside), 0.0)
        outside = max(abs(error) - beyond - inside, 0.0)
        slope, bend = slope + bandwidth * z, bend + 2.0 * bandwidth * slope + square(bandwidth) * z
        filter_decay, funnel_decay = 1.0, 1.0
        for i in range(rows):
            s = (i + 1) * h
            filter_decay *= filter_step
            funnel_decay *= funnel_step
            ahead = filter_decay * (z + slope * s + 0.5 * bend * s * s)
            left = math.copysign(max(beyond - rate * s, 0.0), error)
            path[o, i] = target + ahead + neighbours + left
            width[o, i] = d + k * abs(ahead) + outside * funnel_decay


@compiled
def to_errors(outputs: np.ndarray, path: np.ndarray, rows: int) -> None:
    """Turn outputs into errors against their paths: airspeed [m/s], angles [rad] the short way."""
    for k in range(rows):
        outputs[0, k] -= path[0, k]
        for o in range(1, OUTPUTS):
            outputs[o, k] = wrap(outputs[o, k] - path[o, k])
