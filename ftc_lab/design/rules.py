"""Rules of the parameters that similarity alone would not make right, each with its reason.

`s` is the time scale, `v` the ratio of airspeeds, `m` of masses, `s_i` the time scale of an
axis; 0.5, 0.2 and the like are derived in docs/explanation/design-rules.md.
"""

import math
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from ftc_autopilot.common.schedule import Schedule
from ftc_autopilot.control.diagnosis import DiagnosisParameters, ThrottleDiagnosis
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.laws.pid import Pid
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.control.triggers.scaled import Scaled
from ftc_autopilot.guidance.aircraft_limits import HOME, AircraftLimits, limits_at
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_lab.design.airframe import Airframe, home
from ftc_lab.design.parameters import Line, Rule, by_unit, rounded, scaled, text_of
from ftc_lab.design.similarity import Similarity
from mavlink_defs.config.quantity import Quantity
from mavlink_defs.constants import AILERON

_SERVO = 0.5  # K2 times the servos' lag
_ENGINE = 0.3  # c_v times the engine's lag
_NOISE = 0.2  # of the surfaces' threshold: noise of a command
_FILTER = 0.05, 0.25  # K2 times the time constant of a noisy gyro's filter
_ROLL_RATE = 0.6  # of the steady roll rate by full aileron
_BELOW_STALL_DEG = 3.0

HIDDEN_UNITS = {
    "eps_v": "m^2/s^3",  # (33): of Ṽ' times an acceleration
    "gamma_v1": "1/m^2",  # (34)
    "gamma_v2": "kg^2/s^2",  # (35)
    "gamma_v3": "s^2/m^2",  # (36)
    "h_v2": "s^0.5",  # (33): Ṽ'/h² is an acceleration
    "phi_v0": "1/s",
    "g_v0": "N",
    "eps_omega": "s^2",  # (37), with β as below
    "gamma_omega2": "s^6",  # (39)
    "h_omega2": "s^0.5",  # (37): e_ω/h² is an angular acceleration
    "gain_floor": "s^4",
    "phi_omega0": "1/s",
    "beta_omega0": "s^4",  # (37): the same deflection for ζ_ω ~ 1/s² and G ~ 1/s²
}
"""Units of what Table III prints without: with them, (33) to (39) are similar."""


@dataclass(frozen=True)
class Conditions:
    """What flies with the aircraft, and is given.

    Attributes:
        servo_lag_s: Lag of the surfaces' servos.
        servo_rate_deg_s: Their rate limit; None: unlimited.
        engine_lag_s: Lag of the thrust.
        gyro_noise_deg_s: Standard deviation of a sample's white noise.
        gyro_delay_s: Age of a sample.
        step_us: Control period.
    """

    servo_lag_s: float = 0.0
    servo_rate_deg_s: float | None = None
    engine_lag_s: float = 0.0
    gyro_noise_deg_s: float = 0.0
    gyro_delay_s: float = 0.0
    step_us: int = 1000


@dataclass(frozen=True)
class Rules:
    """The rules for one aircraft.

    Attributes:
        airframe: The aircraft.
        similar: Its units.
        given: What flies with it.
        least_b2_deg: Least absolute threshold of a surface, for the aircraft that the defaults were
            found on.
    """

    airframe: Airframe
    similar: Similarity
    given: Conditions
    least_b2_deg: float = 1.0

    def rule_of(self, model: BaseModel, name: str, declared: Quantity) -> Rule | None:
        """Return the rule of a field's own; None if its unit says all."""
        if isinstance(model, TriggerParameters | DiagnosisParameters | ThrottleDiagnosis | Pid):
            by_hardware = self._of_actuators(model, name, declared)
            if by_hardware is not None:
                return by_hardware
        if isinstance(model, LawParameters):
            return self._of_law(model, name)
        if isinstance(model, GuidanceParameters):
            return self._of_guidance(name)
        return None

    def _of_actuators(self, model: BaseModel, name: str, declared: Quantity) -> Rule | None:
        if isinstance(model, ThrottleDiagnosis) and declared.unit == "N":
            return self._share_of_thrust
        is_deflection = declared.unit == "deg" and (
            not isinstance(model, Pid) or name == "integral_limit_deg"
        )
        if is_deflection:
            return self._share_of_stop
        if isinstance(model, TriggerParameters) and name == "a2_n":
            return lambda value: self._thrust_threshold(value, model.a1)
        if isinstance(model, Scaled) and name == "within_s":
            return self._remembered
        return None

    def _of_law(self, model: LawParameters, name: str) -> Rule | None:
        rules: dict[str, Rule] = {
            "c_v": self._speed_gain,
            "rate_limit_deg_s": self._rates,
            "return_deg_s": self._rates,
            "lead_s": self._leads,
            "alpha_limit_deg": self._below_stall,
            "roll_room_deg": self._share_of_aileron,
            "delay_s": lambda _: Line(self.given.gyro_delay_s, "delay of the gyro, given"),
        }
        if hasattr(model, "K2"):
            K2 = model.K2
            rules["K1"] = lambda K1: self._gains(K1, K2, "K1")
            rules["K2"] = lambda _: self._gains(K2, K2, "K2")
            rules["gyro_filter_s"] = lambda _: self._gyro_filter(K2)
        if isinstance(model, Pid):
            rules["rate_p"] = lambda value: self._rate_loop(value, 1.0)
            rules["rate_i"] = lambda value: self._rate_loop(value, 2.0)
            rules["rate_ff"] = self._feed_forward
            rules["thrust_trim_n"] = self._trim_thrust
        if isinstance(model, Proposed) and name in HIDDEN_UNITS:
            return lambda value: by_unit(value, HIDDEN_UNITS[name], self.similar)
        return rules.get(name)

    def _of_guidance(self, name: str) -> Rule | None:
        if name in {"min_altitude_m", "max_altitude_m", "wind_max_m_s"}:
            return lambda value: Line(value, "default: of the place, not of the aircraft")
        if name not in AircraftLimits._fields:
            return None
        value, airframe = getattr(self.limits, name), self.airframe
        text = f"{getattr(HOME, name):g} × v, within the aircraft's limits"
        if value == airframe.fastest < airframe.aircraft.airspeed_max_m_s:
            text = "the fastest level flight that the thrust holds"
        reasons = {
            "incidence_max_deg": "3 deg below the stall",
            "climb_max_deg": "what 0.9 of the thrust climbs, at most 20 deg",
            "acceleration_max_m_s2": "thrust to spare by mass, at most 20 m/s^2",
        }
        if airframe.aircraft.stall_deg is None:
            reasons["incidence_max_deg"] = "default, as the aircraft has no stall_deg"
        return lambda _: Line(value, reasons.get(name, text))

    @property
    def limits(self) -> AircraftLimits:
        """Limits of guidance."""
        one = self.airframe
        return limits_at(one.aircraft, one.airspeed, one.flight.thrust_n, one.fastest)

    # actuators

    def _share_of_stop(self, value: Any) -> Line:
        """The same share of each surface's stop; of one number for all, of the nearest stop."""
        shares = self.similar.stops
        least = min(shares)
        is_list = isinstance(value, list | tuple)
        number = scaled(value, shares if is_list else least, self.similar.time)
        if shares == (1.0, 1.0, 1.0) and self.similar.time == 1.0:
            return Line(number, "default")
        until = " ..., times × s" if isinstance(value, Schedule) else ""
        return Line(number, f"{text_of(value)} of 35 deg, as a share of the stop{until}")

    def _share_of_aileron(self, value: float) -> Line:
        """The same share of the aileron's stop."""
        share = self.similar.stops[AILERON]
        rule = "default" if share == 1.0 else f"{value:g} of 35 deg, as a share of the stop"
        return Line(rounded(value, share), rule)

    def _share_of_thrust(self, value: float) -> Line:
        """A force by its unit, but no larger a share of the thrust limit than at home."""
        similar = self.similar.factor("N")
        share = self.airframe.largest_thrust / home().largest_thrust
        if share < similar:
            return Line(rounded(value, share), f"{value:g} of 2000 N, as a share of the limit")
        return Line(rounded(value, similar), f"{value:g} × {self.similar.formula('N')}")

    def _thrust_threshold(self, value: Schedule[float], a1: Schedule[float]) -> Line:
        """The same acceleration as at home, a1 T + a2 with the thrust of level flight."""
        force, relative = self.similar.factor("N"), a1.windows()[0][1]
        thrust = home().flight.thrust_n * force - self.airframe.flight.thrust_n
        more = relative * thrust
        moved = [
            {
                **({} if until == math.inf else {"until_s": until}),
                "value": max(one + more / force, 0.0),
            }
            for until, one in value.windows()
        ]
        number = scaled(type(value).model_validate(moved), force, self.similar.time)
        return Line(number, f"{text_of(value)} N and a1 of 895 N, × m v s^-1")

    def _remembered(self, value: float) -> Line:
        """A time by its unit, within what the trigger remembers: 64 control periods."""
        longest = 64 * self.given.step_us / 1e6
        least = min(rounded(value, self.similar.time), longest)
        return Line(least, f"{value:g} × s, at most 64 control periods")

    # laws

    def gain_factors(self, K2: Any) -> tuple[float, ...]:
        """Return the ratios of the gains to the defaults, by axis: authority and servo."""
        lag = self.given.servo_lag_s
        largest = _largest(K2)
        most = [
            min(1.0, _SERVO / lag / k * s) if lag > 0.0 else 1.0 for k, s in self._axes(largest)
        ]
        return tuple(f / s for f, (_, s) in zip(most, self._axes(largest), strict=True))

    def _axes(self, values: tuple[float, ...]) -> list[tuple[float, float]]:
        return list(zip(values, self.similar.axes, strict=True))

    def _gains(self, value: Any, K2: Any, name: str) -> Line:
        number = scaled(value, self.gain_factors(K2), self.similar.time)
        limit = f", K2 <= {_SERVO:g}/servo lag" if self.given.servo_lag_s > 0.0 else ""
        if name == "K1" and limit:
            limit = ", in proportion to K2"
        return Line(number, f"{text_of(value)} / s_i{limit}")

    def _gyro_filter(self, K2: Any) -> Line:
        """A low pass that leaves so much noise of K2 σ/M as the trigger does not see.

        The diagnosis sees noise that no trigger does, so that a phase of 3 deg is spent anyhow.
        """
        sigma = math.radians(self.given.gyro_noise_deg_s)
        text = "noise of the surfaces' commands at most 0.2 b2, within [0.05, 0.25]/K2"
        if sigma == 0.0:
            return Line(0.0, text)
        gains = [k * f for k, f in zip(_largest(K2), self.gain_factors(K2), strict=True)]
        effect = self.airframe.effect
        noise = max(k * sigma / M for k, M in zip(gains, effect, strict=True) if M > 0.0)
        least = _NOISE * math.radians(self.least_b2_deg * min(self.similar.stops))
        worst = noise / least
        tau = 0.5 * self.given.step_us / 1e6 * worst**2 if worst > 1.0 else 0.0
        low, high = (share / max(gains) for share in _FILTER)
        return Line(float(f"{min(max(tau, low), high):.2g}"), text)

    def _speed_gain(self, value: float) -> Line:
        number = rounded(value, self.similar.factor("1/s"))
        lag = max(self.given.engine_lag_s, self.airframe.engine_lag_s)
        if lag > 0.0 and _ENGINE / lag < number:
            return Line(rounded(_ENGINE, 1.0 / lag), f"{_ENGINE:g}/engine lag")
        return Line(number, f"{value:g} × s^-1")

    def _rates(self, value: Any) -> Line:
        steady = self.airframe.authority[0] / max(self.airframe.damping[0], 1e-9)
        most = _ROLL_RATE * math.degrees(steady)
        number = scaled(value, [1.0 / s for s in self.similar.axes], 1.0)
        text = f"{text_of(value)} / s_i"
        if most < number[0]:
            number[0] = rounded(most, 1.0 + 1e-12)
            text += ", roll 0.6 of the steady rate by full aileron"
        return Line(number, text)

    def _leads(self, value: Any) -> Line:
        """The time that a surface takes to turn its axis; of the airspeed, by its unit."""
        number = scaled(value, (self.similar.time, *self.similar.axes), 1.0)
        return Line(number, f"{text_of(value)} × s, s_i")

    def _below_stall(self, value: float) -> Line:
        stall = self.airframe.aircraft.stall_deg
        if stall is None:
            return Line(value, "default, as the aircraft has no stall_deg")
        return Line(min(value, round(stall - _BELOW_STALL_DEG, 1)), "3 deg below the stall")

    def _rate_loop(self, value: Any, power: float) -> Line:
        ratios = zip(home().effect, self.airframe.effect, self.similar.axes, strict=True)
        factors = [known / M / s**power for known, M, s in ratios]
        text = "bandwidth 45/(M_i s_i)" if power == 1.0 else "a tenth of a second, times s_i"
        return Line(scaled(value, factors, 1.0), f"{text_of(value)} by authority: {text}")

    def _feed_forward(self, value: Any) -> Line:
        known, own = home(), self.airframe
        pairs = zip(known.damping, known.effect, own.damping, own.effect, strict=True)
        factors = [(d / M) / (d0 / M0) for d0, M0, d, M in pairs]
        return Line(scaled(value, factors, 1.0), f"{text_of(value)} by damping over authority")

    def _trim_thrust(self, value: float) -> Line:
        factor = self.airframe.flight.thrust_n / home().flight.thrust_n
        return Line(rounded(value, factor), "thrust of level flight")


def _largest(gains: Any) -> tuple[float, ...]:
    """Return the largest gain of each axis, over all windows of a schedule."""
    windows = gains.windows() if isinstance(gains, Schedule) else ((math.inf, gains),)
    return tuple(max(axis) for axis in zip(*(value for _, value in windows), strict=True))
