"""Parameter files of other ground stations; comments begin with #.

MAVProxy and Mission Planner write a name and a value a line, QGroundControl vehicle, component,
name, value and type. Of the latter the autopilot's are read, whatever the vehicle.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gcs.console.errors import CommandRefused, NoAnswer
from mavlink_defs import dialect
from mavlink_defs.config.problems import ConfigError, Problem, counted
from mavlink_defs.config.renamed import PARAMETERS
from mavlink_defs.config.user_files import read_text
from mavlink_defs.float32 import float32s
from mavlink_defs.services.param import MAX_NAME, Param
from mavlink_defs.visible import visible

if TYPE_CHECKING:
    from gcs.station.vehicle import Vehicle

READ_ONLY = frozenset({"SYSID_THISMAV", "MAV_TYPE", "MAV_AUTOPILOT", "STEP_US", "CTRL_LAW"})
"""Parameters that say what a vehicle is; nobody can set them."""
_QGC_COLUMNS = 5
_MAX_NAMED = 5


def text_of(params: Iterable[Param], title: str) -> str:
    """Return the text of a file; values have the digits that make the same number again."""
    lines = [f"{param.name:<{MAX_NAME}} {param.value:.9g}" for param in params]
    return "\n".join([f"# {title}", *lines, ""])


def read_param_file(path: Path) -> dict[str, float]:
    """Return the values of a file by name.

    Raises:
        ConfigError: It cannot be used; it names every line that is wrong.
    """
    values: dict[str, float] = {}
    problems = []
    for number, line in enumerate(read_text(path).splitlines(), 1):
        parts = line.partition("#")[0].replace(",", " ").split()
        if len(parts) == _QGC_COLUMNS and parts[0].isdecimal() and parts[1].isdecimal():
            parts = parts[2:4] if int(parts[1]) == dialect.MAV_COMP_ID_AUTOPILOT1 else []
        if not parts:
            continue
        problem = _problem_of(parts, values)
        if problem:
            problems.append(Problem((), f"line {number}: {problem}"))
        else:
            values[parts[0]] = float(parts[1])
    if problems:
        raise ConfigError(path, problems)
    if not values:
        raise ConfigError(path, [Problem((), "has no parameters: expected NAME VALUE lines")])
    return values


def read_settable(path: Path) -> dict[str, float]:
    """Return the values of a file that can be set: read-only ones are left out.

    Raises:
        ConfigError: As of `read_param_file`.
    """
    return {n: v for n, v in read_param_file(path).items() if n not in READ_ONLY}


def _problem_of(parts: list[str], values: Mapping[str, float]) -> str:
    """Return what is wrong with the parts of a line; "" if nothing is."""
    line = visible(" ".join(parts))
    if len(parts) != 2:
        return f"expected NAME VALUE, got '{line[:60]}'"
    name, text = parts
    if len(name) > MAX_NAME or not name.isascii() or not name.isprintable():
        return f"expected a name of at most {MAX_NAME} ASCII characters, got '{visible(name)[:60]}'"
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    fits = all(map(math.isfinite, float32s([value])))
    if not fits:
        return f"{name}: expected a finite number of 32 bits, got '{visible(text)[:60]}'"
    return f"{name} is given twice" if name in values else ""


def differing(held: Iterable[Param], values: Mapping[str, float]) -> dict[str, float | None]:
    """Return the values held that differ from a file; None for a name that is not held.

    A file may have names of before, which a vehicle knows as well. Numbers are compared as the wire
    carries them, in 32 bits.
    """
    by_name = {param.name: param.value for param in held}
    before = {name: by_name[now] for name, now in PARAMETERS.items() if now in by_name}
    by_name = before | by_name
    return {
        name: by_name.get(name)
        for name, value in values.items()
        if name not in by_name or float32s([by_name[name]]) != float32s([value])
    }


def difference(system: int, name: str, held: float, other: str) -> str:
    """Return as a text that a vehicle holds something else: "UAV 1: C_V = 9, file 10"."""
    return f"UAV {system}: {name} = {held:.9g}, {other}"


def difference_lines(
    system: int, held: Mapping[str, float | None], values: Mapping[str, float]
) -> list[str]:
    """Return what `differing` found as lines; names that are not held share the last one."""
    unknown = [name for name, value in held.items() if value is None]
    lines = [
        difference(system, name, value, f"file {values[name]:.9g}")
        for name, value in held.items()
        if value is not None
    ]
    return [*lines, f"UAV {system}: {unknown_text(unknown)}"] if unknown else lines


def unknown_text(names: Sequence[str]) -> str:
    """Return the names that a vehicle does not have as a text: "2 unknown names (A, B)"."""
    first = ", ".join([*names[:_MAX_NAMED], *(["..."] if len(names) > _MAX_NAMED else [])])
    return f"{counted(len(names), 'unknown name')} ({first})"


async def set_values(
    vehicle: "Vehicle", values: Mapping[str, float], held: Mapping[str, float | None]
) -> str:
    """Set the parameters of a file that a vehicle holds differently, and return how many.

    Args:
        vehicle: The vehicle.
        values: What is to be set, by name.
        held: What `differing` returns of it: None for names that it does not have.

    Raises:
        CommandRefused: Some were refused, or do not exist, the others are set; it says how many.
        NoAnswer: The vehicle no longer answers; it says how many were set before.
    """
    unknown = [name for name, value in held.items() if value is None]
    names = [name for name, value in held.items() if value is not None]
    refused: list[CommandRefused] = []
    for done, name in enumerate(names):
        try:
            await vehicle.set_param(name, values[name])
        except CommandRefused as problem:
            refused.append(problem)
        except NoAnswer as problem:
            so_far = f"UAV {vehicle.system}: {done - len(refused)} of {len(names)} set"
            raise NoAnswer("\n".join([f"{so_far}, then: {problem}", *map(str, refused)])) from None
    if not refused and not unknown:
        return f"UAV {vehicle.system}: {counted(len(names), 'parameter')} set"
    count = f"{len(names) - len(refused)} of {len(held)} set"
    counts = [count, *([f"{len(refused)} refused"] if refused else [])]
    counts += [unknown_text(unknown)] if unknown else []
    results = [problem.result for problem in refused] + [dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST]
    text = "\n".join([f"UAV {vehicle.system}: {', '.join(counts)}", *map(str, refused)])
    raise CommandRefused(text, results[0])
