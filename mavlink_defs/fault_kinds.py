"""The kinds of actuator faults: one table for files, commands, forms, texts and campaigns.

The aircraft applies ``effectiveness * commanded`` plus what the fault's value adds. The kind says
what that is, and how people name the value. Another kind takes an entry of FTC_FAULT_KIND in
`ftc.xml`, one of `FAULT_KINDS` here, and a branch in `sitl_plant.actuators.faults`, mostly of
`offset`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from mavlink_defs.constants import ACTUATORS, Actuator
from mavlink_defs.dialect import (
    FTC_FAULT_KIND_DRIFT,
    FTC_FAULT_KIND_HARDOVER,
    FTC_FAULT_KIND_INTERMITTENT,
    FTC_FAULT_KIND_OFFSET,
)

MAX_FREQUENCY_HZ = 500.0


@dataclass(frozen=True)
class FaultLimits:
    """Ranges of the actuators of an aircraft.

    Attributes:
        surfaces_deg: Least and largest angle of aileron, elevator and rudder [deg]; both are 0 for
            a surface that the aircraft has not.
        thrust_n: Largest thrust [N].
    """

    surfaces_deg: tuple[tuple[float, float], ...]
    thrust_n: float

    def has(self, actuator: Actuator) -> bool:
        """Return whether the aircraft has an actuator."""
        return actuator == "throttle" or any(self.surfaces_deg[ACTUATORS.index(actuator)])


@dataclass(frozen=True)
class FaultKind:
    """One kind of fault.

    Attributes:
        name: Of the value in keys and options: ``NAME_deg`` of a surface, ``NAME_n`` of the
            throttle.
        code: FTC_FAULT_KIND.
        of_surface: What the value of a surface means.
        of_throttle: The same of the throttle.
        choice: The kind in a form.
        label: The value in a form.
        template: The value in a text, with ``{sign}`` (+ or -), ``{minus}`` (- or nothing),
            ``{size}`` with its unit, and ``{wave}``, its oscillation.
        replaces: Whether the value replaces the command, so that the effectiveness is 0.
        per: Denominator of the value's unit, such as "/s".
        wave: How a text has the frequency [Hz].
        switches: Whether it comes and goes with the frequency, which then is not 0.
    """

    name: str
    code: int
    of_surface: str
    of_throttle: str
    choice: str
    label: str
    template: str
    replaces: bool = False
    per: str = ""
    wave: str = " · cos 2π {:g} Hz"
    switches: bool = False

    def unit(self, actuator: Actuator) -> str:
        """Return the unit of the value."""
        return ("N" if actuator == "throttle" else "deg") + self.per

    def key(self, actuator: Actuator) -> str:
        """Return the key of the value in a scenario."""
        return f"{self.name}_{self.unit(actuator).lower().replace('/', '_')}"

    def bounds(self, actuator: Actuator, limits: FaultLimits) -> tuple[float, float]:
        """Return the smallest and the largest value, in its unit."""
        if actuator != "throttle":
            return limits.surfaces_deg[ACTUATORS.index(actuator)]
        return (0.0 if self.replaces else -limits.thrust_n), limits.thrust_n

    def describe(self, value: float, unit: str, wave: str, minus: str = "-") -> str:
        """Return the value in a text: "+ 1 deg", "stuck at -3 deg".

        Args:
            value: The value.
            unit: Its unit as the text has it, with a space before it if there is to be one.
            wave: How it oscillates; empty if it does not.
            minus: The minus sign.
        """
        sign = minus if value < 0.0 else ""
        size = f"{abs(value):g}{unit}"
        return self.template.format(sign=sign or "+", minus=sign, size=size, wave=wave)


BIAS = FaultKind(
    "bias",
    FTC_FAULT_KIND_OFFSET,
    "Bias of a surface.",
    "Bias of the throttle.",
    choice="loss and bias",
    label="bias",
    template="{sign} {size}{wave}",
)
STUCK = FaultKind(
    "stuck",
    FTC_FAULT_KIND_OFFSET,
    "Angle of a stuck surface.",
    "Thrust of a stuck throttle.",
    choice="stuck at value",
    label="stuck at",
    template="stuck at {minus}{size}{wave}",
    replaces=True,
)

DRIFT = FaultKind(
    "drift",
    FTC_FAULT_KIND_DRIFT,
    "Rate at which a surface drifts.",
    "Rate at which the throttle drifts.",
    choice="loss and drift",
    label="drift",
    template="{sign} drift of {size}{wave}",
    per="/s",
)
HARDOVER = FaultKind(
    "hardover",
    FTC_FAULT_KIND_HARDOVER,
    "Angle to which a surface runs at the rate of its servo.",
    "Thrust to which the engine runs at its rate.",
    choice="hard-over",
    label="runs to",
    template="runs to {minus}{size}{wave}",
    replaces=True,
)
INTERMITTENT = FaultKind(
    "intermittent",
    FTC_FAULT_KIND_INTERMITTENT,
    "Bias of a surface in every first half of a period.",
    "Bias of the throttle in every first half of a period.",
    choice="intermittent",
    label="bias",
    template="{sign} {size} on and off{wave}",
    wave=" at {:g} Hz",
    switches=True,
)

FAULT_KINDS: Mapping[str, FaultKind] = {
    kind.name: kind for kind in (BIAS, STUCK, DRIFT, HARDOVER, INTERMITTENT)
}
"""All kinds by name. A loss of effectiveness alone is a bias of 0."""

CODES = frozenset(kind.code for kind in FAULT_KINDS.values())
"""FTC_FAULT_KIND of all kinds."""


def kind_of(code: int, effectiveness: float) -> FaultKind:
    """Return the kind of a fault on the wire.

    Args:
        code: FTC_FAULT_KIND, one of `CODES`.
        effectiveness: Remaining effectiveness; at 0, what shares its code with a kind that
            `replaces` the command is that one.
    """
    kinds = [kind for kind in FAULT_KINDS.values() if kind.code == code]
    fitting = (kind for kind in kinds if kind.replaces == (effectiveness == 0.0))
    return next(fitting, kinds[0])
