"""JSBSim as a simulator of one aircraft: its aerodynamics and its flight control, our thrust.

The aircraft's file is copied to a scratch folder, its engines are left out, and a force along x at
the centre of gravity takes their place. Surfaces are put where they are to be by the inverse of
what its flight control makes of commands. An aircraft whose flight control is a law of its own has
no such inverse, and is refused.
"""

import math
import shutil
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from sitl_plant.config import Inertia
from sitl_plant.simulators.base import Body, Motion
from sitl_plant.vec3 import Vec3

_FOOT, _POUND, _SLUG = 0.3048, 4.4482216152605, 14.59390293720636  # m, N, kg
_SLUG_FOOT2 = _SLUG * _FOOT**2
_STEP_S = 1e-3
_SURFACES = (
    ("fcs/aileron-cmd-norm", "fcs/left-aileron-pos-rad"),
    ("fcs/elevator-cmd-norm", "fcs/elevator-pos-rad"),
    ("fcs/rudder-cmd-norm", "fcs/rudder-pos-rad"),
)
_COMMANDS = np.linspace(-1.0, 1.0, 41)
_LEAST_STEP = 1e-9  # rad of a surface between two of them
_ABSENT = "ftc/absent"  # takes the place of the properties of engines: always 0
_THRUST = "external_reactions/ftc-thrust"
_TRIAL_SPEED = 40.0  # m/s, at which the sign of a surface shows
_TRIAL = 0.1  # of the way to its stop


class SimulatorError(Exception):
    """An aircraft that a simulator cannot fly, and why."""


class JsbsimSimulator:
    """An aircraft of JSBSim, as `sitl_plant.simulators.base.Simulator`.

    Attributes:
        version: Of JSBSim.
    """

    def __init__(
        self, aircraft: str, altitude: float = 0.0, wing_area: float | None = None
    ) -> None:
        """Load an aircraft.

        Args:
            aircraft: Name of one that comes with JSBSim, or its file.
            altitude: Where it starts [m].
            wing_area: Reference area in place of its own [m²].

        Raises:
            SimulatorError: JSBSim is not installed, or the aircraft cannot be flown so.
        """
        try:
            jsbsim: Any = import_module("jsbsim")
        except ImportError as problem:
            text = "JSBSim is not installed here: pip install jsbsim"
            raise SimulatorError(text) from problem
        self.version: str = jsbsim.__version__
        jsbsim.FGJSBBase().debug_lvl = 0  # else it prints a banner on the standard output
        self._altitude = altitude
        self._north = self._east = 0.0
        self._signs = [1.0, 1.0, 1.0]
        self._wind: Vec3 = (0.0, 0.0, 0.0)
        with tempfile.TemporaryDirectory(prefix="ftc-jsbsim-") as scratch:
            root = Path(scratch)
            name = _copied(aircraft, Path(jsbsim.get_default_root_dir()), root, wing_area)
            try:
                self._load(jsbsim, name, root)
            except RuntimeError as problem:  # of JSBSim: properties that engines have, say
                text = f"JSBSim does not load {name} without its engines: {_one_line(problem)}"
                raise SimulatorError(text) from problem
        self.stops: tuple[tuple[float, float], ...] = tuple(
            (float(p[0]), float(p[-1])) if sign > 0.0 else (-float(p[-1]), -float(p[0]))
            for (p, _), sign in zip(self._maps, self._signs, strict=True)
        )
        self.control((0.0, 0.0, 0.0), 0.0)

    def _load(self, jsbsim: Any, name: str, root: Path) -> None:
        fdm = jsbsim.FGFDMExec(str(root))
        fdm.set_debug_level(0)
        if not fdm.load_model(name):
            raise SimulatorError(f"JSBSim does not load {name} without its engines")
        fdm.set_dt(_STEP_S)
        self._fdm: Any = fdm
        for gear in ("gear/gear-cmd-norm", "gear/gear-pos-norm"):
            fdm[gear] = 0.0
        self.reset(_at(_TRIAL_SPEED, self._altitude))
        self.body = self._body()
        self._maps = [_map_of(fdm, name, *surface) for surface in _SURFACES]
        self.reset(_at(_TRIAL_SPEED, self._altitude))
        self._signs = [self._sign_of(i) for i in range(len(_SURFACES))]

    def reset(self, motion: Motion) -> None:
        """Put the aircraft somewhere, its surfaces where `control` last put them."""
        fdm = self._fdm
        u, v, w = (x / _FOOT for x in motion.velocity)
        self._north, self._east, down = motion.position
        fdm["ic/h-sl-ft"] = -down / _FOOT
        fdm["ic/u-fps"], fdm["ic/v-fps"], fdm["ic/w-fps"] = u, v, w
        names = ("ic/phi-rad", "ic/theta-rad", "ic/psi-true-rad")
        for name, angle in zip(names, motion.attitude, strict=True):
            fdm[name] = angle
        fdm["ic/u-fps"], fdm["ic/v-fps"], fdm["ic/w-fps"] = u, v, w
        for name, rate in zip(
            ("ic/p-rad_sec", "ic/q-rad_sec", "ic/r-rad_sec"), motion.rates, strict=True
        ):
            fdm[name] = rate
        fdm.run_ic()
        self.set_wind(self._wind)  # which that has forgotten
        for axis in "xyz":
            fdm[f"{_THRUST}/location-{axis}-in"] = fdm[f"inertia/cg-{axis}-in"]

    def control(self, delta: Vec3, thrust: float) -> None:
        """Put aileron, elevator, rudder [rad] and the thrust along x [N] where they are to be."""
        for (command, _), (positions, commands), sign, angle in zip(
            _SURFACES, self._maps, self._signs, delta, strict=True
        ):
            self._fdm[command] = float(np.interp(sign * angle, positions, commands))
        self._fdm[f"{_THRUST}/magnitude"] = thrust / _POUND

    def set_wind(self, wind: Vec3) -> None:
        """Set the velocity of the air, north, east, down [m/s]."""
        self._wind = wind
        for axis, speed in zip(("north", "east", "down"), wind, strict=True):
            self._fdm[f"atmosphere/wind-{axis}-fps"] = speed / _FOOT

    def advance(self, dt: float) -> None:
        """Advance by a time [s], a multiple of 1 ms."""
        fdm = self._fdm
        for _ in range(round(dt / _STEP_S)):
            if not fdm.run():
                raise SimulatorError("JSBSim has ended the flight")
            self._north += _STEP_S * _FOOT * fdm["velocities/v-north-fps"]
            self._east += _STEP_S * _FOOT * fdm["velocities/v-east-fps"]

    def read(self) -> Motion:
        """Return the present motion."""
        fdm = self._fdm
        per_pound = _FOOT / fdm["inertia/mass-slugs"]
        u, v, w = (_FOOT * fdm[f"velocities/{axis}-fps"] for axis in "uvw")
        phi, theta, psi = (fdm[f"attitude/{name}-rad"] for name in ("phi", "theta", "psi"))
        p, q, r = (fdm[f"velocities/{axis}-rad_sec"] for axis in "pqr")
        x, y, z = (per_pound * fdm[f"forces/fb{axis}-total-lbs"] for axis in "xyz")
        down = -_FOOT * fdm["position/h-sl-ft"]
        return Motion(
            (self._north, self._east, down), (u, v, w), (phi, theta, psi), (p, q, r), (x, y, z)
        )

    def _body(self) -> Body:
        fdm = self._fdm
        Jxx, Jyy, Jzz, Jxz = (
            _SLUG_FOOT2 * fdm[f"inertia/i{axes}-slugs_ft2"] for axes in ("xx", "yy", "zz", "xz")
        )
        return Body(
            _SLUG * fdm["inertia/mass-slugs"],
            Inertia(Jxx=Jxx, Jyy=Jyy, Jzz=Jzz, Jxz=-Jxz),  # it gives J13, which is -Jxz
            _FOOT**2 * fdm["metrics/Sw-sqft"],
            _FOOT * fdm["metrics/bw-ft"],
            _FOOT * fdm["metrics/cbarw-ft"],
            _SLUG / _FOOT**3 * fdm["atmosphere/rho-slugs_ft3"],
        )

    def _sign_of(self, i: int) -> float:
        """Return 1 if a positive deflection of a surface turns against its axis, else -1."""
        positions, _ = self._maps[i]
        rates = []
        for end in (positions[0], positions[-1]):
            delta = [0.0, 0.0, 0.0]
            delta[i] = _TRIAL * float(end)
            self.control((delta[0], delta[1], delta[2]), 0.0)
            self.reset(_at(_TRIAL_SPEED, self._altitude))
            self.advance(5.0 * _STEP_S)
            rates.append(self.read().rates[i])
        self.control((0.0, 0.0, 0.0), 0.0)
        return 1.0 if rates[1] <= rates[0] else -1.0


def _one_line(problem: Exception) -> str:
    return " ".join(str(problem).split())


def _at(V: float, altitude: float) -> Motion:
    rest = (0.0, 0.0, 0.0)
    return Motion((0.0, 0.0, -altitude), (V, 0.0, 0.0), rest, rest, rest)


def _copied(aircraft: str, installed: Path, root: Path, wing_area: float | None) -> str:
    """Write an aircraft without engines below a folder, and return its name."""
    given = Path(aircraft)
    name = given.stem
    source = given if given.is_file() else installed / "aircraft" / name / f"{name}.xml"
    if not source.is_file():
        text = f"no such file, and no aircraft of JSBSim of that name: {aircraft}"
        raise SimulatorError(text)
    for part in ("engine", "systems"):
        (root / part).symlink_to(installed / part)
    folder = root / "aircraft" / name
    shutil.copytree(source.parent, folder)
    try:
        tree = ET.parse(source)
    except ET.ParseError as problem:
        raise SimulatorError(f"{source} is not XML: {problem}") from problem
    _without_engines(tree.getroot())
    if wing_area is not None:
        _set_wing_area(tree.getroot(), wing_area)
    tree.write(folder / f"{name}.xml", encoding="unicode")
    return name


def _without_engines(config: ET.Element) -> None:
    """Put a force along x in place of the engines of an aircraft."""
    for propulsion in config.iter("propulsion"):
        for engine in propulsion.findall("engine"):
            propulsion.remove(engine)
    for element in list(config.iter()):
        if (text := element.text) and "propulsion/engine" in text:
            element.text = " ".join(
                _ABSENT if "propulsion/engine" in word else word for word in text.split()
            )
    for kind in ("external_reactions", "input", "output"):  # the last two open sockets and files
        for old in config.findall(kind):
            config.remove(old)
    reactions = ET.SubElement(config, "external_reactions")
    ET.SubElement(reactions, "property").text = _ABSENT
    force = ET.SubElement(reactions, "force", name="ftc-thrust", frame="BODY")
    location = ET.SubElement(force, "location", unit="IN")
    direction = ET.SubElement(force, "direction")
    for axis, along in zip("xyz", (1.0, 0.0, 0.0), strict=True):
        ET.SubElement(location, axis).text = "0"
        ET.SubElement(direction, axis).text = str(along)


def _set_wing_area(config: ET.Element, area: float) -> None:
    for metrics in config.iter("metrics"):
        for element in metrics.findall("wingarea"):
            element.set("unit", "M2")
            element.text = repr(area)


def _map_of(fdm: Any, name: str, command: str, position: str) -> tuple[np.ndarray, np.ndarray]:
    """Return positions of a surface [rad], increasing, and the commands that make them.

    Raises:
        SimulatorError: They are not one to one.
    """
    found = np.array(list(_swept(fdm, command, position)))
    steps = [b - a for a, b in pairwise(found)]
    if not (min(steps) > _LEAST_STEP or max(steps) < -_LEAST_STEP):
        degrees = ", ".join(f"{math.degrees(x):.1f}" for x in found[::10])
        raise SimulatorError(
            f"{name} makes positions of [{degrees}] deg of {command} = -1 to 1 in steps of 0.5: "
            "not one to one, so that its surface cannot be put anywhere; is its flight control a "
            "law of its own?"
        )
    order = np.argsort(found)
    return found[order], _COMMANDS[order]


def _swept(fdm: Any, command: str, position: str) -> Iterator[float]:
    for x in _COMMANDS:
        fdm[command] = float(x)
        fdm.run_ic()
        yield float(fdm[position])
    fdm[command] = 0.0
