"""Carrying out what the operator requests, with a report of every outcome."""

import asyncio
from collections.abc import Callable

from gcs.console.errors import CommandRefused, GcsError
from gcs.station.notifications import ERROR, NOTICE, WARNING
from gcs.tui.formatting import ids
from gcs.tui.guard import one_line
from gcs.tui.requests import ActionOutcome, VehicleAction
from gcs.tui.view import FleetView

_NOTICE_LINES = 5

Notify = Callable[[str, str], None]
"""Called with a text and "information", "warning" or "error"."""


class Operations:
    """Carries out the operator's actions on vehicles.

    Attributes:
        going_on: What is being done now, as texts for people.
    """

    def __init__(self, view: FleetView, notify: Notify) -> None:
        """Prepare.

        Args:
            view: The vehicles.
            notify: How the operator is notified at once; everything is logged as an event as well.
        """
        self.going_on: list[str] = []
        self._view, self._notify = view, notify

    async def carry_out(self, action: VehicleAction, choice: str) -> None:
        """Act on all vehicles at the same time; refusals and silence are reported, not raised."""
        title = f"{action.what}: {ids(action.systems)}"
        self.going_on.append(title)
        try:
            outcomes = await asyncio.gather(
                *(self._one(action, system, choice) for system in action.systems)
            )
        finally:
            self.going_on.remove(title)
        done = [outcome.system for outcome in outcomes if outcome.accepted]
        if done:
            self._notify(f"{action.what}: accepted by {ids(done)}", "information")
        for outcome in outcomes:
            if not outcome.accepted:
                self._notify(_beginning(outcome.text), "error")

    async def _one(self, action: VehicleAction, system: int, choice: str) -> ActionOutcome:
        severity = NOTICE
        try:
            text = await action.act(self._view.source.vehicle(system), choice)
            outcome = ActionOutcome(system, True, text or f"{action.what}: accepted")
        except GcsError as problem:
            severity = WARNING if isinstance(problem, CommandRefused) else ERROR
            outcome = ActionOutcome(system, False, str(problem))
        except KeyError:
            severity = ERROR
            outcome = ActionOutcome(system, False, f"UAV {system} has not been heard of")
        except Exception as problem:
            severity = ERROR
            text = f"{action.what}, UAV {system}: {one_line(problem)}"
            outcome = ActionOutcome(system, False, text)
        for line in outcome.text.split("\n"):
            self._note(system, severity, line)
        if action.on_done is not None:
            action.on_done(outcome)
        return outcome

    def _note(self, system: int, severity: int, text: str) -> None:
        source = self._view.source
        state = source.fleet.vehicles.get(system)
        at = source.since_1970(source.now())
        source.event_log.note(at, state.time_s if state else None, system, "action", severity, text)


def _beginning(text: str) -> str:
    """Return as many lines as a notice has room for; the event log has all."""
    lines = text.split("\n")
    more = len(lines) - _NOTICE_LINES
    if more <= 1:  # as long as the line that says so
        return text
    return "\n".join([*lines[:_NOTICE_LINES], f"… and {more} more in 6 Events"])
