"""Parameter files of MAVProxy and Mission Planner: a name and a value a line, comments after #."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from gcs.errors import CommandRefused, NoAnswer
from mavlink_defs.config.problems import ConfigError, Problem, counted
from mavlink_defs.config.user_files import read_text
from mavlink_defs.float32 import float32s
from mavlink_defs.services.param import MAX_NAME, Param
from mavlink_defs.visible import visible

if TYPE_CHECKING:
    from gcs.station.vehicle import Vehicle

READ_ONLY = frozenset({"SYSID_THISMAV", "MAV_TYPE", "MAV_AUTOPILOT", "STEP_US", "CTRL_LAW"})
"""Parameters that say what a vehicle is; nobody can set them."""


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

    Numbers are compared as the wire carries them, in 32 bits.
    """
    by_name = {param.name: param.value for param in held}
    return {
        name: by_name.get(name)
        for name, value in values.items()
        if name not in by_name or float32s([by_name[name]]) != float32s([value])
    }


def difference(system: int, name: str, held: float | None, other: str) -> str:
    """Return as a text that a vehicle holds something else: "UAV 1: C_V = 9, file 10"."""
    now = "not held" if held is None else f"{held:.9g}"
    return f"UAV {system}: {name} = {now}, {other}"


async def set_values(vehicle: "Vehicle", values: Mapping[str, float]) -> str:
    """Set parameters one after the other, and return how many.

    Raises:
        CommandRefused: Some were refused, the others are set; it names them, and says how many.
        NoAnswer: The vehicle no longer answers; it says how many were set before.
    """
    refused: list[CommandRefused] = []
    for done, (name, value) in enumerate(values.items()):
        try:
            await vehicle.set_param(name, value)
        except CommandRefused as problem:
            refused.append(problem)
        except NoAnswer as problem:
            so_far = f"UAV {vehicle.system}: {done - len(refused)} of {len(values)} set"
            raise NoAnswer("\n".join([f"{so_far}, then: {problem}", *map(str, refused)])) from None
    if refused:
        count = f"{len(values) - len(refused)} of {len(values)} set, {len(refused)} refused"
        text = "\n".join([f"UAV {vehicle.system}: {count}", *map(str, refused)])
        raise CommandRefused(text, refused[0].result)
    return f"UAV {vehicle.system}: {counted(len(values), 'parameter')} set"
