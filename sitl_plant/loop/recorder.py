"""What a plant records: the true state of each step and what acted on the aircraft."""

from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from mavlink_defs.runtime.spool import Spool
from sitl_plant.loop.link import PlantLink

Contacts: TypeAlias = list[dict[str, Any] | None]
"""Of each aircraft, see `sitl_plant.airframe.standing.contact_facts`."""

RECORD_ROWS = 1000
"""Steps written at a time."""


class Recorder:
    """Empties the record of a link into a folder."""

    def __init__(self, link: PlantLink, folder: Path) -> None:
        """Make the folder; OSError if it cannot be made, which it names."""
        self._link = link
        self._spool = Spool(folder)
        self._rows = 0
        self._given_up = False
        self._dtype = np.dtype(
            [(name, "f8", array.shape[1:]) for name, array in link.record._asdict().items()]
        )

    def give_up(self) -> None:
        """Write nothing any more, as what follows a gap would not be what it seems."""
        self._given_up = True

    def keep(self, at_least: int = RECORD_ROWS) -> None:
        """Write the record if it has so many rows; OSError with a file's name if it cannot."""
        if self._given_up:
            self._link.state["recorded"] = 0
        count = int(self._link.state[0]["recorded"])
        if count >= at_least:
            rows = np.empty(count, self._dtype)
            for name, array in self._link.record._asdict().items():
                rows[name] = array[:count]
            self._spool.write(self._rows, rows)
            self._link.state["recorded"] = 0  # not if it failed: nothing may be left out
            self._rows += count

    def finish(self, loss: str | None, steps: int, wall_s: float, contacts: Contacts) -> None:
        """Write the rest and how the flight ended; OSError with a file's name if it cannot."""
        self.keep(at_least=1)
        if not self._given_up:
            self._spool.finish(loss=loss, steps=steps, wall_s=wall_s, contacts=contacts)
