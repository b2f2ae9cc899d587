"""What an autopilot is told: nominal aircraft, controller, trigger, neighbours, links.

It holds nothing of faults, disturbances or the true aircraft: the controller must not know.
Names are the paper's, in ASCII; defaults are the values of Table III, or where the paper gives
none, a set that flies well with Table III kept to the letter. Angles inside the laws are rad.
"""

import math
from typing import Annotated, Any, Generic, Literal, TypeAlias, TypeVar

from pydantic import ConfigDict, Discriminator, Field, RootModel, Tag, model_validator

from mavlink_defs.config import HostPort, Loc, Model, Problems, SystemId, repeated
from mavlink_defs.quantity import quantity, whole
from sitl_plant.config import Aircraft

__all__ = [
    "MAX_NEURONS", "MAX_WINDOWS", "AutopilotConfig", "ControllerParameters", "Neighbour", "Rbf",
    "Schedule", "Trigger", "Window",
]  # fmt: skip

MAX_NEURONS = 64
MAX_WINDOWS = 8
"""Most windows of a schedule."""

T = TypeVar("T")


class Window(Model, Generic[T]):
    """A value and the last instant at which it is in force."""

    until_s: float | None = quantity(
        "s", gt=0.0, default=None, doc="Last instant, on the clock of the mission; none: for ever."
    )
    value: T


def _form(value: object) -> str:
    """Tell a list of windows from a plain value (which may itself be a list of numbers)."""
    windows = isinstance(value, list | tuple) and any(isinstance(v, dict | Window) for v in value)
    return "<windows>" if windows else "<value>"


class Schedule(
    RootModel[
        Annotated[
            Annotated[T, Tag("<value>")] | Annotated[tuple[Window[T], ...], Tag("<windows>")],
            Discriminator(_form),
        ]
    ],
    Generic[T],
):
    """A parameter that changes in time: a plain value, or a list of windows.

    In YAML ``[{until_s: 14, value: 0.5}, {value: 1}]`` is 0.5 for t <= 14 s, then 1.
    """

    model_config = ConfigDict(frozen=True)

    def windows(self) -> tuple[tuple[float, Any], ...]:
        """Last instant [s] and value of each window in order; the last one ends at infinity."""
        if not isinstance(self.root, tuple) or not isinstance(self.root[0], Window):
            return ((math.inf, self.root),)
        return tuple(
            (math.inf if window.until_s is None else window.until_s, window.value)
            for window in self.root
        )

    @model_validator(mode="after")
    def _times_increase(self) -> "Schedule[T]":
        times = [until for until, _ in self.windows()]
        last = len(times) - 1
        problems: list[tuple[Loc, str]] = []
        if len(times) > MAX_WINDOWS:
            problems.append(((), f"expected at most {MAX_WINDOWS} windows, got {len(times)}"))
        for i, until in enumerate(times):
            if i == last and until != math.inf:
                problems.append(
                    ((i, "until_s"), f"expected none in the last window, got {until!r}")
                )
            elif i < last and until == math.inf:
                problems.append(((i, "until_s"), "missing; only the last window has no end"))
            if i > 0 and until <= times[i - 1] < math.inf:
                text = f"expected > {times[i - 1]!r} s, the end of the window before, got {until!r}"
                problems.append(((i, "until_s"), text))
        Problems.check(problems)
        return self


def _schedule(default: object) -> Any:
    return Field(default=default, validate_default=True)


class Trigger(Model):
    """Event triggers (25) and (29)."""

    mode: Literal["per_channel", "joint"] = Field(
        default="per_channel",
        description="Each surface has its own events, or any one's event updates all three.",
    )
    a1: Schedule[
        Annotated[float, quantity("", ge=0.0, lt=1.0, doc="Relative threshold of the thrust.")]
    ] = _schedule(0.01)
    a2_n: Schedule[
        Annotated[float, quantity("N", ge=0.0, doc="Absolute threshold of the thrust.")]
    ] = _schedule([{"until_s": 14.0, "value": 0.5}, {"value": 1.0}])
    b1: Schedule[
        Annotated[float, quantity("", ge=0.0, lt=1.0, doc="Relative threshold of a surface.")]
    ] = _schedule(0.01)
    b2_deg: Schedule[
        Annotated[float, quantity("deg", ge=0.0, doc="Absolute threshold of a surface.")]
    ] = _schedule(1.0)


class Rbf(Model):
    """Radial basis functions (23), (24): centres on a diagonal, one width for all."""

    neurons: int = whole("", ge=1, le=MAX_NEURONS, default=15, doc="Number M of neurons.")
    span: float = quantity("", gt=0.0, default=1.5, doc="Centres span -span to span.")
    width: float = quantity("", gt=0.0, default=2.0, doc="Width kappa.")
    speed_scale: float = quantity(
        "s/m", gt=0.0, default=0.025, doc="Factor of the velocity in the network's input."
    )


_Gain = Annotated[float, quantity("1/s", gt=0.0, doc="Gain of one axis.")]
_Gains: TypeAlias = tuple[_Gain, _Gain, _Gain]


class ControllerParameters(Model):
    """Parameters of the proposed controller, eqs. (31) to (39) and (57)."""

    kind: Literal["proposed"] = "proposed"

    lambda1: float = quantity("", gt=0.0, default=0.46, doc="Weight of the own speed error (31).")
    lambda2: float = quantity("", ge=0.0, default=0.17, doc="Weight of speed differences (31).")
    lambda3: float = quantity("", gt=0.0, default=5.0, doc="Weight of the own attitude error (32).")
    lambda4: float = quantity("", ge=0.0, default=0.2, doc="Weight of attitude differences (32).")

    c_v: float = quantity("1/s", gt=0.0, default=10.0, doc="Gain of the speed law (33).")
    eps_v: float = quantity("", gt=0.0, default=0.1, doc="Smoothing of the speed law (33).")
    gamma_v1: float = quantity("", gt=0.0, default=0.0037, doc="Rate of Phi_v (34).")
    gamma_v2: float = quantity("", gt=0.0, default=0.0094, doc="Rate of g_v (35).")
    gamma_v3: float = quantity("", gt=0.0, default=0.052, doc="Rate of beta_v (36).")
    sigma_v1: float = quantity("1/s", ge=0.0, default=0.11, doc="Leakage of Phi_v (34).")
    sigma_v2: float = quantity("1/s", ge=0.0, default=0.06, doc="Leakage of g_v (35).")
    sigma_v3: float = quantity("1/s", ge=0.0, default=0.14, doc="Leakage of beta_v (36).")
    h_v1: float = quantity("", gt=0.0, default=0.93, doc="Weight of the network (33), (34).")
    h_v2: float = quantity("", gt=0.0, default=9.2, doc="Weight of the robust term (33).")

    K1: Schedule[_Gains] = _schedule(
        [
            {"until_s": 5.0, "value": [50.0, 50.0, 51.0]},
            {"until_s": 15.0, "value": [45.0, 45.0, 45.0]},
            {"value": [40.0, 40.0, 40.0]},
        ]
    )
    K2: Schedule[_Gains] = _schedule(
        [
            {"until_s": 5.0, "value": [50.0, 50.0, 51.0]},
            {"until_s": 15.0, "value": [45.0, 45.0, 46.0]},
            {"value": [40.0, 40.0, 40.0]},
        ]
    )
    eps_omega: float = quantity("", gt=0.0, default=1.0, doc="Smoothing of the attitude law (37).")
    gamma_omega1: float = quantity("", gt=0.0, default=0.01, doc="Rate of Phi_omega (38).")
    gamma_omega2: float = quantity("", gt=0.0, default=0.01, doc="Rate of beta_omega (39).")
    sigma_omega1: float = quantity("1/s", ge=0.0, default=25.0, doc="Leakage of Phi_omega (38).")
    sigma_omega2: float = quantity("1/s", ge=0.0, default=25.0, doc="Leakage of beta_omega (39).")
    h_omega1: float = quantity("", gt=0.0, default=0.28, doc="Weight of the network (37), (38).")
    h_omega2: float = quantity("", gt=0.0, default=3.4, doc="Weight of the robust term (37).")
    tau_omega_d_s: float = quantity("s", gt=0.0, default=0.015, doc="Filter of omega_d (57).")
    tau_delta_s: float = quantity("s", gt=0.0, default=0.01, doc="Filter of delta_0 (23).")

    phi_v0: float = quantity("", ge=0.0, default=0.0, doc="Phi_v at t = 0.")
    g_v0: float = quantity("", ge=0.0, default=0.0, doc="g_v at t = 0.")
    beta_v0: float = quantity("", ge=0.0, default=1.0, doc="beta_v at t = 0.")
    phi_omega0: float = quantity("", ge=0.0, default=0.0, doc="Phi_omega at t = 0.")
    beta_omega0: float = quantity("", ge=0.0, default=0.011, doc="beta_omega at t = 0.")

    rbf: Rbf = Rbf()
    reference_bandwidth_rad_s: float = quantity(
        "rad/s", gt=0.0, default=2.5, doc="Triple pole of the reference filter (Assumption 4)."
    )


class Neighbour(Model):
    """One edge of the graph, seen from one of its ends."""

    id: SystemId
    weight: float = quantity("", gt=0.0, doc="Weight a_ij.")
    address: HostPort = Field(description="Where its formation link is received.")


class AutopilotConfig(Model):
    """All that one autopilot process needs."""

    id: SystemId
    name: str = Field(min_length=1)
    step_us: int = whole("us", ge=1, le=100_000, default=1000, doc="Control period.")
    aircraft: Aircraft = Field(description="The nominal aircraft.")
    controller: ControllerParameters = ControllerParameters()
    trigger: Trigger = Trigger()
    neighbours: tuple[Neighbour, ...] = ()
    neighbour_timeout_s: float = quantity(
        "s", gt=0.0, default=0.25, doc="Silence after which a neighbour's edge is dropped."
    )
    formation_bind: HostPort = Field(description="Where the formation link is received.")
    plant: HostPort = Field(description="Where the plant receives the simulator link.")
    gcs: tuple[HostPort, ...] = Field(min_length=1, description="Ground stations to talk to.")
    silence_timeout_s: float = quantity(
        "s", gt=0.0, default=5.0, doc="Silence after which the plant counts as gone."
    )

    @model_validator(mode="after")
    def _neighbours_distinct(self) -> "AutopilotConfig":
        ids = [neighbour.id for neighbour in self.neighbours]
        problems = repeated(ids)
        problems += [(i, f"UAV {n} is this UAV itself") for i, n in enumerate(ids) if n == self.id]
        Problems.check((("neighbours", i, "id"), text) for i, text in problems)
        return self
