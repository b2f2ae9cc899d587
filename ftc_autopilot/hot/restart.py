"""The state of an autopilot in files, from which another process of the same one goes on."""

from pathlib import Path

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controller import CONTROLLER, PARAMETERS
from ftc_autopilot.control.controllers import UAV, bind_plugins
from ftc_autopilot.control.laws import PLUGIN_LAW
from ftc_autopilot.guidance.path import PATH
from ftc_autopilot.hot.checkpoint import map_array, open_checkpoint, restore
from ftc_autopilot.hot.formation_link import join_neighbours
from ftc_autopilot.hot.link import RECORD
from ftc_autopilot.hot.navigation import ESTIMATED, with_shared_history
from ftc_autopilot.hot.state import AUTOPILOT, Autopilots
from ftc_autopilot.hot.state_age import forget_age
from ftc_autopilot.plugins.models import PLUGIN

_AWAY_S = 1.0
"""Lockstep: time that passes without control after a restart [s, simulated]."""


def with_checkpoint(
    autopilot: Autopilots, config: AutopilotConfig, path: Path, identity: str | None = None
) -> tuple[Autopilots, bool]:
    """Restore the state from a file, path and signals beside it, and keep it there from now on.

    In lockstep, control begins again when a fixed simulated time has passed, so that the flight
    is the same however long the restart took; in real time, with the next state.

    Args:
        autopilot: A single one, restored in place.
        config: Of the autopilot; a file of another one is cleared.
        path: The checkpoint.
        identity: Of `identity_of`, if that was made before.

    Returns:
        The autopilot to fly with, and whether the file held a state.

    Raises:
        OSError: A file cannot be made; it is named.
    """
    own, edges = autopilot.own, autopilot.edges[0]
    identity = identity or identity_of(config)
    checkpoint = open_checkpoint(path, saved_parts(own[0]), edges, identity)
    resumes = restore(checkpoint, own, edges)
    bind_plugins(autopilot.controllers, [config])
    join_neighbours(edges, config.neighbours)  # nothing was heard yet
    paths = map_array(path.with_suffix(".path"), PATH, 1)  # large, and seldom changed
    if not resumes:
        paths["count"] = 0
    record = map_array(path.with_suffix(".record"), RECORD, autopilot.record.size)
    estimates = map_array(path.with_suffix(".estimates"), np.dtype("f8"), autopilot.estimates.size)
    estimated = own[0]["navigation"]["count"] > 0
    histories = with_shared_history(
        autopilot.histories, path.with_suffix(".history"), bool(estimated), resumes
    )
    if resumes:
        state = own["link"]
        state["heard_s"] = 0.0
        state["due"] = 0
        forget_age(state)  # reported with the restart
        state["away"] = round(_AWAY_S * 1e6 / config.step_us)
    restored = autopilot._replace(
        checkpoint=checkpoint,
        paths=paths,
        record=record.reshape(1, -1),
        estimates=estimates.reshape(1, -1, ESTIMATED),
        histories=histories,
    )
    return restored, resumes


def identity_of(config: AutopilotConfig) -> str:
    """Return the text by which a checkpoint is known to be of a configuration and of this code."""
    return f"{AUTOPILOT} {config.model_dump_json()}"


def saved_parts(own: np.void) -> np.ndarray:
    """Return first byte and end of each part of an autopilot that is saved, shape (parts, 2).

    The areas of a plug-in's law, a third of all, are left out if there is none; what an estimate
    is made of, if the state is not estimated.

    Args:
        own: Record of dtype `AUTOPILOT`.
    """
    uav = _begin(AUTOPILOT, "uav")
    controller, parameters = _begin(UAV, "controller"), _begin(UAV, "parameters")
    parts = [
        (_begin(AUTOPILOT, "link"), _begin(AUTOPILOT, "measured")),
        (_begin(AUTOPILOT, "vehicle"), uav),
        (uav + _begin(UAV, "profile"), uav + controller),
        (uav + controller, uav + UAV.itemsize),
    ]
    if int(own["uav"]["parameters"]["law"]) != PLUGIN_LAW:
        parts[2] = parts[2][0], uav + parameters + _begin(PARAMETERS, PLUGIN)
        parts[3] = parts[3][0], uav + controller + _begin(CONTROLLER, PLUGIN)
    if own["navigation"]["count"] > 0:
        parts[0] = parts[0][0], uav
        del parts[1]
    return np.array(parts)


def _begin(dtype: np.dtype, name: str) -> int:
    """Return the offset of a field [bytes]."""
    return int(dict(dtype.fields or {})[name][1])
