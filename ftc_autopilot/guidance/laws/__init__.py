"""Guidance laws that a scenario can choose by name.

A law is one file: a model of its parameters, with its `kind` and the `STATE` that it has between
updates, and three compiled functions. To register it, add the model to `Guidance` and
`GUIDANCE_LAWS`, and its functions to `guide`, `pace_of` and `intention_of`, each for its index in
`KINDS`, as the control laws are; the law that is left is `path`. The check of scenario files and
the records that compiled code sees follow.
"""

from typing import TypeAlias

import numpy as np

from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.guidance.coordination import Coordination
from ftc_autopilot.guidance.laws.base import GuidanceParameters, Intention, Pace, Situation
from ftc_autopilot.guidance.laws.path_following import (
    PathFollowing,
    path_intention,
    path_law,
    path_pace,
)
from mavlink_defs.runtime.jit import compiled

Guidance: TypeAlias = PathFollowing
"""The parameters of any guidance law, discriminated by `kind`."""

GUIDANCE_LAWS: dict[str, type[GuidanceParameters]] = {"path": PathFollowing}
KINDS = tuple(GUIDANCE_LAWS)

GUIDANCE_PARAMETERS = np.dtype(
    [
        ("law", "i8"),  # index in KINDS
        ("common", record_dtype(GuidanceParameters)),
        *((kind, record_dtype(law, GuidanceParameters)) for kind, law in GUIDANCE_LAWS.items()),
    ]
)

GUIDANCE_STATE = np.dtype([(kind, law.STATE) for kind, law in GUIDANCE_LAWS.items()])


def guidance_record(guidance: Guidance) -> np.void:
    """Turn the parameters of a guidance law into a record of `GUIDANCE_PARAMETERS`."""
    record: np.void = np.zeros(1, GUIDANCE_PARAMETERS)[0]
    record["law"] = KINDS.index(guidance.kind)
    fill(record["common"], guidance)
    fill(record[guidance.kind], guidance)
    return record


@compiled
def guide(
    now: Situation,
    path: np.void,
    near: float,
    coordination: Coordination,
    aircraft: np.void,
    parameters: np.void,
    state: np.void,
    command: np.ndarray,
) -> float:
    """Evaluate the guidance law that a scenario has chosen, and advance its state.

    Args:
        now: The situation.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH` with at least one leg.
        near: Path parameter at the update before [m].
        coordination: Slot and corrections of the formation.
        aircraft: Nominal aircraft, dtype `sitl_plant.aircraft.AIRCRAFT`.
        parameters: Record of dtype `GUIDANCE_PARAMETERS`.
        state: Record of dtype `GUIDANCE_STATE`; the law's own part is updated in place.
        command: Airspeed [m/s], roll, pitch, yaw [rad], shape (4,), written.

    Returns:
        The path parameter [m].
    """
    limits = parameters["common"]
    return path_law(
        now, path, near, coordination, aircraft, limits, parameters["path"], state["path"], command
    )


@compiled
def pace_of(
    now: Situation,
    path: np.void,
    near: float,
    ahead: float,
    parameters: np.void,
    state: np.void,
) -> Pace:
    """Return how a UAV gets on along its path.

    Args:
        now: The situation.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH` with at least one leg.
        near: Path parameter at the update before [m].
        ahead: What its slot lies ahead of the formation [m].
        parameters: Record of dtype `GUIDANCE_PARAMETERS`.
        state: Record of dtype `GUIDANCE_STATE`.
    """
    return path_pace(now, path, near, ahead, state["path"])


@compiled
def intention_of(
    now: Situation,
    path: np.void,
    near: float,
    coordination: Coordination,
    parameters: np.void,
    state: np.void,
) -> Intention:
    """Return the velocity that `guide` would ask for with the same arguments, nobody evaded."""
    return path_intention(now, path, near, coordination, parameters["path"], state["path"])
