"""What every reader of logs says in a line: a file that cannot be read or is broken, and whose."""

import contextlib
from collections.abc import Collection, Iterator
from pathlib import Path

from gcs.console.errors import BadInput
from mavlink_defs.visible import visible


@contextlib.contextmanager
def reading(path: Path, broken: str | None = None) -> Iterator[None]:
    """Say in a line why a file cannot be read.

    Args:
        path: The file.
        broken: What it is if another error is raised than of its system: packages that read files
            raise anything of broken ones. None: such an error is raised as it is.

    Raises:
        BadInput: It cannot be read, or is broken.
    """
    try:
        yield
    except BadInput:
        raise
    except Exception as problem:
        if isinstance(problem, OSError) and problem.strerror:
            raise BadInput(f"cannot read {path}: {problem.strerror}") from None
        if broken is None:
            raise
        first_line = visible(str(problem).partition("\n")[0])
        raise BadInput(f"{path} {broken}: {type(problem).__name__}: {first_line}") from None


def chosen_vehicle(
    path: Path, systems: Collection[int], uav: int | None, usual: int
) -> tuple[int, list[str]]:
    """Return the system id of the vehicle whose log is read, and a remark if there are others.

    Args:
        path: The file, for the message.
        systems: Those that are in it.
        uav: The one that is asked for; None: the usual one.
        usual: One of them.

    Raises:
        BadInput: It is not there.
    """
    if uav is not None and uav not in systems:
        known = ", ".join(map(str, sorted(systems)))
        raise BadInput(f"--uav is {uav}, expected one of {known}, as in {path}")
    chosen = usual if uav is None else uav
    others = ", ".join(str(one) for one in sorted(systems) if one != chosen)
    return chosen, [f"of UAV {chosen}; it has {others}, too (--uav)"] if others else []
