"""Guidance laws that a scenario can choose by name.

A law is one file: a model of its parameters, with its `kind` and the `STATE` that it has between
updates, and three compiled functions. To register it, add the model to `Guidance` and
`GUIDANCE_LAWS`, and its functions to `guide`, `pace_of` and `intention_of`, each for its index in
`KINDS`, as the control laws are; the law that is left is `path`. The check of scenario files and
the records that compiled code sees follow. Laws of other packages and files have one branch in
common, `plugin`, behind `path`.
"""

from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Discriminator, SerializeAsAny, Tag

from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.common.tuples import Four, replaced
from ftc_autopilot.guidance.laws.base import GuidanceParameters, Intention, Pace, Situation
from ftc_autopilot.guidance.laws.path_following import (
    PathFollowing,
    path_intention,
    path_law,
    path_pace,
)
from ftc_autopilot.guidance.laws.plugin import (
    GUIDANCE,
    PLUGIN_PARAMETERS,
    PLUGIN_STATE,
    own_record,
    plugin_guidance,
)
from ftc_autopilot.plugins.loading import GUIDANCE_LAWS as GROUP
from ftc_autopilot.plugins.models import PLUGIN, PLUGIN_TAG, is_plugin, model_of, owned
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aircraft import AircraftRecord

GUIDANCE_LAWS: dict[str, type[GuidanceParameters]] = {"path": PathFollowing}
"""Our own laws by name."""
KINDS = tuple(GUIDANCE_LAWS)
PLUGIN_GUIDANCE = len(KINDS)
"""Number of a law that is a plug-in; ours have their index in `KINDS`."""


def _kind(value: Any) -> Any:
    own = getattr(value, "kind", "path")
    kind = value.get("kind", "path") if isinstance(value, dict) else own
    return PLUGIN_TAG if is_plugin(kind, GROUP, KINDS) else kind


def guidance_of(kind: str) -> type[GuidanceParameters]:
    """Return the parameters' class of a guidance law: one of ours, or a plug-in's.

    Raises:
        PluginError: The plug-in cannot be used.
    """
    return GUIDANCE_LAWS.get(kind) or GUIDANCE.load(kind)


Guidance: TypeAlias = Annotated[
    Annotated[PathFollowing, Tag("path")]
    | Annotated[
        SerializeAsAny[GuidanceParameters],
        BeforeValidator(model_of("kind", guidance_of)),
        Tag(PLUGIN_TAG),
    ],
    Discriminator(_kind),
]
"""The parameters of any guidance law, discriminated by `kind`."""

GUIDANCE_PARAMETERS = np.dtype(
    [
        ("law", "i8"),  # index in KINDS, or PLUGIN_GUIDANCE
        ("common", record_dtype(GuidanceParameters)),
        *((kind, record_dtype(law, GuidanceParameters)) for kind, law in GUIDANCE_LAWS.items()),
        (PLUGIN, PLUGIN_PARAMETERS),
    ]
)

GUIDANCE_STATE = np.dtype(
    [*((kind, law.STATE) for kind, law in GUIDANCE_LAWS.items()), (PLUGIN, PLUGIN_STATE)]
)


def guidance_record(guidance: Guidance) -> np.void:
    """Turn the parameters of a guidance law into a record of `GUIDANCE_PARAMETERS`."""
    record: np.void = np.zeros(1, GUIDANCE_PARAMETERS)[0]
    fill(record["common"], guidance)
    if guidance.kind in GUIDANCE_LAWS:
        record["law"] = KINDS.index(guidance.kind)
        fill(record[guidance.kind], guidance)
    else:
        record["law"] = PLUGIN_GUIDANCE
        fill(record["path"], PathFollowing())
        fill(record["path"], guidance)
        fill(owned(record[PLUGIN], own_record(type(guidance))), guidance)
    return record


@compiled
def guide(
    now: Situation, path: np.void, aircraft: AircraftRecord, parameters: np.void, state: np.void
) -> Four:
    """Evaluate the guidance law that a scenario has chosen, and advance its state.

    Args:
        now: The situation.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH` with at least one leg.
        aircraft: Nominal aircraft.
        parameters: Record of dtype `GUIDANCE_PARAMETERS`.
        state: Record of dtype `GUIDANCE_STATE`; the law's own part is updated in place.

    Returns:
        Airspeed [m/s], roll, pitch, yaw [rad].
    """
    limits = parameters["common"]
    command = path_law(now, path, aircraft, limits, parameters["path"], state["path"])
    if parameters["law"] == PLUGIN_GUIDANCE:
        now = replaced(now, "command", command)
        return plugin_guidance(now, path, aircraft, limits, parameters[PLUGIN], state[PLUGIN])
    return command


@compiled
def pace_of(
    now: Situation, path: np.void, ahead: float, parameters: np.void, state: np.void
) -> Pace:
    """Return how a UAV gets on along its path.

    Args:
        now: The situation.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH` with at least one leg.
        ahead: What its slot lies ahead of the formation [m].
        parameters: Record of dtype `GUIDANCE_PARAMETERS`.
        state: Record of dtype `GUIDANCE_STATE`.
    """
    return path_pace(now, path, ahead, state["path"])


@compiled
def intention_of(now: Situation, path: np.void, parameters: np.void, state: np.void) -> Intention:
    """Return the velocity that `guide` would ask for with the same arguments, nobody evaded."""
    return path_intention(now, path, parameters["path"], state["path"])
