"""An actuator fault with the keys of a scenario's `faults`."""

import math
from collections.abc import Iterator
from typing import Self

from pydantic import Field, model_validator

from mavlink_defs.config.models import Model, Problem, Problems
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import ACTUATORS, Actuator
from mavlink_defs.faults import MAX_FREQUENCY_HZ, Fault


class FaultSpec(Model):
    """An actuator fault (13), (19): applied = effectiveness * commanded + value.

    The value is a bias on the remaining command, or the position of a stuck actuator. The UAV is
    not part of it, and its window may be left open.
    """

    actuator: Actuator = Field(description="The actuator that fails.")
    effectiveness: float | None = quantity(
        "", ge=0.0, le=1.0, default=None, doc="Share of the command that remains; 1 unless stuck."
    )
    bias_deg: float | None = quantity("deg", default=None, doc="Bias of a surface.")
    bias_n: float | None = quantity("N", default=None, doc="Bias of the throttle.")
    stuck_deg: float | None = quantity("deg", default=None, doc="Angle of a stuck surface.")
    stuck_n: float | None = quantity("N", default=None, doc="Thrust of a stuck throttle.")
    frequency_hz: float = quantity(
        "Hz",
        ge=0.0,
        le=MAX_FREQUENCY_HZ,
        default=0.0,
        doc="Frequency of the bias or stuck value; 0: constant.",
    )
    start_s: float | None = quantity("s", ge=0.0, default=None, doc="Start, exclusive; none: now.")
    end_s: float | None = quantity("s", gt=0.0, default=None, doc="End, inclusive; none: never.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        Problems.check(self._problems())
        return self

    def _problems(self) -> Iterator[Problem]:
        fits, other = ("n", "deg") if self.actuator == "throttle" else ("deg", "n")
        for kind in ("bias", "stuck"):
            if getattr(self, f"{kind}_{other}") is not None:
                text = f"does not fit the {self.actuator}; did you mean '{{0}}'?"
                yield Problem((f"{kind}_{other}",), text, keys=(f"{kind}_{fits}",))
        bias_key, stuck_key = f"bias_{fits}", f"stuck_{fits}"
        bias, stuck = self._values(fits)
        if stuck is not None:
            if bias is not None:
                yield Problem((bias_key,), "cannot stand together with '{0}'", keys=(stuck_key,))
            if self.effectiveness:
                text = f"expected 0 or none with '{{0}}', got {self.effectiveness!r}"
                yield Problem(("effectiveness",), text, keys=(stuck_key,))
        elif bias is not None and self.effectiveness == 0.0:
            text = "nothing is left to be biased; did you mean '{0}'?"
            yield Problem((bias_key,), text, keys=(stuck_key,))
        elif bias is None and self.effectiveness is None and not any(self._values(other)):
            text = "expected '{0}', '{1}' or '{2}', got none of them"
            yield Problem((), text, keys=("effectiveness", bias_key, stuck_key))
        if self.end_s is not None and self.start_s is not None and self.end_s <= self.start_s:
            text = f"expected > {{0}} = {self.start_s!r} s, got {self.end_s!r}"
            yield Problem(("end_s",), text, keys=("start_s",))

    def _values(self, unit: str) -> tuple[float | None, float | None]:
        return getattr(self, f"bias_{unit}"), getattr(self, f"stuck_{unit}")

    @property
    def value_key(self) -> str | None:
        """Key that holds the fault's value; None if it has none."""
        keys = ("bias_deg", "bias_n", "stuck_deg", "stuck_n")
        return next((key for key in keys if getattr(self, key) is not None), None)

    def command(self) -> Fault:
        """Return the fault as MAV_CMD_FTC_SET_FAULT carries it."""
        key = self.value_key
        healthy = 0.0 if key is not None and key.startswith("stuck") else 1.0
        return Fault(
            actuator=ACTUATORS.index(self.actuator),
            effectiveness=healthy if self.effectiveness is None else self.effectiveness,
            value=0.0 if key is None else getattr(self, key),
            frequency_hz=self.frequency_hz,
            start_s=math.nan if self.start_s is None else self.start_s,
            end_s=math.nan if self.end_s is None else self.end_s,
        )
