"""Configuration of the propulsion: the largest thrust, how fast it follows, which moments it makes.

The largest thrust by airspeed is a table, or follows from a propeller and its motor; the compiled
code knows the table alone (`sitl_plant.airframe.thrust`).
"""

import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import model_validator

from mavlink_defs.config.models import AtMost, Model, Problems
from mavlink_defs.config.quantity import quantity

_MIN_ROWS, MAX_ROWS = 2, 8
"""Rows of a table of thrust, at least and at most."""
_MAX_SPEED_M_S = 300  # airspeeds at which a propeller is looked at


_Coefficient = Annotated[float, quantity("", "Coefficient of a power of J.")]


class ThrustRow(Model):
    """Largest thrust at an airspeed.

    Attributes:
        airspeed_m_s: Airspeed.
        thrust_n: Largest thrust there.
    """

    airspeed_m_s: float = quantity("m/s", ge=0.0, le=300.0)
    thrust_n: float = quantity("N", ge=0.0)


class Operation(NamedTuple):
    """What a propeller does at an airspeed."""

    thrust_n: float
    torque_n_m: float
    speed_rad_s: float


class Propeller(Model):
    """A propeller of fixed pitch on an electric motor.

    Coefficients are C_0 + C_1 J + C_2 J² in the advance ratio J = V/(n D), with n in revolutions
    per second: thrust = ρ n² D⁴ C_T, torque = ρ n² D⁵ C_Q.

    Attributes:
        diameter_m: Diameter D.
        thrust_coefficients: C_T: constant, linear and quadratic in the advance ratio.
        torque_coefficients: C_Q: constant, linear and quadratic in the advance ratio.
        kv_rpm_v: Speed constant of the motor.
        resistance_ohm: Resistance of its winding.
        no_load_current_a: Current without load.
        voltage_v: Voltage at full throttle.
        turns: Sense of rotation as seen from behind.
    """

    diameter_m: float = quantity("m", gt=0.0)
    thrust_coefficients: tuple[_Coefficient, _Coefficient, _Coefficient]
    torque_coefficients: tuple[_Coefficient, _Coefficient, _Coefficient]
    kv_rpm_v: float = quantity("rpm/V", gt=0.0)
    resistance_ohm: float = quantity("ohm", gt=0.0)
    no_load_current_a: float = quantity("A", ge=0.0)
    voltage_v: float = quantity("V", gt=0.0)
    turns: Literal["clockwise", "counterclockwise"] = "clockwise"

    @model_validator(mode="after")
    def _pulls(self) -> "Propeller":
        least = self.no_load_current_a * self.resistance_ohm
        if self.voltage_v <= least:
            text = f"expected > no_load_current_a resistance_ohm = {least:g} V, so that it turns"
            raise Problems([(("voltage_v",), f"{text}, got {self.voltage_v!r}")])
        for name in ("thrust_coefficients", "torque_coefficients"):
            at_rest = getattr(self, name)[0]
            if at_rest <= 0.0:
                text = f"expected a first one > 0, of the standing aircraft, got {at_rest!r}"
                raise Problems([((name,), text)])
        return self

    def at(self, airspeed_m_s: float, air_density_kg_m3: float) -> Operation:
        """Return what it does at full throttle, where motor and propeller have the same torque.

        With K the motor's constant [V s/rad], Ω the rotational speed and U the voltage,

            ρ D⁵ C_Q0/(2π)² Ω² + (ρ D⁴ C_Q1 V/(2π) + K²/R) Ω + ρ D³ C_Q2 V² - K U/R + K i_0 = 0.

        Source: R. W. Beard, T. W. McLain, Small Unmanned Aircraft, section 4.3, eqs. (4.17) to
        (4.22) as revised in the supplement at uavbook.byu.edu.

        Args:
            airspeed_m_s: Airspeed V.
            air_density_kg_m3: Density of the air ρ.
        """
        rho, V, D = air_density_kg_m3, airspeed_m_s, self.diameter_m
        K, R = 60.0 / (2.0 * math.pi * self.kv_rpm_v), self.resistance_ohm
        q0, q1, q2 = self.torque_coefficients
        a = rho * D**5 * q0 / (2.0 * math.pi) ** 2
        b = rho * D**4 * q1 * V / (2.0 * math.pi) + K * K / R
        c = rho * D**3 * q2 * V * V - K * self.voltage_v / R + K * self.no_load_current_a
        root = b * b - 4.0 * a * c
        speed = (-b + math.sqrt(root)) / (2.0 * a) if root > 0.0 else 0.0
        if speed <= 0.0:
            return Operation(0.0, 0.0, 0.0)
        n = speed / (2.0 * math.pi)
        J = V / (n * D)
        t0, t1, t2 = self.thrust_coefficients
        thrust = rho * n * n * D**4 * (t0 + t1 * J + t2 * J * J)
        torque = rho * n * n * D**5 * (q0 + q1 * J + q2 * J * J)
        return Operation(thrust, torque, speed)

    def table(self, air_density_kg_m3: float) -> tuple[ThrustRow, ...]:
        """Return the largest thrust at `MAX_ROWS` airspeeds, evenly from 0 to where it is zero."""
        whole = range(1, _MAX_SPEED_M_S + 1)
        beyond = (V for V in whole if self.at(float(V), air_density_kg_m3).thrust_n <= 0.0)
        high = float(next(beyond, _MAX_SPEED_M_S))
        low = high - 1.0
        while high - low > 1e-9 * high:
            middle = (low + high) / 2.0
            pulls = self.at(middle, air_density_kg_m3).thrust_n > 0.0
            low, high = (middle, high) if pulls else (low, middle)
        airspeeds = np.linspace(0.0, high, MAX_ROWS).tolist()
        found = [max(self.at(V, air_density_kg_m3).thrust_n, 0.0) for V in airspeeds]
        return tuple(
            ThrustRow(airspeed_m_s=V, thrust_n=T) for V, T in zip(airspeeds, found, strict=True)
        )


class Propulsion(Model):
    """What makes the thrust, which a command asks for in N; without it, any thrust at once.

    Attributes:
        thrust: Largest thrust by airspeed, linear in between, constant beyond the ends.
        propeller: In place of `thrust`: what it follows from.
        lag_s: Time constant of the thrust; of it and `servos.throttle.lag_s` the larger one counts.
        torque_arm_m: Rolling moment by thrust, from the propeller's torque; none: `propeller`'s, or
            0.
        pitch_arm_m: Pitching moment by thrust: how far below the centre of gravity it is.
        yaw_arm_m: Yawing moment by thrust: how far left of the centre of gravity it is.
    """

    thrust: Annotated[tuple[ThrustRow, ...] | None, AtMost(MAX_ROWS, "row")] = None
    propeller: Propeller | None = None
    lag_s: float = quantity("s", default=0.0, ge=0.0, le=10.0)
    torque_arm_m: float | None = quantity("m", default=None)
    pitch_arm_m: float = quantity("m", default=0.0)
    yaw_arm_m: float = quantity("m", default=0.0)

    @model_validator(mode="after")
    def _one_form(self) -> "Propulsion":
        rows = self.thrust
        if rows is None:
            return self
        if self.propeller is not None:
            text = "expected thrust or propeller, from which the thrust follows, got both"
            raise Problems([((), f"{text}: leave one out")])
        if len(rows) < _MIN_ROWS:
            text = f"expected {_MIN_ROWS} to {MAX_ROWS} rows, got {len(rows)}"
            raise Problems([(("thrust",), text)])
        for i in range(1, len(rows)):
            before, airspeed = rows[i - 1].airspeed_m_s, rows[i].airspeed_m_s
            if airspeed <= before:
                text = f"expected > {before!r} m/s, as in the row before, got {airspeed!r}"
                raise Problems([(("thrust", i, "airspeed_m_s"), text)])
        return self

    def table(self, air_density_kg_m3: float) -> tuple[ThrustRow, ...]:
        """Return the rows of the largest thrust by airspeed; none if it is the same everywhere."""
        if self.propeller is not None:
            return self.propeller.table(air_density_kg_m3)
        return self.thrust or ()

    def arms_m(self, air_density_kg_m3: float, airspeed_m_s: float) -> tuple[float, float, float]:
        """Return rolling, pitching and yawing moment by thrust [m].

        Args:
            air_density_kg_m3: Density of the air.
            airspeed_m_s: Airspeed at which a propeller at full throttle has the torque that counts.
        """
        roll = self.torque_arm_m or 0.0
        if self.torque_arm_m is None and self.propeller is not None:
            found = self.propeller.at(airspeed_m_s, air_density_kg_m3)
            roll = found.torque_n_m / found.thrust_n if found.thrust_n > 0.0 else 0.0
            roll = -roll if self.propeller.turns == "clockwise" else roll
        return roll, self.pitch_arm_m, self.yaw_arm_m
