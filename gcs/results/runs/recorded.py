"""Figures of a flight without a summary, such as a fleet of `gcs up`, from its recording."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.store import EVENTS, TRAJECTORY, batches, is_complete
from mavlink_defs.capture.saving import saving
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.faults.kinds import FaultLimits


def figures_so_far(folder: Path) -> dict[str, Any]:
    """Return what a recording says of a flight, as attributes of `Run`.

    They are of the steps that both of its files have: of an endless flight since they began again,
    of one that goes on or was killed as far as they were written. The saving is against a sender of
    every channel in every step at which the autopilot had a state, whose share the recorded steps
    give.
    """
    facts: dict[str, Any] = {}
    try:
        events = _Events(folder / EVENTS)
        facts |= {"events": len(events.step)}
        if len(events.step):
            facts["duration_s"] = float(events.time_s[-1])
        steps = _Steps(folder / TRAJECTORY)
    except (BadInput, KeyError):
        return facts  # no recording, or no full one
    if steps.last < steps.first:
        return facts
    facts["duration_s"] = steps.end_s
    last = steps.last
    if not is_complete(folder / EVENTS):
        last = min(last, int(events.step.max(initial=-1)))
    inside = (events.step >= steps.first) & (events.step <= last)
    sent = int(inside.sum())
    messages = np.unique(np.stack([events.step, events.uav])[:, inside], axis=1)
    share = saving(sent, round(steps.channel_share * max(last - steps.first + 1, 0)), channels=1)
    return {**facts, "events": sent, "messages": messages.shape[1], "saving": share}


class _Events:
    """Events of a recording: step, system id and time [s] of each, in order."""

    def __init__(self, path: Path) -> None:
        columns: dict[str, list[np.ndarray]] = {"step": [], "uav": [], "time_s": []}
        for batch in batches(path):
            for name, parts in columns.items():
                parts.append(batch.column(name).to_numpy())
        self.step, self.uav, self.time_s = (
            np.concatenate(parts) if parts else np.empty(0, np.int64) for parts in columns.values()
        )


class _Steps:
    """Steps of a recorded trajectory.

    Attributes:
        first: The first one recorded.
        last: The last one; before `first` if there is none.
        end_s: Its time [s].
        channel_share: Channels of all UAVs, each counted by the share of recorded steps at which
            its autopilot had a state.
    """

    def __init__(self, path: Path) -> None:
        self.first, self.last, self.end_s, self.channel_share = 0, -1, 0.0, 0.0
        rows, heard = 0, 0.0
        for batch in batches(path):
            metadata = batch.schema.metadata
            step_us = int(metadata[b"step_us"])
            channels = _channels(metadata[b"limits"])
            time_s = batch.column("time_s").to_numpy()
            if not rows:
                self.first = round(time_s[0] * 1e6 / step_us)
            self.end_s = float(time_s[-1])
            self.last = round(self.end_s * 1e6 / step_us)
            rows += len(batch)
            known = np.isfinite(batch.column("V").to_numpy())
            uavs = batch.column("uav").to_numpy()
            heard += sum(float(known[uavs == uav].sum()) * n for uav, n in channels.items())
            self.channel_share = heard * len(channels) / rows


def _channels(limits: bytes) -> dict[int, int]:
    """Return the number of channels of each UAV from a recording's metadata."""
    return {
        int(uav): sum(map(FaultLimits(**of).has, ACTUATORS))
        for uav, of in json.loads(limits).items()
    }
