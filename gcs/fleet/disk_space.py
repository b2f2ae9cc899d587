"""The disk space that a flight takes, estimated before it begins: all files of its run folder."""

import shutil
from pathlib import Path

from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.hot.recorder import RECORD_ROWS
from ftc_autopilot.vehicle.telemetry import DEFAULT_INTERVALS_US
from gcs.console.errors import BadInput
from gcs.results.choices import Record
from gcs.results.recorder import trajectory_bytes
from gcs.scenario.model import Scenario
from gcs.station.telemetry import REQUESTED_S
from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS

_PIECES = 4
"""Pieces of the processes' recordings that wait on disk to be put together."""
_PLANT_ROW = 8 * (12 + 3 + 4)  # state, wind, applied commands
_EVENT_ROW = 27  # of events.arrows, before compression
_NPZ_EVENT_ROW = 40
_TRIGGERED_SHARE = 0.25
"""Share of the control periods in which a channel sends, if not by the clock; few come near."""
_FIGURES = 3_000_000  # they are drawn of a flight that is thinned out
_OF_UAV = 50_000  # configuration, log, its share of summary.json and figures
_CHECKPOINT_OF_UAV = 200_000  # what a restarted autopilot restores, its record apart
_FRAME = 8 + 12 + 13  # around a payload in a tlog: time stamp, header and checksum, signature


def folder_bytes(
    scenario: Scenario, record: Record, *, over_udp: bool = True, restart: bool = False
) -> int:
    """Return about the most that the run folder of a whole flight takes at any time [bytes].

    Args:
        scenario: What is flown.
        record: How much is kept of the steps.
        over_udp: With processes, which record and log for themselves; not with ``--in-process``.
        restart: Autopilots that fail resume from their checkpoints.
    """
    n, steps = len(scenario.uavs), scenario.steps
    size = trajectory_bytes(scenario, record) + _FIGURES + n * _OF_UAV
    if record is not Record.NONE:
        share = 1.0 if scenario.trigger.mode == "periodic" else _TRIGGERED_SHARE
        row = _NPZ_EVENT_ROW if record is Record.NPZ else _EVENT_ROW
        size += round(steps * n * len(ACTUATORS) * share * row)
    if over_udp:
        pieces = min(steps, _PIECES * RECORD_ROWS)
        size += pieces * n * (SIGNALS.itemsize + _PLANT_ROW)
        size += round(scenario.duration_s * n * _telemetry_bytes_s())
    if restart:
        size += n * (RECORD_ROWS * SIGNALS.itemsize + _CHECKPOINT_OF_UAV)
    return size


def check_space(
    folder: Path,
    scenario: Scenario,
    record: Record,
    *,
    over_udp: bool = True,
    restart: bool = False,
) -> None:
    """Refuse a flight whose files do not fit; arguments as of `folder_bytes`.

    Raises:
        BadInput: There is not enough space on disk.
    """
    needed = folder_bytes(scenario, record, over_udp=over_udp, restart=restart)
    if needed > (free := shutil.disk_usage(folder).free):
        of_it = _size(trajectory_bytes(scenario, record))
        raise BadInput(
            f"the flight needs about {_size(needed)} on disk, {of_it} of it for the trajectory "
            f"(--record {record}); {folder} has {_size(free)} left",
            "choose --record light or none, or another folder with --out",
        )


def _telemetry_bytes_s() -> float:
    """Return what the messages of one UAV take in `flight.tlog` [bytes/s]."""
    intervals_s = {id_: us / 1e6 for id_, us in DEFAULT_INTERVALS_US.items()} | REQUESTED_S
    sizes = {id_: dialect.mavlink_map[id_].unpacker.size + _FRAME for id_ in intervals_s}
    return sum(sizes[id_] / interval for id_, interval in intervals_s.items() if interval > 0.0)


def _size(count: int) -> str:
    """Return a number of bytes as a text."""
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"
