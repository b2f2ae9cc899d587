"""Input and parameters of every trigger: the thresholds of (25) and (29)."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from ftc_autopilot.common.schedule import Schedule, schedule
from ftc_autopilot.common.tuples import Four
from mavlink_defs.config.models import Loc, Model
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled


class TriggerParameters(Model):
    """Parameters of any trigger; a trigger adds its own, and its `mode`.

    Attributes:
        STATE: The trigger's memory between steps, all zero before the first step.
        BY_THRESHOLD: Whether an event means that (25), or (29), held.
        BY_CLOCK: Whether it sends by the clock, whatever the commands are.
        LAW_SELECTS: Whether the law selects which channels are sent, and when.
        LIBRARY: Of a plug-in: file of the shared library with its function, beside the class.
        PAGE: Page of the documentation, or address, that has more. The text of the class says what
            it is, and in its second paragraph when to choose it.
        mode: Name of the trigger.
        a1: Relative threshold of the thrust, a1 of (25).
        a2_n: Absolute threshold of the thrust, a2 of (25) [N].
        b1: Relative threshold of the surfaces, b1 of (29).
        b2_deg: Absolute threshold of the surfaces, b2 of (29) [deg].
    """

    STATE: ClassVar[np.dtype] = np.dtype([])
    BY_THRESHOLD: ClassVar[bool] = True
    BY_CLOCK: ClassVar[bool] = False
    LAW_SELECTS: ClassVar[bool] = False
    LIBRARY: ClassVar[str | None] = None
    PAGE: ClassVar[str] = ""

    mode: str

    a1: Schedule[
        Annotated[float, quantity("", "Relative threshold of the thrust.", ge=0.0, lt=1.0)]
    ] = schedule(0.01)
    a2_n: Schedule[Annotated[float, quantity("N", "Absolute threshold of the thrust.", ge=0.0)]] = (
        schedule([{"until_s": 14.0, "value": 0.5}, {"value": 1.0}])
    )
    b1: Schedule[
        Annotated[float, quantity("", "Relative threshold of a surface.", ge=0.0, lt=1.0)]
    ] = schedule(0.01)
    b2_deg: Schedule[
        Annotated[float, quantity("deg", "Absolute threshold of a surface.", ge=0.0)]
    ] = schedule(1.0)

    def misfits(self, step_us: int) -> Iterator[tuple[Loc, str]]:
        """Yield place and text of what does not fit a control period [µs]: nothing."""
        yield from ()


class Candidates(NamedTuple):
    """Commands of one control step beside those sent last; channels as in FTC_ACTUATOR.

    In memory it is struct ftc_trigger_input, which ends before `examined`.
    """

    dt: float  # control period [s]
    first: int  # 1: everything is sent, whatever the trigger says
    selected: int  # mask of the channels that the law has selected
    commanded: Four  # saturated commands [rad, rad, rad, N]
    held: Four  # commands in force [rad, rad, rad, N]
    relative: Four  # thresholds b1, b1, b1, a1 [-]
    absolute: Four  # thresholds b2, b2, b2 [rad], a2 [N]
    examined: int  # mask of the channels whose actuator the law's diagnosis suspects, or has lost


@compiled
def threshold(now: Candidates, i: int, held: float) -> float:
    """Return the difference to a held command at which channel i transmits, (25) or (29)."""
    least: float = now.relative[i] * abs(held) + now.absolute[i]
    return least


@compiled
def fires(now: Candidates, i: int) -> bool:
    """Return whether (25), or (29) for one surface, asks channel i to transmit."""
    moved: float = abs(now.commanded[i] - now.held[i])
    return moved >= threshold(now, i, now.held[i])


@compiled
def in_steps(time_s: float, dt: float) -> int:
    """Return a time in control periods, at least one."""
    return max(round(time_s / dt), 1)
