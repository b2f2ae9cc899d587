"""A package with a simulator, as others write one: an aircraft that glides straight on."""

import os
from pathlib import Path

_MODULE = """
import math

from sitl_plant.airframe.config import Inertia
from sitl_plant.simulators.base import Body, Motion, SimulatorError


class Glider:
    stops = ((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0))

    def __init__(self, options, altitude_m):
        self._fails_s = options.pop("fails_s", math.inf)
        self._breaks_s = options.pop("breaks_s", math.inf)
        self._nan_s = options.pop("nan_s", math.inf)
        if options:
            raise SimulatorError(f"plant.options: got {sorted(options)}")
        self._t = 0.0
        inertia = Inertia(Jxx=1.0, Jyy=1.0, Jzz=1.0, Jxz=0.0)
        self.body = Body(1.0, inertia, 1.0, 1.0, 1.0, 1.2)

    def reset(self, motion):
        self._motion = motion._replace(specific_force=(0.0, 0.0, -9.81))

    def control(self, delta, thrust):
        pass

    def set_wind(self, wind):
        pass

    def advance(self, dt):
        self._t += dt
        if self._t > self._fails_s:
            raise SimulatorError("its simulator has had enough")
        if self._t > self._breaks_s:
            self._t / 0.0
        north, east, down = self._motion.position
        if self._t > self._nan_s:
            north = math.nan
        V = self._motion.velocity[0]
        self._motion = self._motion._replace(position=(north + V * dt, east, down))

    def read(self):
        return self._motion
"""


def write_plugin(folder: Path) -> str:
    """Write a package that registers the simulator `glider`; return what PYTHONPATH is to be."""
    facts = folder / "gliders-1.0.dist-info"
    facts.mkdir(parents=True)
    (folder / "gliders.py").write_text(_MODULE)
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: gliders\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text("[ftc_sitl.simulators]\nglider = gliders:Glider\n")
    before = os.environ.get("PYTHONPATH")
    return f"{folder}{os.pathsep}{before}" if before else str(folder)
