"""The scenarios that come with the package, by name: ``paper/scenario1``.

Other packages register folders of theirs in the group of entry points ``ftc_sitl.scenarios``: what
lies there is ``NAME/FILE``, and so is an aircraft of its folder ``aircraft``.

Beside their folders are additions: files that are no scenarios by themselves but to be merged
into one, by name as well: ``realistic``.

Where a command takes a scenario, an existing file takes precedence over a bundled one.
"""

import difflib
import functools
from importlib.util import find_spec
from pathlib import Path

from ftc_autopilot.plugins.loading import SCENARIOS as GROUP
from ftc_autopilot.plugins.loading import registered
from mavlink_defs.config.models import ConfigError, Problem

_PACKAGE = Path(__file__).parents[1]
_INSTALLED = _PACKAGE / "bundled_scenarios"
SCENARIOS = _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parent / "scenarios"
"""Folder of the bundled scenarios: in a wheel, or in a clone of the project."""


AIRCRAFT = _PACKAGE / "bundled_aircraft" if _INSTALLED.is_dir() else _PACKAGE.parent / "aircraft"
"""Folder of the bundled aircraft."""


def aircraft_names() -> list[str]:
    """Return the names of all bundled aircraft, sorted, and those that other packages register."""
    return [*sorted(path.stem for path in AIRCRAFT.glob("*.yaml")), *sorted(_of_others("aircraft"))]


def file_of(name: str) -> Path:
    """Return the file of a name in `bundled_names` or `addition_names`."""
    return _of_others().get(name) or SCENARIOS / f"{name}.yaml"


@functools.cache
def _of_others(below: str = "") -> dict[str, Path]:
    """Return the files of other packages by name: scenarios, or those in a folder of theirs."""
    found = {}
    for name, point in registered(GROUP).items():
        try:
            spec = find_spec(point.value)
        except ImportError:
            spec = None
        for place in () if spec is None else spec.submodule_search_locations or ():
            folder = Path(place) / below
            for path in folder.glob("**/*.yaml"):
                part = path.relative_to(folder).with_suffix("").as_posix()
                if below or not part.startswith("aircraft/"):
                    found[f"{name}/{part}"] = path
    return found


def find_aircraft(folder: Path, name: str) -> Path:
    """Return the file that the name of an aircraft refers to in a file of a folder.

    Raises:
        ConfigError: There is neither such a file nor such a bundled aircraft.
    """
    path = folder / name
    if path.exists() and not path.is_dir():  # what is no file says so when it is read
        return path
    stem = name.removesuffix(".yaml")
    if stem in (names := aircraft_names()):
        return _of_others("aircraft").get(stem) or AIRCRAFT / f"{stem}.yaml"
    alike = difflib.get_close_matches(stem, names, n=1)
    meant = f"; did you mean '{alike[0]}'?" if alike else ""
    text = f"no such file, and no bundled aircraft of that name{meant}"
    asked = path if path.suffix else Path(name)
    raise ConfigError(asked, [Problem((), f"{text} (`gcs aircraft` lists them)")])


def bundled_names() -> list[str]:
    """Return the names of all bundled scenarios, sorted, and those that other packages register."""
    return [*_names_in(SCENARIOS), *sorted(_of_others())]


@functools.cache
def _names_in(folder: Path) -> list[str]:
    files = folder.glob("*/**/*.yaml")
    return sorted(path.relative_to(folder).with_suffix("").as_posix() for path in files)


def addition_names() -> list[str]:
    """Return the names of all bundled additions, sorted."""
    return sorted(path.stem for path in SCENARIOS.glob("*.yaml"))


def find_scenario(name: Path | str) -> Path:
    """Return the file that the name of a scenario refers to.

    Args:
        name: A path, or the name of a bundled scenario or addition with or without ``.yaml``.

    Raises:
        ConfigError: There is neither; similar names are suggested.
    """
    return _find(Path(name), str(name))


def base_of(folder: Path, name: str) -> Path:
    """Return the file that ``extends: name`` refers to in a file of a folder.

    Raises:
        ConfigError: As of `find_scenario`.
    """
    return _find(folder / name, name)


def _find(path: Path, name: str) -> Path:
    if path.exists() and not path.is_dir():
        return path
    names = bundled_names() + addition_names()
    requested = name.removesuffix(".yaml")
    if requested in names:
        return file_of(requested)
    if path.is_dir():
        return path
    stem = requested.rpartition("/")[2]
    alike = [known for known in names if known.rpartition("/")[2] == stem]
    alike = alike or difflib.get_close_matches(requested, names, n=3)
    meant = f"; did you mean {' or '.join(alike)}?" if alike else ""
    text = f"no such file, and no bundled scenario of that name{meant}"
    raise ConfigError(path, [Problem((), f"{text} (`gcs scenarios` lists them)")])
