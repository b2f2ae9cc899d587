"""What the processes of a standing fleet write, without the fleet."""

from pathlib import Path

import numpy as np

from ftc_autopilot.hot.link import RECORD
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.runtime.spool import Spool

ROWS = 1000
PLANT = np.dtype([("states", "f8", (3, 12)), ("wind", "f8", (3, 3)), ("applied", "f8", (3, 4))])
FRAME = FramePacker(1, 1).pack(dialect.MAVLink_system_time_message(1, 2))


class Writers:
    """What plant and autopilots write, a second at a time."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        names = ("plant", *(f"uav{uav.id}" for uav in scenario.uavs))
        self.spools = {name: Spool(folder / "processes" / name) for name in names}
        self.second = 0

    def write(self, *silent: str) -> None:
        first = self.second * ROWS
        for name, spool in self.spools.items():
            rows = np.zeros(ROWS, PLANT if name == "plant" else RECORD)
            if name != "plant":
                rows["step"] = np.arange(first, first + ROWS)
                rows["signals"]["events"][::10] = 1
            if name not in silent:
                spool.write(first, rows)
        self.second += 1
