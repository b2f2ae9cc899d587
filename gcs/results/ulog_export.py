"""The recording of a flight as ULog files of PX4, one for each UAV."""

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.plugins.loading import without_code
from gcs.console.errors import BadInput
from gcs.results.figures import UavSummary
from gcs.results.flight_mark import read_mark
from gcs.results.run_folder import SCENARIO, read_summary
from gcs.results.store import EVENTS, TRAJECTORY, batches
from gcs.results.ulog_file import Level, UlogWriter, text_message
from gcs.results.ulog_topics import event_messages, step_messages, topics_of
from gcs.scenario.model import Scenario, read_scenario
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.output_files import complete_file
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.faults.kinds import FaultLimits

if TYPE_CHECKING:
    import pyarrow as pa

_RELEASE = 255  # kind of a version: one that was released
_Timed = tuple[int, bytes]
"""A message and its time [µs]."""


def to_ulg(run: Path, folder: Path) -> list[Path]:
    """Write the recording of a run folder, a file for each UAV; return their paths.

    Raises:
        BadInput: There is no recording, it has no steps, or it is of a version that did not store
            the ranges of the actuators.
        OSError: A file cannot be written; it is named.
    """
    found = batches(run / TRAJECTORY)
    first = next(found, None)
    if first is None:
        raise BadInput(f"{run / TRAJECTORY} has no rows")
    logs = _Logs(run, first.schema)
    paths = {system: folder / f"uav{system}.ulg" for system in logs.systems}
    with without_code(), contextlib.ExitStack() as stack:
        files = {system: stack.enter_context(complete_file(path)) for system, path in paths.items()}
        logs.begin(files, round(float(first.column("time_s")[0].as_py()) * 1e6))
        logs.add(first)
        for batch in found:
            logs.add(batch)
        logs.end()
    return list(paths.values())


class _Logs:
    """The files of all UAVs, written together as the recording is read."""

    def __init__(self, run: Path, schema: "pa.Schema") -> None:
        about = schema.metadata
        if b"limits" not in about:
            raise BadInput(
                f"{run / TRAJECTORY} does not say how far the actuators move: an earlier version "
                "recorded it",
                "fly again, or export to csv, parquet or mcap",
            )
        self._origin = Origin.model_validate_json(about[b"origin"])
        self._names: Mapping[str, str] = json.loads(about[b"names"])
        self._limits = {
            int(system): FaultLimits(tuple(map(tuple, one["surfaces_deg"])), one["thrust_n"])
            for system, one in json.loads(about[b"limits"]).items()
        }
        self._title = about[b"scenario"].decode()
        self._topics = topics_of(set(schema.names))
        self._run = run
        self._scenario = _scenario_of(run)
        self._writers: dict[int, UlogWriter] = {}
        self._waiting: dict[int, list[_Timed]] = {}  # the next one last

    @property
    def systems(self) -> list[int]:
        """System ids."""
        return list(self._limits)

    def begin(self, files: Mapping[int, BinaryIO], start_us: int) -> None:
        """Write the definitions, and prepare what has times of its own."""
        events = sent_in(self._run)
        for system, file in files.items():
            self._writers[system] = UlogWriter(
                file,
                start_us,
                self._information(system),
                _parameters(self._scenario, system),
                self._topics,
            )
            timed = [
                message
                for times, messages in event_messages(
                    *events.get(system, (np.empty(0), np.empty(0, int), np.empty(0))),
                    self._limits[system],
                )
                for message in _split(times, messages)
            ]
            timed += _texts(self._run, self._scenario, system)
            self._waiting[system] = sorted(timed, key=lambda message: message[0])[::-1]

    def add(self, batch: "pa.RecordBatch") -> None:
        """Write recorded steps, with everything that happened until the last one."""
        table = {
            name: batch.column(name).to_numpy(zero_copy_only=False) for name in batch.schema.names
        }
        for system in self._writers:
            own = table["uav"] == system
            if not own.any():
                continue
            columns = {name: column[own] for name, column in table.items()}
            at, topics = step_messages(columns, self._origin, self._limits[system])
            steps = [message for messages in topics for message in _split(at, messages)]
            waiting, last = self._waiting[system], int(at[-1])
            while waiting and waiting[-1][0] <= last:
                steps.append(waiting.pop())
            self._write(system, steps)

    def end(self) -> None:
        """Write what happened after the last step that was recorded."""
        for system, waiting in self._waiting.items():
            self._write(system, waiting[::-1])

    def _write(self, system: int, messages: list[_Timed]) -> None:
        messages.sort(key=lambda message: message[0])
        self._writers[system].add(b"".join(message for _, message in messages))

    def _information(self, system: int) -> dict[str, str | int]:
        mark = read_mark(self._run)
        found: dict[str, str | int] = {
            "sys_name": "ftc-sitl",
            "ver_hw": "SITL",
            "time_ref_utc": 0,  # of simulated time, whose beginning is 0
            "scenario": self._title,
            "vehicle": f"UAV {system}, {self._names.get(str(system), '')}",
        }
        if mark is not None:
            found |= {"ver_sw": mark.digest, "law": mark.law, "trigger": mark.trigger}
            numbers = mark.version.split(".")[:3]
            if len(numbers) == 3 and all(map(str.isdigit, numbers)):
                major, minor, patch = map(int, numbers)
                found["ver_sw_release"] = major << 24 | minor << 16 | patch << 8 | _RELEASE
        return found


def _split(times: np.ndarray, messages: np.ndarray) -> Iterator[_Timed]:
    """Yield each message with its time."""
    size, data = messages.dtype.itemsize, messages.tobytes()
    for k, at in enumerate(times.tolist()):
        yield at, data[k * size : (k + 1) * size]


def sent_in(run: Path) -> dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return time, channel and value of each UAV's events; of a torn file up to its tear."""
    parts = []
    for batch in batches(run / EVENTS):
        actuator = batch.column("actuator")
        order = [ACTUATORS.index(name) for name in actuator.dictionary.to_pylist()]
        channel = np.array(order)[actuator.indices.to_numpy()]
        plain = (batch.column(name).to_numpy() for name in ("uav", "time_s", "value"))
        parts.append((channel, *plain))
    if not parts:
        return {}
    channel, uav, time_s, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    return {
        int(system): (time_s[own], channel[own], value[own])
        for system in np.unique(uav)
        for own in [uav == system]
    }


def _scenario_of(run: Path) -> Scenario | None:
    """Return what was flown; None of an earlier version, which did not store it."""
    try:
        return read_scenario(run / SCENARIO)
    except ConfigError:
        return None


def _parameters(scenario: Scenario | None, system: int) -> dict[str, int | float]:
    """Return the parameters of a UAV at its start, as it has them over MAVLink."""
    if scenario is None:
        return {}
    from ftc_autopilot.hot.hot_state import HotState
    from ftc_autopilot.hot.state import new_autopilots
    from ftc_autopilot.vehicle.param_table import parameters_of
    from mavlink_defs.services.param_server import INT32

    config = scenario.autopilot_config(system)
    autopilots = new_autopilots([config], binds=False)
    found = parameters_of(config, HotState(autopilots), autopilots.controllers)
    return {one.name: int(one.get()) if one.type == INT32 else float(one.get()) for one in found}


def _texts(run: Path, scenario: Scenario | None, system: int) -> list[_Timed]:
    """Return what happened to a UAV: its faults, what its diagnosis decided, what it lost."""
    found: list[tuple[float, Level, str]] = []
    for uav, fault in () if scenario is None else scenario.fault_commands():
        if uav == system:
            begin = 0.0 if np.isnan(fault.start_s) else fault.start_s
            found.append((begin, Level.WARNING, f"fault: {fault.describe()}"))
            if np.isfinite(fault.end_s):
                found.append((fault.end_s, Level.INFO, f"fault of {fault.whose} over"))
    end_s = np.inf
    with contextlib.suppress(BadInput):  # of a flight that was interrupted
        summary = read_summary(run)
        end_s = summary.duration_s
        own = summary.uav(system)
        found += [] if own is None else _of_summary(own)
        if summary.loss is not None:
            found.append((end_s, Level.ERROR, summary.loss))
    return [
        (round(at * 1e6), text_message(round(at * 1e6), level, text))
        for at, level, text in found
        if at <= end_s
    ]


def _of_summary(uav: UavSummary) -> Sequence[tuple[float, Level, str]]:
    found = []
    for one in uav.diagnosis:
        is_lost = one.phase == "lost"
        text = f"diagnosis: {one.actuator} {'lost' if is_lost else 'back in service'}"
        found.append((one.time_s, Level.WARNING if is_lost else Level.INFO, text))
    for name, at in (
        ("attitude lost: roll or pitch is more than 90° off", uav.attitude_lost_at_s),
        ("heading lost: yaw is more than 90° off", uav.heading_lost_at_s),
        ("the law gave a command that is not finite", uav.control_failed_at_s),
    ):
        if at is not None:
            found.append((at, Level.ERROR, name))
    return found
