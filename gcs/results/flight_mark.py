"""The mark of a flight's folder: what was asked for, by which code, and how the command ended.

`flight.yaml` has the request and the facts that a list of flights shows, `scenario.yaml` beside it
the whole scenario as it was flown, with what it extends and what was changed.
"""

import contextlib
import fcntl
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Self

from gcs.console.errors import BadInput, GcsError, Interrupted
from gcs.results.run_folder import SCENARIO
from gcs.scenario.code import code_digest, code_version
from gcs.scenario.model import Scenario
from gcs.scenario.settings import label
from mavlink_defs.config.files import dump, parse
from mavlink_defs.config.output_files import write_text
from mavlink_defs.config.user_files import open_file
from mavlink_defs.config.yaml_text import yaml_of

SCHEMA = 1
"""Number of this layout; it changes when a reader of the old one would go wrong."""

FLIGHT = "flight.yaml"
INTERRUPTED, DONE = "interrupted", "done"


@dataclass(frozen=True)
class FlightMark:
    """What a folder was flown for.

    Attributes:
        command: Of `gcs`: fly or up; ardupilot of an earlier version.
        scenario: File or bundled scenario, as the user named it.
        additions: Files merged into it, in order (``--with``).
        settings: Keys and their values (``--set``).
        title: Name of the scenario, with what was changed.
        law: Kind of the control law, and of foreign autopilots.
        trigger: Mode of the trigger; "" if all have foreign autopilots.
        uavs: Number of UAVs.
        faults: The scenario's faults, each as a text.
        version: Version of the package.
        digest: Digest of the code that flies it.
        started: When the command began, ISO 8601 with the offset from UTC.
        ended: "" while it goes on, or if it was killed; then `DONE`, `INTERRUPTED`, or what ended
            it.
    """

    command: str
    scenario: str
    additions: Sequence[str]
    settings: Mapping[str, Any]
    title: str
    law: str
    trigger: str
    uavs: int
    faults: Sequence[str]
    version: str = field(default_factory=code_version)
    digest: str = field(default_factory=code_digest)
    started: str = field(
        default_factory=lambda: datetime.now().astimezone().isoformat(timespec="seconds")
    )
    ended: str = ""

    @classmethod
    def of(
        cls,
        command: str,
        name: str,
        scenario: Scenario,
        additions: Sequence[str] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> Self:
        """Return the mark of a flight that begins now.

        Args:
            command: Of `gcs`.
            name: Scenario as the user named it.
            scenario: What is flown.
            additions: As of ``--with``.
            settings: Values by key, as of ``--set KEY=VALUE``.
        """
        kinds = sorted({own.kind for own in scenario.foreign.values()})
        ours = len(scenario.foreign) < len(scenario.uavs)
        return cls(
            command=command,
            scenario=name,
            additions=list(additions or ()),
            settings=dict(settings or {}),
            title=scenario.name,
            law=", ".join([*[scenario.controller.kind] * ours, *kinds]),
            trigger=scenario.trigger.mode if ours else "",
            uavs=len(scenario.uavs),
            faults=[f"UAV {uav}: {fault.describe()}" for uav, fault in scenario.fault_commands()],
        )

    @property
    def changes(self) -> list[str]:
        """What was changed against the scenario, each as on the command line."""
        settings = [f"{key}={label(value)}" for key, value in self.settings.items()]
        return [*(f"with {name}" for name in self.additions), *settings]


@contextlib.contextmanager
def marked(folder: Path, scenario: Scenario, mark: FlightMark) -> Iterator[None]:
    """Mark a run folder while its flight goes on, and note at the end how it ended.

    A lock, which ends with the process, tells a flight that is under way from one whose process
    was killed.

    Raises:
        OSError: A file cannot be written at the start; it is named.
    """
    dump(scenario, folder / SCENARIO)
    _write(folder, mark)
    with (folder / FLIGHT).open("rb") as file:
        with contextlib.suppress(OSError):  # no locks on this file system
            fcntl.flock(file, fcntl.LOCK_EX)
        ended = DONE
        try:
            yield
        except BaseException as problem:
            ended = _reason(problem)
            raise
        finally:
            if folder.is_dir():
                with contextlib.suppress(OSError):  # a full disk: it looks killed
                    _write(folder, replace(mark, ended=ended))


def is_under_way(folder: Path) -> bool:
    """Return whether a flight holds the lock of its folder's mark."""
    return is_locked(folder / FLIGHT)


def is_locked(path: Path) -> bool:
    """Return whether a process holds a lock on a file; False if that cannot be known."""
    try:
        with open_file(path) as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def read_mark(folder: Path) -> FlightMark | None:
    """Read the mark of a flight's folder; None of a flight of an earlier version, without one.

    Raises:
        BadInput: It cannot be read, or is something else.
    """
    path = folder / FLIGHT
    try:
        with open_file(path) as file:
            tree = parse(path, file.read().decode("utf-8"))
        if (schema := tree.pop("schema")) == SCHEMA:
            datetime.fromisoformat(tree["started"])
            return FlightMark(**tree)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as problem:
        raise BadInput(f"{path} cannot be read: {problem}") from None
    raise BadInput(
        f"{path} has layout {schema!r}, this version reads {SCHEMA}",
        "read it with the version that wrote it, which it names",
    )


def _write(folder: Path, mark: FlightMark) -> None:
    tree = {"schema": SCHEMA, **vars(mark)}
    write_text(folder / FLIGHT, yaml_of(tree))


def _reason(problem: BaseException) -> str:
    """Return what ended a flight, in short."""
    if isinstance(problem, Interrupted) or not isinstance(problem, Exception):
        return INTERRUPTED
    if isinstance(problem, GcsError | OSError):
        return str(problem)
    return f"a defect: {type(problem).__name__}"
