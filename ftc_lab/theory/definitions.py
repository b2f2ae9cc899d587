"""The laws' equations, evaluated again from the recording, independently of the laws' code.

Each equation takes the recorded values of the quantities in it, which have equations of their
own, so that an error shows in the equation in which it occurs.
"""

from functools import partial
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.state_predictor import MAX_DELAY_S
from ftc_autopilot.control.triggers import Trigger
from ftc_lab.theory.dwell import WIRE_ROUNDING, in_force
from ftc_lab.theory.equality import Equality, compare
from ftc_lab.theory.ground_truth import Known, short_way, solve
from mavlink_defs.constants import THROTTLE

_SURFACES, _THRUST, _YAW = np.arange(THROTTLE), np.array([THROTTLE]), 3


def speed_definitions(known: Known, law: Proposed, trigger: Trigger) -> list[Equality]:
    """Check (31), (33) to (36) with all their terms, trigger and actuator."""
    return [*_speed_errors(known, law), *_thrust(known, law, trigger)]


def _speed_errors(known: Known, law: Proposed) -> list[Equality]:
    """Check the errors (31) and what the law makes of them at once."""
    same = partial(compare, where=known.present, time_s=known.time_s)
    heard = partial(compare, where=known.reported, time_s=known.time_s)
    s, near, lam, V = known.signals, known.neighbours, known.lambda_v, known.signals["V"]
    V_r, V_r_dot = s["reference"][:, 0], s["reference_dot"][:, 0]
    V_tp = s["sync_error"][:, 0]
    V_sizes = (law.lambda1 * V, lam * V_r, law.lambda2 * (near.V @ near.weights))
    return [
        same("(11)", "V", V, np.linalg.norm(known.v, axis=1)),
        _stepped("Assumption 4", "V_r", known, V_r, V_r_dot, s["command"][0, 0]),
        _filtered("V_r and its rate", known, law, slice(0, 1)),
        same("(31)", "Ṽ", s["error"][:, 0], V, -V_r),
        heard(
            "(31)",
            "Ṽ'",
            V_tp,
            law.lambda1 * (V - V_r),
            law.lambda2 * ((V[:, None] - near.V) @ near.weights),
            cancelled=V_sizes,
        ),
        same("(33)", "ζ_v", s["zeta_v"], known.v[:, 0] * lam / (known.mass * V)),
        heard(
            "(33)",
            "r_v",
            s["r_v"],
            lam * V_r_dot,
            law.lambda2 * ((near.V_dot - V_r_dot[:, None]) @ near.weights),
            cancelled=(law.lambda2 * (np.abs(near.V_dot) @ near.weights),),
        ),
    ]


def _thrust(known: Known, law: Proposed, trigger: Trigger) -> list[Equality]:
    """Check the demand (33), its estimates (34) to (36), and what is sent of it."""
    same = partial(compare, where=known.present, time_s=known.time_s)
    s, lam, V = known.signals, known.lambda_v, known.signals["V"]
    V_tp, zeta, drive = s["sync_error"][:, 0], s["zeta_v"], s["alpha_v"] - s["r_v"]
    network = V_tp * s["basis"] / (2.0 * law.h_v1**2)  # vᵀΞ_v/(2 h_v1² V)
    nominal = (known.v * known.drift_v).sum(axis=1) / V  # vᵀ(R1ᵀg + F0/m)/V
    driven, offset = drive * s["beta_v"], s["g_v"] * zeta
    g_growth = law.gamma_v2 * np.abs(V_tp) * zeta
    return [
        same(
            "(33)",
            "α_v",
            s["alpha_v"],
            law.c_v * V_tp,
            lam * nominal,
            lam * s["Phi_v"] * network,
            lam * V_tp / (2.0 * law.h_v2**2),
            cancelled=(lam * np.linalg.norm(known.drift_v, axis=1),),
        ),
        same(
            "(33)",
            "B_v",
            s["B_v"],
            driven * np.tanh(V_tp * driven / law.eps_v),
            offset * np.tanh(V_tp * offset / law.eps_v),
        ),
        same(
            "(33)",
            "T̂",
            s["demand"][:, THROTTLE],
            -(1.0 + in_force(trigger.a1, known.time_s)) * s["B_v"] / zeta,
        ),
        *_estimated(
            known,
            ("(34)", "Φ̂_v", "Phi_v", lam * law.gamma_v1 * V_tp * network, law.sigma_v1, law.phi_v0),
            ("(35)", "ĝ_v", "g_v", g_growth, law.sigma_v2, law.g_v0),
            ("(36)", "β̂_v", "beta_v", law.gamma_v3 * V_tp * drive, law.sigma_v3, law.beta_v0),
        ),
        *_sent(("(25)", "(26)", "(13)"), known, _THRUST, trigger),
    ]


def attitude_definitions(known: Known, law: Proposed, trigger: Trigger) -> list[Equality]:
    """Check (23), (32), (57), (37) to (39) with all their terms, trigger and actuators."""
    return [*_attitude_errors(known, law), *_deflections(known, law, trigger)]


def _attitude_errors(known: Known, law: Proposed) -> list[Equality]:
    """Check the errors (32), and the body rates (57) that they ask for."""
    same = partial(compare, where=known.present, time_s=known.time_s)
    heard = partial(compare, where=known.reported, time_s=known.time_s)
    s, near, lam, lambda4 = known.signals, known.neighbours, known.lambda_omega, law.lambda4
    e, e_prime = s["error"][:, 1:], s["sync_error"][:, 1:]
    phi, phi_r, phi_r_dot = known.attitude, s["reference"][:, 1:], s["reference_dot"][:, 1:]
    e_near = short_way(near.attitude - phi_r[:, None])
    e_sum = np.einsum("kjc,j->kc", short_way(e[:, None] - e_near), near.weights)
    rates = np.einsum("kjc,j->kc", near.attitude_dot - phi_r_dot[:, None], near.weights)
    reports = lambda4 * (np.linalg.norm(near.attitude, axis=2) @ near.weights)
    K1 = in_force(law.K1, known.time_s)
    omega_d = [
        np.einsum("kij,kj->ki", known.R2, term) / lam
        for term in (-K1 * e_prime, lam * phi_r_dot, lambda4 * rates)
    ]
    rate_sizes = lambda4 / lam * (np.linalg.norm(near.attitude_dot, axis=2) @ near.weights)
    filtered = s["omega_d"] - law.tau_omega_d_s * s["omega_d_dot"]  # ω_d behind its filter
    return [
        _stepped("Assumption 4", "ϕ_r", known, phi_r, phi_r_dot, s["command"][0, 1:]),
        _filtered("ϕ_r and its rate", known, law, slice(1, 4)),
        same("(32)", "e", e, short_way(phi - phi_r), cancelled=(phi, phi_r)),
        heard(
            "(32)",
            "e'",
            e_prime,
            law.lambda3 * e,
            lambda4 * e_sum,
            cancelled=(lam * phi, lam * phi_r, reports),
        ),
        heard("(57)", "ω_d", s["omega_d"], *omega_d, cancelled=(rate_sizes,)),
        same("(57)", "e_ω", s["e_omega"], known.omega, -s["omega_d"]),
        _stepped(
            "(57)",
            "ω_d behind its filter",
            known,
            filtered,
            s["omega_d_dot"],
            s["omega_d"][0],
            cancelled=(s["omega_d"],),
        ),
    ]


def _deflections(known: Known, law: Proposed, trigger: Trigger) -> list[Equality]:
    """Check the network (23), the demand (37), its estimates (38), (39), and what is sent of it."""
    same = partial(compare, where=known.present, time_s=known.time_s)
    s, e_omega, zeta = known.signals, known.signals["e_omega"], known.signals["zeta_omega"]
    e_sq, zeta_sq = np.square(e_omega).sum(axis=1), np.square(zeta).sum(axis=1)
    network = s["basis"] / (2.0 * law.h_omega1**2)
    strength = np.square(s["beta_omega"]) * zeta_sq
    gain = strength / np.sqrt(strength * e_sq + law.eps_omega)
    gamma1, gamma2 = law.gamma_omega1, law.gamma_omega2
    beta_growth, beta_size = gamma2 * (e_omega * zeta).sum(axis=1), gamma2 * np.sqrt(e_sq * zeta_sq)
    return [
        same("(23)", "ςᵀς", s["basis"], _basis(known, law)),
        same(
            "(37)",
            "ζ_ω",
            zeta,
            in_force(law.K2, known.time_s) * e_omega,
            known.drift_omega,
            (s["Phi_omega"] * network)[:, None] * e_omega,
            e_omega / (2.0 * law.h_omega2**2),
            known.lambda_omega * solve(np.swapaxes(known.R2, 1, 2), s["sync_error"][:, 1:]),
            -s["omega_d_dot"],
        ),
        same(
            "(37)",
            "δ̂",
            s["demand"][:, :THROTTLE],
            -gain[:, None] * np.einsum("kji,kj->ki", known.G, e_omega),
        ),
        *_estimated(
            known,
            ("(38)", "Φ̂_ω", "Phi_omega", gamma1 * network * e_sq, law.sigma_omega1, law.phi_omega0),
            (
                "(39)",
                "β̂_ω",
                "beta_omega",
                beta_growth,
                law.sigma_omega2,
                law.beta_omega0,
                beta_size,
            ),
        ),
        *_sent(("(29)", "(29)", "(19)"), known, _SURFACES, trigger),
    ]


def thresholds(known: Known, trigger: Trigger) -> tuple[np.ndarray, np.ndarray]:
    """Return relative and absolute thresholds by channel, b1, b2 [rad], a1, a2 [N]; (n, 4)."""
    a1, a2, b1, b2 = (
        in_force(schedule, known.time_s)
        for schedule in (trigger.a1, trigger.a2_n, trigger.b1, trigger.b2_deg)
    )
    b2 = np.radians(b2)
    return np.stack([b1, b1, b1, a1], axis=1), np.stack([b2, b2, b2, a2], axis=1)


def _filtered(symbols: str, known: Known, law: Proposed, channels: slice) -> Equality:
    """Check the reference against the filter (ω/(s + ω))³ of the recorded commands.

    Its second derivative is not recorded, so the filter is run from the first step on, at rest at
    the command, by explicit Euler steps, up to the first step that was missed.
    """
    s, w = known.signals, law.reference_bandwidth_rad_s
    commands = s["command"][:, channels]
    columns = range(s["command"].shape[1])[channels]
    runs = [_run(s["command"][:, c].tolist(), c == _YAW, w, known.period_s) for c in columns]
    value, rate = np.moveaxis(np.array(runs), 0, 2)
    sizes = np.maximum.accumulate(np.abs(commands), axis=0)
    return compare(
        "Assumption 4",
        f"{symbols} from the commands",
        np.hstack([s["reference"][:, channels], s["reference_dot"][:, channels] / w]),
        np.hstack([value, rate / w]),
        where=np.logical_and.accumulate(known.present),
        time_s=known.time_s,
        cancelled=(sizes,),
    )


def _run(commands: list[float], is_yaw: bool, w: float, dt: float) -> list[list[float]]:
    """Return the value and the rate of the filter of one command at each step, before it."""
    x, x_dot, x_ddot = commands[0], 0.0, 0.0
    values, rates = [], []
    for command in commands:
        values.append(x)
        rates.append(x_dot)
        error = wrap(command - x) if is_yaw else command - x
        jerk = w**3 * error - 3.0 * w**2 * x_dot - 3.0 * w * x_ddot
        x, x_dot, x_ddot = x + dt * x_dot, x_dot + dt * x_ddot, x_ddot + dt * jerk
    return [values, rates]


def _estimated(known: Known, *estimates: tuple[Any, ...]) -> list[Equality]:
    """Check the rates of estimates, growth less leakage, and their steps.

    Args:
        known: The flight.
        estimates: Of each the equation, its symbol, the signal, its growth (n,) [1/s], its leakage
            [1/s], its first value, and magnitudes of terms that cancel within the growth.
    """
    s, rates, steps = known.signals, [], []
    same = partial(compare, where=known.present, time_s=known.time_s)
    for equation, symbol, name, growth, leakage, initial, *sizes in estimates:
        rate, leaked = s[f"{name}_dot"], -leakage * s[name]
        rates.append(same(equation, f"rate of {symbol}", rate, growth, leaked, cancelled=sizes))
        steps.append(_stepped(equation, symbol, known, s[name], rate, initial))
    return rates + steps


def _stepped(
    equation: str,
    symbol: str,
    known: Known,
    value: np.ndarray,
    rate: np.ndarray,
    initial: float | np.ndarray,
    cancelled: tuple[np.ndarray, ...] = (),
) -> Equality:
    """Check one explicit Euler step per period, and the value before the first one."""
    dt = known.period_s
    before, change = np.roll(value, 1, axis=0), dt * np.roll(rate, 1, axis=0)
    before[0], change[0] = initial, 0.0
    where = _consecutive(known.present)
    return compare(
        equation,
        f"step of {symbol}",
        value,
        before,
        change,
        where=where,
        time_s=known.time_s,
        cancelled=cancelled,
    )


def _sent(
    equations: tuple[str, str, str], known: Known, channels: np.ndarray, trigger: Trigger
) -> list[Equality]:
    """Check that an event, and only an event, changes what is held, and that it is applied."""
    s, (lowest, highest) = known.signals, known.limits[:, channels]
    held, demand = s["held"][:, channels], s["demand"][:, channels]
    saturated = np.clip(demand, lowest, highest)
    stop = np.where(saturated < 0.0, -lowest, highest)
    share = np.divide(saturated, stop, out=np.zeros_like(saturated), where=stop != 0.0)
    on_wire = share.astype(np.float32).astype(np.float64) * stop
    before = np.roll(held, 1, axis=0)
    before[0] = 0.0
    event = (s["events"][:, None] >> channels & 1).astype(bool)
    relative, absolute = (part[:, channels] for part in thresholds(known, trigger))
    threshold = relative * np.abs(held) + absolute
    beyond = np.maximum(np.abs(saturated - held) - threshold - WIRE_ROUNDING * stop, 0.0)
    healthy = ~known.faulty[:, channels]
    trigger_equation, threshold_equation, actuator_equation = equations
    return [
        compare(
            trigger_equation,
            "held command",
            held,
            np.where(event, on_wire, before),
            where=_consecutive(known.present),
            time_s=known.time_s,
        ),
        compare(
            threshold_equation,
            "command beyond the threshold",
            beyond,
            np.zeros_like(beyond),
            where=known.present,
            time_s=known.time_s,
            cancelled=(highest + threshold,),
        ),
        compare(
            actuator_equation,
            "applied without a fault",
            healthy * known.applied[:, channels],
            healthy * held,
            where=known.prompt,
            time_s=known.time_s,
        ),
    ]


def _basis(known: Known, law: Proposed) -> np.ndarray:
    """ςᵀς of (23), (24), with δ_0 behind its filter; (n,)."""
    s, rbf, share = known.signals, law.rbf, known.period_s / law.tau_delta_s
    delta = np.full((len(s), 3), np.nan)
    made = _made(known)
    last = np.maximum.accumulate(np.where(known.present, np.arange(len(s)), 0))
    for channel in _SURFACES:  # held over the period that ends at the step, 0 before the first
        held = [0.0, *s["held"][last[made], channel][:-1].tolist()]
        filtered = accumulate(held, lambda y, x: y + share * (x - y))
        delta[made, channel] = list(filtered)[: np.count_nonzero(made)]
    inputs = np.hstack([rbf.speed_scale * known.v, known.attitude, known.omega, delta])
    centres = np.linspace(-rbf.span, rbf.span, rbf.neurons)
    squares = sum(np.square(inputs[:, [j]] - centres) for j in range(inputs.shape[1]))
    norm: np.ndarray = np.exp(-2.0 * squares / rbf.width**2).sum(axis=1)
    return norm


def _made(known: Known) -> np.ndarray:
    """Return a mask of the present steps and of the lost ones that the law interpolated, (n,)."""
    made = known.present.copy()
    steps = np.flatnonzero(known.present)
    for before, after in pairwise(steps):
        if (after - before - 1) * known.period_s <= MAX_DELAY_S:
            made[before:after] = True
    return made


def _consecutive(present: np.ndarray) -> np.ndarray:
    """Return a mask of present steps that are first or whose predecessor is present, (n,)."""
    before = np.roll(present, 1)
    before[:1] = True
    both: np.ndarray = present & before
    return both
