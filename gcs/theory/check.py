"""The paper's theorems against one flight: dwell times, residual sets, Lyapunov inequalities."""

import math
from typing import Any

import numpy as np

from ftc_autopilot.laws.proposed import Proposed
from gcs.recording import Recording
from gcs.scenario import Scenario
from gcs.theory.dwell import dwell_times
from gcs.theory.known import known_quantities
from gcs.theory.lyapunov import Subsystem, attitude_subsystem, speed_subsystem
from gcs.theory.residual import residual_sets

__all__ = ["check_theory", "judge"]

_END_S = 3.0
_NO_STEP = (
    "no step of the flight meets the proof's hypotheses: an actuator without effectiveness "
    "throughout, or a command at its stop"
)


def check_theory(recording: Recording, scenario: Scenario) -> dict[str, Any]:
    """Hold one flight against the paper's theorems.

    Args:
        recording: The flight, lost or complete.
        scenario: The scenario that it flew.

    Returns:
        `scenario`, `controller`, `trigger_mode`, `period_s`, `duration_s`, `loss`, and `uavs`,
        a list with for each UAV `id`, `dwell` (see `dwell_times`), `residual` (see
        `residual_sets`), `lyapunov`: `speed` and `attitude` (see `judge`), or None with the
        reason in `lyapunov_absent`. Ready for JSON: what does not exist is None.
    """
    law = scenario.controller
    absent = None
    if not isinstance(law, Proposed):
        absent = f"the theorems speak of the paper's law; this flight's is '{law.kind}'"
    elif len(recording.states) < 2:
        absent = "the flight is shorter than two steps"
    uavs = []
    for i, uav_id in enumerate(recording.uav_ids):
        lyapunov = None
        if isinstance(law, Proposed) and absent is None:
            lyapunov = _lyapunov(recording, i, scenario, law)
        uavs.append(
            {
                "id": uav_id,
                "dwell": dwell_times(recording, i, scenario),
                "residual": residual_sets(recording, i, scenario),
                "lyapunov": lyapunov,
                "lyapunov_absent": absent,
            }
        )
    return {
        "scenario": scenario.name,
        "controller": law.kind,
        "trigger_mode": scenario.trigger.mode,
        "period_s": recording.step_us / 1e6,
        "duration_s": recording.duration_s,
        "loss": recording.loss,
        "uavs": uavs,
    }


def _lyapunov(recording: Recording, i: int, scenario: Scenario, law: Proposed) -> dict[str, Any]:
    known = known_quantities(recording, i, scenario)
    errors = known.signals["sync_error"]
    with np.errstate(all="ignore"):  # a lost flight may end in numbers that are none
        speed = speed_subsystem(known, law, scenario.trigger)
        attitude = attitude_subsystem(known, law, scenario.trigger)
        return {
            "speed": judge(speed, known.time_s, np.abs(errors[:, 0]), "m_s"),
            "attitude": judge(
                attitude, known.time_s, np.degrees(np.linalg.norm(errors[:, 1:], axis=1)), "deg"
            ),
        }


def judge(
    subsystem: Subsystem | None, time_s: np.ndarray, error: np.ndarray, unit: str
) -> dict[str, Any]:
    """Compare one subsystem's V_L with V̇_L <= -κ V_L + χ and with the ultimate bound χ/κ.

    Args:
        subsystem: The subsystem; None if no step counts.
        time_s: Shape (n,).
        error: |Ṽ'| or the norm of e', (n,).
        unit: Of the error, for the names of results.

    Returns:
        `kappa_1_s`, `chi`, `chi_parts`, `ultimate_bound` = χ/κ at the end; of V_L, wherever it
        exists, `initial`, `largest`, `sup_last_3s`, and `ultimate_bound_held`;
        `error_bound_*` = sqrt(2χ/κ) and `error_sup_last_3s_*` of |Ṽ'| or ‖e'‖;
        `finite_difference` and `chain_rule`, both with `steps`, `satisfied` (share of them),
        `largest_excess` (of V̇_L over its bound, per s; negative: the smallest margin), `at_s`,
        `largest_use` (of (V̇_L + κ V_L)/χ; above 1 contradicts); `beyond_threshold`, the same by
        finite differences at the steps that are excluded because the command has left the
        trigger's threshold, as it does at a stop; `contradicted` by finite differences;
        `excluded`: numbers of steps and why; `constants`. V_L, χ and what is made of them have
        V_L's unit, in which the paper adds unlike quantities. Only `absent`, the reason, if
        there is nothing to compare.
    """
    if subsystem is None:
        return {"absent": _NO_STEP}
    s, dt = subsystem, float(time_s[1] - time_s[0])
    finite = np.isfinite(s.V_L) & np.isfinite(s.V_L_dot)
    counted = s.counted & finite
    if not counted.any():
        return {"absent": _NO_STEP}
    stands = s.covered & finite  # V_L exists, whether the inequality is asked for or not
    last = np.flatnonzero(counted)[-1]
    kappa, chi = float(s.kappa[last]), float(s.chi[last])
    ultimate = chi / kappa if kappa > 0.0 else None
    at_end = stands & (time_s > time_s[-1] - _END_S)
    sup = _largest(s.V_L[at_end])
    between = finite[:-1] & finite[1:]
    slope = np.diff(s.V_L) / dt
    finite_difference = _compare(s, between & counted[:-1] & ~s.jumps, slope, time_s)
    if finite_difference["steps"] == 0:
        return {"absent": _NO_STEP}
    beyond = between & (s.covered & ~s.counted)[:-1] & ~s.jumps
    return {
        "kappa_1_s": kappa,
        "chi": chi,
        "chi_parts": s.chi_parts,
        "ultimate_bound": ultimate,
        "initial": float(s.V_L[np.flatnonzero(stands)[0]]),
        "largest": float(s.V_L[stands].max()),
        "sup_last_3s": sup,
        "ultimate_bound_held": None if sup is None or ultimate is None else sup <= ultimate,
        f"error_bound_{unit}": _error_bound(ultimate, unit),
        f"error_sup_last_3s_{unit}": _largest(error[at_end]),
        "finite_difference": finite_difference,
        "chain_rule": _compare(s, counted, s.V_L_dot, time_s),
        "beyond_threshold": _compare(s, beyond, slope, time_s),
        "contradicted": finite_difference["satisfied"] < 1.0,
        "excluded": {
            "no_effectiveness": int(np.count_nonzero(~s.covered)),
            "command_beyond_threshold": int(np.count_nonzero(s.covered & ~s.counted)),
            "jump_of_V_L": int(np.count_nonzero(s.jumps & between & counted[:-1])),
            "not_finite": int(np.count_nonzero(s.counted & ~finite)),
        },
        "constants": s.constants,
    }


def _compare(s: Subsystem, where: np.ndarray, rate: np.ndarray, time_s: np.ndarray) -> Any:
    """Compare V̇_L with its bound at the steps of a mask; mask and rate may lack the last one."""
    at = np.flatnonzero(where)
    if not len(at):
        keys = ("satisfied", "largest_excess", "at_s", "largest_use")
        return {"steps": 0, **dict.fromkeys(keys)}
    decay, chi = s.kappa[at] * s.V_L[at], s.chi[at]
    excess = rate[at] + decay - chi
    worst = int(excess.argmax())
    return {
        "steps": len(at),
        "satisfied": float((excess <= 0.0).mean()),
        "largest_excess": float(excess[worst]),
        "at_s": float(time_s[at[worst]]),
        "largest_use": float(((rate[at] + decay) / chi).max()),
    }


def _error_bound(ultimate: float | None, unit: str) -> float | None:
    """What V_L <= χ/κ says of the error alone: half its square is one of V_L's summands."""
    if ultimate is None:
        return None
    bound = math.sqrt(2.0 * ultimate)
    return math.degrees(bound) if unit == "deg" else bound


def _largest(values: np.ndarray) -> float | None:
    return float(values.max()) if len(values) else None
