"""An actuator fault with the keys of a scenario's `faults`."""

import itertools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Self

from pydantic import Field, create_model, model_validator

from mavlink_defs.config.models import Model, Problem, Problems
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import ACTUATORS, Actuator
from mavlink_defs.fault_kinds import BIAS, FAULT_KINDS, MAX_FREQUENCY_HZ, STUCK, FaultKind
from mavlink_defs.fault_window import Window
from mavlink_defs.faults import Fault


class WindowSpec(Model):
    """The keys of a window, which may be left open."""

    start_s: float | None = quantity(
        "s", ge=0.0, default=None, doc="Start in simulated time, exclusive; none: now."
    )
    end_s: float | None = quantity(
        "s", gt=0.0, default=None, doc="End in simulated time, inclusive; none: never."
    )

    def window_problems(self) -> Iterator[Problem]:
        """Yield that it ends before it starts."""
        if self.end_s is not None and self.start_s is not None and self.end_s <= self.start_s:
            text = f"expected > {{0}} = {self.start_s!r} s, got {self.end_s!r}"
            yield Problem(("end_s",), text, keys=("start_s",))

    @property
    def window(self) -> Window:
        """The window as commands carry it."""
        return Window(
            start_s=math.nan if self.start_s is None else self.start_s,
            end_s=math.nan if self.end_s is None else self.end_s,
        )


class _WithoutValue(Model):
    actuator: Actuator = Field(description="The actuator that fails.")
    effectiveness: float | None = quantity(
        "",
        ge=0.0,
        le=1.0,
        default=None,
        doc="Share of the command that remains; none: 1, or 0 where a value replaces it.",
    )


if TYPE_CHECKING:
    _WithValue = _WithoutValue
else:
    _WithValue = create_model(
        "_WithValue",
        __base__=_WithoutValue,
        **{
            kind.key(actuator): (
                float | None,
                quantity(kind.unit(actuator), default=None, doc=doc),
            )
            for kind in FAULT_KINDS.values()
            for actuator, doc in (("rudder", kind.of_surface), ("throttle", kind.of_throttle))
        },
    )


class _WithFrequency(_WithValue):
    frequency_hz: float = quantity(
        "Hz",
        ge=0.0,
        le=MAX_FREQUENCY_HZ,
        default=0.0,
        doc="Frequency of the value, or of on and off; 0: constant.",
    )


class FaultSpec(WindowSpec, _WithFrequency):
    """An actuator fault (13), (19): applied = effectiveness * commanded + value.

    What the value is, its kind says: a bias on the remaining command, or the position of a stuck
    actuator. The UAV is not part of it, and its window may be left open.
    """

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        Problems.check(self._problems())
        return self

    def _problems(self) -> Iterator[Problem]:
        keys = {kind.name: kind.key(self.actuator) for kind in FAULT_KINDS.values()}
        unfit = dict(self._values(ACTUATORS[0] if self.actuator == "throttle" else "throttle"))
        for kind, key in unfit.items():
            text = f"does not fit the {self.actuator}; did you mean '{{0}}'?"
            yield Problem((key,), text, keys=(keys[kind.name],))
        kinds = list(dict(self._values(self.actuator)))
        for kind, other in itertools.pairwise(kinds):
            other_key = (keys[other.name],)
            yield Problem((keys[kind.name],), "cannot be combined with '{0}'", keys=other_key)
        stuck = (keys[STUCK.name],)
        if replacing := [(keys[kind.name],) for kind in kinds if kind.replaces]:
            if self.effectiveness:
                text = f"expected 0 or none with '{{0}}', got {self.effectiveness!r}"
                yield Problem(("effectiveness",), text, keys=replacing[0])
        elif BIAS in kinds and self.effectiveness == 0.0:
            text = "nothing is left to be biased; did you mean '{0}'?"
            yield Problem((keys[BIAS.name],), text, keys=stuck)
        elif not kinds and not unfit and self.effectiveness is None:
            *others, last = (f"'{{{i}}}'" for i in range(1 + len(keys)))
            text = f"expected {', '.join(others)} or {last}, got none of them"
            yield Problem((), text, keys=("effectiveness", *keys.values()))
        for kind in kinds:
            if kind.switches and self.frequency_hz == 0.0:
                text = "expected > 0 Hz with '{0}', got 0.0"
                yield Problem(("frequency_hz",), text, keys=(keys[kind.name],))
        yield from self.window_problems()

    def _values(self, actuator: Actuator) -> Iterator[tuple[FaultKind, str]]:
        """Yield the kinds whose value is given in the unit of an actuator, and their keys."""
        for kind in FAULT_KINDS.values():
            if getattr(self, key := kind.key(actuator)) is not None:
                yield kind, key

    @property
    def value(self) -> tuple[FaultKind, float] | None:
        """Its kind and its value; None of a loss of effectiveness alone."""
        found = next(self._values(self.actuator), None)
        return found and (found[0], getattr(self, found[1]))

    def command(self) -> Fault:
        """Return the fault as MAV_CMD_FTC_SET_FAULT carries it."""
        kind, value = self.value or (BIAS, 0.0)
        healthy = 0.0 if kind.replaces else 1.0
        return Fault(
            actuator=ACTUATORS.index(self.actuator),
            effectiveness=healthy if self.effectiveness is None else self.effectiveness,
            value=value,
            frequency_hz=self.frequency_hz,
            **self.window._asdict(),
            code=kind.code,
        )
