"""An aircraft of JSBSim as it is flown here: a copy of its files, changed where it must be.

The installed aircraft, or the user's, stays as it is. Files of JSBSim are described in its
reference manual, https://jsbsim-team.github.io/jsbsim-reference-manual/.
"""

import re
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

from sitl_plant.simulators.base import SimulatorError
from sitl_plant.simulators.config import JsbSimPlant, is_own

THRUST = "external_reactions/ftc-thrust"
"""Property of the force that stands in for the engines."""
ZERO = "ftc/zero"
"""Property that stands in for what engines that are not there would do to the air."""

_ENGINE = re.compile(r"^\s*-?\s*propulsion/engine\b")
_READ_BY_FUNCTIONS = ("property", "p", "independentVar")


class AircraftSource(NamedTuple):
    """Where an aircraft is read from."""

    name: str
    folder: Path
    engines: Path
    systems: Path


def find(aircraft: str, bundled: Path) -> AircraftSource:
    """Return where an aircraft is.

    Args:
        aircraft: Name of a bundled one, or a folder or file.
        bundled: Folder of the installed JSBSim, with `aircraft`, `engine` and `systems`.

    Raises:
        SimulatorError: There is no such aircraft.
    """
    if not is_own(aircraft):
        folder = bundled / "aircraft" / aircraft
        if (folder / f"{aircraft}.xml").is_file():
            return AircraftSource(aircraft, folder, bundled / "engine", bundled / "systems")
        raise SimulatorError(
            f"plant.aircraft: expected one that comes with JSBSim, got {aircraft!r}",
            f"a folder of your own is ./{aircraft}; JSBSim has its own in {folder.parent}",
        )
    file = Path(aircraft).expanduser().absolute()
    if file.is_dir():
        file /= f"{file.name}.xml"
    if file.suffix != ".xml" or not file.is_file():
        raise SimulatorError(
            f"plant.aircraft: expected a folder NAME with NAME.xml in it, or the file, got "
            f"{aircraft!r}"
        )
    own = file.parent

    def beside(folder: str) -> Path:
        there = own.parent.parent / folder  # root/aircraft/NAME and root/engine, as JSBSim has it
        return there if there.is_dir() else bundled / folder

    return AircraftSource(file.stem, own, beside("engine"), beside("systems"))


def write_copy(source: AircraftSource, section: JsbSimPlant, target: Path) -> None:
    """Write an aircraft's files to `target`/NAME, as they are flown.

    Nothing is written to other files in flight, and no port is opened: outputs and inputs are
    left out. With `thrust: force` a force stands in for the engines.

    Raises:
        SimulatorError: A file cannot be read, or has not what is to be changed.
    """
    folder = target / source.name
    folder.mkdir()
    main = f"{source.name}.xml"
    for entry in source.folder.iterdir():
        if entry.name != main:
            (folder / entry.name).symlink_to(entry.absolute())
    tree = _read(source.folder / main)
    _patch(tree, section.patch, source.folder / main)
    for tag in ("output", "input"):
        for element in tree.findall(tag):
            tree.remove(element)
    if section.thrust == "force":
        _replace_engines(tree, source.folder)
    ET.ElementTree(tree).write(folder / main, encoding="utf-8", xml_declaration=True)


def _read(path: Path) -> ET.Element:
    try:
        tree = ET.parse(path).getroot()
    except OSError as problem:
        raise SimulatorError(f"cannot read {path}: {problem.strerror}") from None
    except ET.ParseError as problem:
        raise SimulatorError(f"{path}: not XML: {problem}") from None
    return tree


def _patch(tree: ET.Element, patch: dict[str, float | str], path: Path) -> None:
    if tree.tag != "fdm_config":
        raise SimulatorError(f"{path}: expected an aircraft, <fdm_config>, got <{tree.tag}>")
    for place, value in patch.items():
        element, _, attribute = place.partition("/@")
        try:
            found = tree.findall(element)
        except (SyntaxError, KeyError, TypeError):  # of a path that ElementTree does not understand
            found = []
        if len(found) != 1:
            raise SimulatorError(
                f"plant.patch: expected the path of one element in {path.name}, got {place!r}, "
                f"which is the path of {len(found)}",
                "such as metrics/wingarea, or mass_balance/pointmass[@name='Pilot']/weight",
            )
        text = value if isinstance(value, str) else repr(value)
        if attribute:
            found[0].set(attribute, text)
        else:
            found[0].text = text


def _replace_engines(tree: ET.Element, folder: Path) -> None:
    for tag in ("propulsion", "aerodynamics"):
        _include(tree, tag, folder)
    for propulsion in tree.findall("propulsion"):
        for engine in propulsion.findall("engine"):
            propulsion.remove(engine)
    for aerodynamics in tree.findall("aerodynamics"):
        for element in aerodynamics.iter():
            if element.tag in _READ_BY_FUNCTIONS and _ENGINE.match(element.text or ""):
                element.text = ZERO
    reactions = tree.find("external_reactions")
    if reactions is None:
        reactions = ET.SubElement(tree, "external_reactions")
    force = ET.SubElement(reactions, "force", name=THRUST.rpartition("/")[2], frame="BODY")
    location = ET.SubElement(force, "location", unit="IN")  # put to the CG once that is known
    direction = ET.SubElement(force, "direction")
    for axis, along in zip("xyz", ("1", "0", "0"), strict=True):
        ET.SubElement(location, axis).text = "0"
        ET.SubElement(direction, axis).text = along


def _include(tree: ET.Element, tag: str, folder: Path) -> None:
    """Put the content of a file that an element names in its place."""
    for element in tree.findall(tag):
        name = element.attrib.pop("file", None)
        if name is not None:
            path = folder / name
            element.extend(_read(path if path.suffix == ".xml" else path.with_suffix(".xml")))
