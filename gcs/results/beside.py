"""A trigger of ours beside a foreign autopilot: what it would have sent of the same commands.

It is asked afterwards, about the commands that were flown; what it holds back, the aircraft got all
the same. So it is known how far what would have been held is from what was commanded, which the
trigger bounds, and not how a flight with it would have been tracked.
"""

import math

import numpy as np

from ftc_autopilot.common.schedule import scheduled
from ftc_autopilot.common.tuples import four
from ftc_autopilot.control.controller import new_controller, parameter_record
from ftc_autopilot.control.triggers import MODES, decide
from ftc_autopilot.control.triggers.base import Candidates
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACTUATORS, N_CHANNELS
from mavlink_defs.runtime.jit import compiled

BESIDE = np.dtype(
    [
        ("held", "f8", (N_CHANNELS,)),  # what would be held: surfaces [rad], thrust [N]
        ("messages", "i8"),  # steps with at least one event
        ("events", "i8", (N_CHANNELS,)),
        ("apart", "f8", (N_CHANNELS,)),  # largest difference of a command to what would be held
    ]
)
"""What is counted of a trigger."""


class Beside:
    """The scenario's trigger beside the foreign autopilot of one UAV.

    Attributes:
        counts: Of dtype `BESIDE`.
    """

    def __init__(self, scenario: Scenario, system: int) -> None:
        """Begin before the first command of a UAV."""
        record = parameter_record(scenario.controller, scenario.trigger)
        self._mode, self._parameters = int(record["mode"]), record["trigger"]
        self._state = new_controller()["trigger"]
        has = scenario.aircraft_of(system).fault_limits.has
        self._channels = sum(has(name) << c for c, name in enumerate(ACTUATORS))
        self._step_us = scenario.step_us
        self.counts = np.zeros(1, BESIDE)[0]

    def add(self, steps: Steps, column: int) -> None:
        """Ask it about the commands of the next steps, which are a column of the arrays."""
        commands = np.ascontiguousarray(steps.signals["held"][:, column])
        count_beside(
            (steps.first, self._step_us),
            commands,
            self._channels,
            self._mode,
            self._parameters,
            self._state,
            self.counts,
        )


def beside_of(scenario: Scenario, system: int) -> Beside | None:
    """Return the trigger beside a UAV's autopilot; None beside one of ours, which has its own.

    None also if it is of another package, or leaves the choice to its law, which is not flown.
    """
    asks = scenario.trigger.mode in MODES and not scenario.trigger.LAW_SELECTS
    return Beside(scenario, system) if asks and system in scenario.foreign else None


@compiled
def count_beside(
    clock: tuple[int, int],
    commands: np.ndarray,
    channels: int,
    mode: int,
    parameters: np.void,
    state: np.void,
    counts: np.void,
) -> None:
    """Ask a trigger about consecutive commands, and count.

    Args:
        clock: Number of the first step, and the control period [µs].
        commands: Shape (steps, 4): surfaces [rad], thrust [N]; NaN where there was none.
        channels: Mask of those that the aircraft has.
        mode: Index of the trigger in `MODES`.
        parameters: Record `trigger` of `ftc_autopilot.control.controller.PARAMETERS`.
        state: Record `trigger` of `ftc_autopilot.control.controller.CONTROLLER`, updated in place.
        counts: Of dtype `BESIDE`, updated in place.
    """
    first, step_us = clock
    for k in range(len(commands)):
        if math.isnan(commands[k, 0]):
            continue
        t = (first + k) * step_us / 1e6
        a = scheduled(parameters["a1"], t)[0], scheduled(parameters["a2_n"], t)[0]
        b = scheduled(parameters["b1"], t)[0], scheduled(parameters["b2_rad"], t)[0]
        now = Candidates(
            dt=step_us / 1e6,
            first=int(counts["messages"] == 0),
            selected=0,
            commanded=four(commands[k]),
            held=four(counts["held"]),
            relative=(b[0], b[0], b[0], a[0]),
            absolute=(b[1], b[1], b[1], a[1]),
            examined=0,
        )
        mask = decide(now, mode, parameters, state) & channels
        counts["messages"] += mask != 0
        for c in range(N_CHANNELS):
            if mask & (1 << c):
                counts["events"][c] += 1
                counts["held"][c] = commands[k, c]
            apart = abs(commands[k, c] - counts["held"][c])
            counts["apart"][c] = max(counts["apart"][c], apart)
