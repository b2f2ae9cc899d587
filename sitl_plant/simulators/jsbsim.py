"""JSBSim (https://github.com/JSBSim-Team/jsbsim) as the simulator of one aircraft.

What JSBSim is given before a step acts on the forces at the end of this step, and so on the
motion of the next: a command comes to act one step of JSBSim late. The Earth is JSBSim's, WGS84 and
turning; positions are velocities over the ground, integrated by the trapezoidal rule. The wheels
are up if they can be, and the ground is out of their reach: an aircraft that comes to altitude 0
has hit it. One whose file has `gear` has its wheels down and JSBSim's ground at altitude 0; its
nose wheel follows the rudder. Fuel is not burnt.
"""

import ctypes
import math
import re
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mavlink_defs.constants import RUDDER
from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import stops
from sitl_plant.airframe.config import Inertia
from sitl_plant.simulators import jsbsim_aircraft
from sitl_plant.simulators.base import Body, Motion, SimulatorError
from sitl_plant.simulators.config import JsbSimPlant
from sitl_plant.simulators.jsbsim_engine import Engine
from sitl_plant.simulators.jsbsim_surfaces import Surface, surfaces_of
from sitl_plant.simulators.jsbsim_units import FT, LBF, SLUG
from sitl_plant.vec3 import Vec3

try:
    import jsbsim
except ImportError as missing:
    raise SimulatorError(
        "plant.kind is 'jsbsim': the package jsbsim is not installed here",
        "pip install 'jsbsim>=1.3.3'",
    ) from missing

_share_of = in_python(stops.share_of)

_LATITUDE_DEG = 45.0  # where gravity is standard gravity, 9.80665 m/s², to 0.005 %
_GRAVITY = 9.80665  # m/s²
_NO_GROUND_FT = -1e4
_ABOVE_M = 100.0  # where heights of wheels are looked up
_SETTLING_S = 30  # at most, until an aircraft stands
_AT_REST = 1e-5  # m/s and rad/s
_ON_WHEELS = ("steer", "left-brake", "right-brake", "center-brake")
_EVALUATIONS = 4  # of forces that depend on what accelerations they make
_TEST_AIRSPEED_M_S = 30.0  # of signs and maps, which do not depend on it

_MOMENTS = ("xx", "yy", "zz", "xz")  # the last is the element of the matrix, -Jxz
_OF_ENGINES = re.compile(r"propulsion|fcs/(throttle|mixture|advance)|-prop-lbs")

_READ = (
    *("velocities/v-north-fps", "velocities/v-east-fps", "position/h-sl-ft"),
    *("velocities/u-fps", "velocities/v-fps", "velocities/w-fps"),
    *("attitude/phi-rad", "attitude/theta-rad", "attitude/psi-rad"),
    *("velocities/p-rad_sec", "velocities/q-rad_sec", "velocities/r-rad_sec"),
    *("forces/fbx-total-lbs", "forces/fby-total-lbs", "forces/fbz-total-lbs"),
    "inertia/mass-slugs",
    "forces/fbz-gear-lbs",
)


class JsbSim:
    """One aircraft of JSBSim; a `Simulator`.

    Flights repeat bit for bit if each has an object of its own.

    Attributes:
        version: Of JSBSim.
        body: Mass, inertia, reference lengths, as JSBSim has them when it is loaded.
        stops: Range of each surface [rad], (0, 0) of one that the aircraft has not.
    """

    def __init__(
        self,
        section: JsbSimPlant,
        altitude_m: float,
        step_us: int,
        fastest_m_s: float | None = None,
    ) -> None:
        """Load the aircraft, and measure what its surfaces do.

        Args:
            section: Which aircraft, and how it is flown.
            altitude_m: Above sea level [m].
            step_us: Step of JSBSim [µs].
            fastest_m_s: Its highest airspeed, if it is to touch the ground.

        Raises:
            SimulatorError: It cannot be flown.
        """
        self.version = str(jsbsim.__version__)
        self._name = section.aircraft
        self._step_s = step_us / 1e6
        self._log = _Log()
        self._engine: Engine | None = None
        self._fdm = self._load(section)
        self._node = self._fdm.get_property_manager().get_node
        self._read = [self._node(key).get_double_value for key in _READ]
        self._wind = [
            self._node(f"atmosphere/wind-{axis}-fps") for axis in ("north", "east", "down")
        ]
        self._ground_ft = _NO_GROUND_FT
        self._wheels = [self._node(f"fcs/{name}-cmd-norm", True) for name in _ON_WHEELS]
        self._thrust = self._node(f"{jsbsim_aircraft.THRUST}/magnitude")
        self._position, self._yaw = (0.0, 0.0), 0.0
        self._surfaces: Sequence[Surface] = ()
        at_rest: Vec3 = (0.0, 0.0, 0.0)
        place, ahead = (0.0, 0.0, -altitude_m), (_TEST_AIRSPEED_M_S, 0.0, 0.0)
        start = Motion(place, ahead, at_rest, at_rest, at_rest)
        self.reset(start)
        if section.thrust == "force":
            self._push_at_the_centre_of_gravity()
        else:
            self._engine = Engine(self._name, self._fdm, fastest_m_s)
        self._surfaces = surfaces_of(self._name, self._fdm, self._checked)
        self.stops = tuple(surface.stops for surface in self._surfaces)
        self.reset(start)
        self.body = self._body()
        if fastest_m_s is not None:
            self._ground_ft = 0.0
            self._fdm["gear/gear-cmd-norm"] = self._fdm["gear/gear-pos-norm"] = 1.0

    def reset(self, motion: Motion) -> None:
        """Put the aircraft somewhere, its surfaces where `control` last put them."""
        fdm = self._fdm
        north, east, down = motion.position
        fdm["ic/terrain-elevation-ft"] = self._ground_ft
        fdm["ic/lat-geod-deg"], fdm["ic/long-gc-deg"] = _LATITUDE_DEG, 0.0
        fdm["ic/h-sl-ft"] = -down / FT
        for axis, angle in zip(("phi", "theta", "psi-true"), motion.attitude, strict=True):
            fdm[f"ic/{axis}-rad"] = angle
        for axis, speed in zip("uvw", motion.velocity, strict=True):
            fdm[f"ic/{axis}-fps"] = speed / FT
        for axis, rate in zip("pqr", motion.rates, strict=True):
            fdm[f"ic/{axis}-rad_sec"] = rate
        wind = [node.get_double_value() for node in self._wind]
        self._checked(fdm.run_ic)
        for node, speed in zip(self._wind, wind, strict=True):  # which that has set to 0
            node.set_double_value(speed)
        for _ in range(_EVALUATIONS):
            self._evaluate()
        if self._engine is not None:
            self._engine.start(self._evaluate)
        self._position = north, east
        self._yaw = motion.attitude[2]

    def stand(self, north_m: float, east_m: float, yaw: float) -> Motion:
        """Put the aircraft at rest on its wheels, with a heading [rad]; return its motion.

        It is let down with its brakes on until it has come to rest.

        Raises:
            SimulatorError: It does not come to rest, or JSBSim reports an error.
        """
        at_rest = (0.0, 0.0, 0.0)

        def at(height: float) -> Motion:
            return Motion((north_m, east_m, -height), at_rest, (0.0, 0.0, yaw), at_rest, at_rest)

        self.reset(at(_ABOVE_M))
        units = range(self._fdm.get_ground_reactions().get_num_gear_units())
        nodes = [self._node(f"gear/unit[{i}]/AGL-ft") for i in units]
        heights = [FT * node.get_double_value() for node in nodes if node is not None]
        self.reset(at(_ABOVE_M - min(heights, default=_ABOVE_M)))
        self.brake(1.0)
        for _ in range(_SETTLING_S):
            self.advance(1.0)
            motion = self.read()
            if max(map(abs, (*motion.velocity, *motion.rates))) < _AT_REST:
                self.brake(0.0)
                position = (north_m, east_m, motion.position[2])
                return motion._replace(position=position, velocity=at_rest, rates=at_rest)
        raise SimulatorError(f"JSBSim's {self._name} does not come to rest on its wheels")

    def brake(self, share: float) -> None:
        """Put the wheels' brakes at a share, 0 to 1, of what they can."""
        for node in self._wheels[1:]:
            node.set_double_value(share)

    def control(self, delta: Vec3, thrust: float) -> None:
        """Put aileron, elevator and rudder [rad] and the thrust along x [N] where they are to be.

        Raises:
            SimulatorError: JSBSim reports an error.
        """
        for surface, angle in zip(self._surfaces, delta, strict=True):
            surface.put(angle)
        low, high = self.stops[RUDDER] if self.stops else (0.0, 0.0)
        self._wheels[0].set_double_value(-float(_share_of(delta[RUDDER], low, high)))
        if self._engine is None:
            self._thrust.set_double_value(thrust / LBF)
        else:
            self._engine.put(thrust)

    def set_wind(self, wind: Vec3) -> None:
        """Set the velocity of the air, north, east, down [m/s]."""
        for node, speed in zip(self._wind, wind, strict=True):
            node.set_double_value(speed / FT)

    def advance(self, dt: float) -> None:
        """Advance by a time [s], a multiple of its own step.

        Raises:
            SimulatorError: JSBSim reports an error.
        """
        north_fps, east_fps = self._read[:2]
        north, east = self._position
        half = 0.5 * FT * self._step_s
        for _ in range(round(dt / self._step_s)):
            before = north_fps(), east_fps()
            self._checked(self._fdm.run)
            north += half * (before[0] + north_fps())
            east += half * (before[1] + east_fps())
        self._position = north, east

    def read(self) -> Motion:
        """Return the present motion."""
        values = [get() for get in self._read]
        _, _, h, u, v, w, phi, theta, psi, p, q, r, x, y, z, m, *pressed = values
        self._yaw = psi + math.tau * round((self._yaw - psi) / math.tau)
        k = FT / m
        return Motion(
            (*self._position, -FT * h),
            (FT * u, FT * v, FT * w),
            (phi, theta, self._yaw),
            (p, q, r),
            (k * x, k * y, k * z),
            -pressed[0] * k / _GRAVITY,
        )

    def _load(self, section: JsbSimPlant) -> Any:
        """Return JSBSim with the aircraft, from a copy of its files that is gone afterwards."""
        bundled = Path(jsbsim.__file__).parent
        source = jsbsim_aircraft.find(section.aircraft, bundled)
        jsbsim.set_logger(self._log)
        with TemporaryDirectory(prefix="ftc-sitl-") as folder:
            root = Path(folder)
            jsbsim_aircraft.write_copy(source, section, root)
            fdm = jsbsim.FGFDMExec(str(root))
            self._fdm = fdm
            fdm.set_debug_level(0)
            fdm[jsbsim_aircraft.ZERO] = 0.0
            paths = (str(root), str(source.engines), str(source.systems))
            if not self._checked(lambda: fdm.load_model_with_paths(source.name, *paths)):
                raise self._failed(self._log.text())
        fdm.set_dt(self._step_s)
        fdm["gear/gear-cmd-norm"] = fdm["gear/gear-pos-norm"] = 0.0
        return fdm

    def _checked(self, call: Any) -> Any:
        """Call JSBSim; its errors become a SimulatorError."""
        try:
            return call()
        except (jsbsim.BaseError, RuntimeError, ValueError, KeyError) as problem:
            _never_delete(self._fdm)
            raise self._failed(str(problem) or self._log.text()) from problem

    def _failed(self, text: str) -> SimulatorError:
        why = " ".join(text.split()) or "it gives no reason"
        hint = ""
        if self._engine is None and _OF_ENGINES.search(why):
            hint = (
                "its systems need its engines: plant.thrust: engine of a scenario, or another one"
            )
        return SimulatorError(f"JSBSim cannot fly {self._name}: {why}", hint)

    def _evaluate(self) -> None:
        """Evaluate the forces at the present state, without any motion."""
        self._fdm.suspend_integration()
        self._checked(self._fdm.run)
        self._fdm.resume_integration()

    def _push_at_the_centre_of_gravity(self) -> None:
        for axis in "xyz":
            there = self._fdm[f"inertia/cg-{axis}-in"]
            self._fdm[f"{jsbsim_aircraft.THRUST}/location-{axis}-in"] = there

    def _body(self) -> Body:
        fdm, k = self._fdm, SLUG * FT * FT
        Jxx, Jyy, Jzz, J13 = (fdm[f"inertia/i{axes}-slugs_ft2"] * k for axes in _MOMENTS)
        body = Body(
            mass_kg=fdm["inertia/mass-slugs"] * SLUG,
            inertia_kg_m2=Inertia(Jxx=Jxx, Jyy=Jyy, Jzz=Jzz, Jxz=-J13),
            wing_area_m2=fdm["metrics/Sw-sqft"] * FT * FT,
            wing_span_m=fdm["metrics/bw-ft"] * FT,
            mean_chord_m=fdm["metrics/cbarw-ft"] * FT,
            air_density_kg_m3=fdm["atmosphere/rho-slugs_ft3"] * SLUG / FT**3,
        )
        for name in ("wing_area_m2", "wing_span_m", "mean_chord_m"):
            if not getattr(body, name) > 0.0:
                raise self._failed(f"its {name} is {getattr(body, name)!r}, expected > 0")
        return body


def _never_delete(fdm: Any) -> None:
    """Leave an aircraft that has failed in memory.

    The destructor of one that misses a property reads it, and ends the whole process.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(fdm))


class _Log(jsbsim.FGLogger):
    """Collects what JSBSim reports as errors, in place of its output."""

    def __init__(self) -> None:
        super().__init__()
        self._errors: list[str] = []
        self._counts = False

    def set_level(self, level: Any) -> None:
        self._counts = level in {jsbsim.LogLevel.ERROR, jsbsim.LogLevel.FATAL}

    def file_location(self, filename: str, line: int) -> None:
        if self._counts:
            self._errors.append(f"{Path(filename).name}, line {line}: ")

    def message(self, message: str) -> None:
        if self._counts:
            self._errors.append(message)

    def format(self, format: Any) -> None:  # noqa: A002 - JSBSim's name
        pass

    def flush(self) -> None:
        self._counts = False

    def text(self) -> str:
        """Return the errors so far."""
        return "".join(self._errors)
