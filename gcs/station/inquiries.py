"""What a ground station requests of vehicles by itself, as soon as it is due."""

import asyncio
from collections.abc import Callable, Coroutine, Iterable
from typing import Any

from gcs.station.patience import HASTY, Patience
from gcs.station.vehicle import Vehicle


class Inquiries:
    """Requests that run beside everything else, one of a kind at a time for each vehicle."""

    def __init__(self, *, private: bool, rest: bool, patience: Patience = HASTY) -> None:
        """Start without any.

        Args:
            private: Whether to request the private messages.
            rest: Whether to request faults and profile, whenever they may have changed.
            patience: How long to wait for answers; other operations on the vehicle wait, too.
        """
        self._patience = patience
        self._private, self._rest = private, rest
        self._tasks: dict[tuple[int, str], asyncio.Task[None]] = {}

    def start(self, vehicles: Iterable[Vehicle], now: float) -> None:
        """Start what is due and does not run yet; call it often, inside the event loop.

        Args:
            vehicles: All that have been heard.
            now: Time on the client's clock [s].
        """
        for vehicle in vehicles:
            if self._private and vehicle.state.is_private_due(now):
                self._ask(vehicle, "private", Vehicle.ask_for_private)
            if self._rest and vehicle.state.is_asking_due(now):
                self._ask(vehicle, "rest", Vehicle.ask_what_is_due)

    def _ask(
        self, vehicle: Vehicle, what: str, ask: Callable[[Vehicle], Coroutine[Any, Any, None]]
    ) -> None:
        before = self._tasks.get((vehicle.system, what))
        if before is None or before.done():
            asked = ask(vehicle.with_patience(self._patience))
            task = asyncio.get_running_loop().create_task(asked)
            self._tasks[vehicle.system, what] = task

    async def close(self) -> None:
        """Cancel what runs, and wait until it has ended."""
        for task in self._tasks.values():
            task.cancel()
        await asyncio.gather(*self._tasks.values(), return_exceptions=True)
