"""The state of an autopilot in files, from which another process of the same one goes on."""

from pathlib import Path

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controller import CONTROLLER, PARAMETERS
from ftc_autopilot.control.controllers import Controllers, bind_plugins
from ftc_autopilot.guidance.path import PATH
from ftc_autopilot.hot.checkpoint import map_array, open_checkpoint, restore
from ftc_autopilot.hot.link import RECORD, AutopilotLink, checkpoint_records
from ftc_autopilot.hot.navigation import ESTIMATED, with_shared_history
from ftc_autopilot.hot.state_age import forget_age

_AWAY_S = 1.0
"""Lockstep: time that passes without control after a restart [s, simulated]."""


def with_checkpoint(
    link: AutopilotLink,
    controllers: Controllers,
    vehicle: np.ndarray,
    config: AutopilotConfig,
    path: Path,
) -> tuple[AutopilotLink, Controllers, bool]:
    """Restore the state from a file, path and signals beside it, and keep it there from now on.

    In lockstep, control begins again when a fixed simulated time has passed, so that the flight
    is the same however long the restart took; in real time, with the next state.

    Args:
        link: Its records are restored in place.
        controllers: Of one UAV; restored in place.
        vehicle: One record of dtype `ftc_autopilot.hot.checkpoint.VEHICLE`; restored in place.
        config: Of the autopilot; a file of another one is cleared.
        path: The checkpoint.

    Returns:
        Link and controllers to fly with, and whether the file held a state.

    Raises:
        OSError: A file cannot be made; it is named.
    """
    records = checkpoint_records(link, controllers, vehicle)
    described = f"{PARAMETERS} {CONTROLLER} {config.model_dump_json()}"
    checkpoint = open_checkpoint(path, records, described)
    resumes = restore(checkpoint)
    bind_plugins(controllers, [config])
    paths = map_array(path.with_suffix(".path"), PATH, 1)  # large, and seldom changed
    if not resumes:
        paths[:] = np.zeros((), PATH)
    record = map_array(path.with_suffix(".record"), RECORD, len(link.record))
    rows = len(link.estimates) * ESTIMATED
    estimates = map_array(path.with_suffix(".estimates"), np.dtype("f8"), rows)
    link = link._replace(
        checkpoint=checkpoint,
        record=record,
        estimates=estimates.reshape(-1, ESTIMATED),
        navigation=with_shared_history(link.navigation, path.with_suffix(".history"), resumes),
    )
    if resumes:
        state = link.state[0]
        state["heard_s"] = 0.0
        state["due"] = 0
        forget_age(state)  # reported with the restart
        state["away"] = round(_AWAY_S * 1e6 / config.step_us)
    return link, controllers._replace(paths=paths), resumes
