"""Tables of keys and parameters, from the models that check them.

What a key takes, its unit, default and meaning are read from the fields of the models.
"""

import types
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from ftc_autopilot.common.schedule import Schedule
from ftc_autopilot.control.controller import PARAMETERS
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.estimation.parameters import EstimatorParameters
from ftc_autopilot.guidance.failsafe_parameters import FailsafeParameters
from ftc_autopilot.guidance.fence_parameters import (
    FenceParameters,
    RallyParameters,
    fence_records,
)
from ftc_autopilot.guidance.formation import Formation, FormationParameters, Slot
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_autopilot.guidance.runway import RunwayParameters
from ftc_autopilot.kinds import ArduPlaneAutopilot, Px4Autopilot
from ftc_autopilot.vehicle.param_table import (
    fence_tunables,
    law_tunables,
    trigger_tunables,
    tunables,
)
from ftc_lab.campaigns import distributions
from ftc_lab.campaigns.faults import DrawnFault, DrawnSensorFault
from ftc_lab.campaigns.model import Campaign, Factor, Kept
from gcs.scenario.fence import FenceSection, RallySection
from gcs.scenario.mission import MissionSection
from gcs.scenario.model import Scenario
from gcs.scenario.sections import (
    Links,
    Network,
    ProfileSegment,
    ScenarioFault,
    ScenarioSensorFault,
    ScenarioUav,
)
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import Quantity, describe
from mavlink_defs.config.renamed import SECTIONS as RENAMED
from scripts.docs_table import table
from sitl_plant.actuators.config import EngineServo, Servos, SurfaceServo
from sitl_plant.air.config import Disturbance, Dryden, Sinusoid, Wind
from sitl_plant.airframe.config import Aircraft, Uncertainty
from sitl_plant.airframe.gear import Gear, Ground, Runway
from sitl_plant.airframe.propulsion import Propulsion
from sitl_plant.foreign.ardupilot.config import ArduPilot
from sitl_plant.foreign.px4.config import ServoOutput
from sitl_plant.sensing.config import (
    Accelerometer,
    Barometer,
    Gnss,
    Gyro,
    Magnetometer,
    NavigationSensors,
    Pitot,
    Sensor,
    Sensors,
)
from sitl_plant.simulators.config import JsbSimPlant, PluginPlant

REFERENCE = Path(__file__).parents[1] / "docs" / "reference"
SECTIONS: dict[str, type[BaseModel]] = {
    "scenario": Scenario,
    "aircraft": Aircraft,
    "propulsion": Propulsion,
    "gear": Gear,
    "ground": Ground,
    "runway": Runway,
    "jsbsim": JsbSimPlant,
    "plugin": PluginPlant,
    "uncertainty": Uncertainty,
    "disturbance": Disturbance,
    "sinusoid": Sinusoid,
    "wind": Wind,
    "turbulence": Dryden,
    "servos": Servos,
    "surface_servo": SurfaceServo,
    "engine_servo": EngineServo,
    "sensors": Sensors,
    "sensor": Sensor,
    "navigation_sensors": NavigationSensors,
    "gyro": Gyro,
    "accelerometer": Accelerometer,
    "magnetometer": Magnetometer,
    "barometer": Barometer,
    "pitot": Pitot,
    "gnss": Gnss,
    "estimator": EstimatorParameters,
    "controller": LawParameters,
    **LAWS,
    "trigger": TriggerParameters,
    **TRIGGERS,
    "uavs": ScenarioUav,
    "network": Network,
    "guidance": PathFollowing,
    "runway_guidance": RunwayParameters,
    "failsafe": FailsafeParameters,
    "formation": Formation,
    "slot": Slot,
    "profile": ProfileSegment,
    "mission": MissionSection,
    "fence": FenceSection,
    "rally": RallySection,
    "faults": ScenarioFault,
    "sensor_faults": ScenarioSensorFault,
    "links": Links,
    "impairment": Impairment,
    "arduplane": ArduPlaneAutopilot,
    "outputs": ArduPilot,
    "px4": Px4Autopilot,
    "servo_output": ServoOutput,
    "campaign": Campaign,
    "factor": Factor,
    "drawn_fault": DrawnFault,
    "drawn_sensor_fault": DrawnSensorFault,
    "keep": Kept,
    "uniform": distributions.Uniform,
    "log_uniform": distributions.LogUniform,
    "normal": distributions.Normal,
    "truncated_normal": distributions.TruncatedNormal,
    "choice": distributions.Choice,
}
OWN_TABLES = {model: name for name, model in SECTIONS.items()}
"""Models with a table of their own, which the one line in the table of another model links to."""


def keys(section: str) -> str:
    """Return the table of the keys of one section of a scenario or a campaign."""
    model = SECTIONS[section]
    before: type[BaseModel] = BaseModel  # whose keys another table has
    if section in LAWS:
        before = LAWS[section].FALLBACK or LawParameters
    elif section in TRIGGERS:
        before = TriggerParameters
    rows = ((f"`{key}`", *rest) for key, *rest in key_rows(model) if key not in before.model_fields)
    head = ("key", "expected", "default", "meaning")
    return f'<a id="keys-{section}"></a>\n\n' + table(head, rows)


def renamed() -> str:
    """Return the table of the keys and parameters that have names of before."""
    rows = (
        (f"`{section}.{one.before}`", *map("`{}`".format, one[1:]))
        for section, found in RENAMED.items()
        for one in found
    )
    return table(("key before", "now", "parameter before", "now"), rows)


def page_of(section: str) -> str:
    """Return the page of the reference that has the table of a section."""
    mark = f"<!-- generated: keys {section} -->"
    pages = sorted(REFERENCE.glob("*.md"))
    return next(path.name for path in pages if mark in path.read_text())


def key_rows(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, str, str, str]]:
    """Yield key, expected values, default and meaning of each key, including the keys of parts."""
    for name, field in model.model_fields.items():
        key, part = prefix + name, part_of(field.annotation)
        if part is None or part in OWN_TABLES:
            yield key, expected(field.annotation, field), default_of(field), meaning(field, part)
        else:
            listed = get_origin(without_none(field.annotation)) is tuple
            if not field.is_required() and field.default in {None, ()}:
                yield key, "list" if listed else "mapping", "none", meaning(field, part)
            yield from key_rows(part, f"{key}[]." if listed else f"{key}.")


def part_of(annotation: Any) -> type[BaseModel] | None:
    """Return the model that a key holds, alone or in a list; None if it holds something else."""
    annotation = without_none(annotation)
    if get_origin(annotation) is tuple:
        annotation = get_args(annotation)[0]
    is_model = isinstance(annotation, type) and issubclass(annotation, Model)
    return annotation if is_model else None


def without_none(annotation: Any) -> Any:
    """Return X of ``X | None``."""
    if get_origin(annotation) in {Union, types.UnionType}:
        parts = [part for part in get_args(annotation) if part is not type(None)]
        return parts[0] if len(parts) == 1 else annotation
    return annotation


def expected(annotation: Any, field: FieldInfo | None = None) -> str:
    """Return what a key takes, as a text: range and unit, choices, or kind."""
    annotation = without_none(annotation)
    if (quantity := quantity_of(annotation, field)) is not None:
        return range_of(quantity)
    if annotation is bool:
        return "`true` or `false`"
    origin, arguments = get_origin(annotation), get_args(annotation)
    if (value := scheduled_value(annotation)) is not None:
        return f"{expected(value)}; [schedule](#controller)"
    if origin is Literal:
        return ", ".join(f"`{choice}`" for choice in arguments)
    if origin is dict:
        return f"mapping of names to: {expected(arguments[1])}"
    if origin is tuple:
        count = "list of" if Ellipsis in arguments else f"list of {len(arguments)}, each"
        return f"{count} {expected(arguments[0])}"
    if origin in {Union, types.UnionType}:
        return "; or ".join(dict.fromkeys(expected(part) for part in arguments))
    if origin is Annotated:
        return expected(annotation.__origin__)
    if (part := part_of(annotation)) is not None:
        section = OWN_TABLES.get(part, "")
        section = "controller" if section in LAWS else "trigger" if section in TRIGGERS else section
        return f"[mapping]({page_of(section)}#keys-{section})" if section else "mapping"
    return _PLAIN.get(annotation, "text")


_PLAIN = {bool: "true or false", int: "number", float: "number", Any: "anything"}


def quantity_of(annotation: Any, field: FieldInfo | None = None) -> Quantity | None:
    """Return what a field, or an annotation itself, declares about its number."""
    declared = (field, *getattr(annotation, "__metadata__", ()))
    found = (describe(info) for info in declared if isinstance(info, FieldInfo))
    return next((quantity for quantity in found if quantity is not None), None)


def scheduled_value(annotation: Any) -> Any:
    """Return X of ``Schedule[X]``; None for anything else."""
    if isinstance(annotation, type) and issubclass(annotation, Schedule):
        return annotation.__pydantic_generic_metadata__["args"][0]
    return None


def range_of(quantity: Quantity) -> str:
    """Return range and unit of a number."""
    return quantity.range().replace(">=", "≥").replace("<=", "≤")


def default_of(field: FieldInfo) -> str:
    """Return a key's default as a text."""
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined:
        return "required"
    if isinstance(value, BaseModel):
        return "its defaults"
    if value == {} and field.validate_default:
        return "its law's"
    if value is None or value in ((), {}, ""):
        return "none"
    if isinstance(value, list) and isinstance(value[0], dict):
        windows = [f"{plain(window['value'])} to {window['until_s']:g} s" for window in value[:-1]]
        return ", ".join([*windows, f"then {plain(value[-1]['value'])}"])
    return plain(value)


def plain(value: Any) -> str:
    """Return a value as it is written in YAML."""
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(plain, value))}]"
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def meaning(field: FieldInfo, part: type[BaseModel] | None) -> str:
    """Return the description of a key: its own, else its model's."""
    if field.description or part is not None:
        return field.description or (part.__doc__ or "").split("\n")[0]
    value = without_none(field.annotation)
    value = scheduled_value(value) or value
    value = get_args(value)[0] if get_origin(value) is tuple else value
    quantity = quantity_of(value)
    return quantity.doc if quantity is not None else ""


def parameters() -> str:
    """Return the tables of the parameters: of triggers, laws, guidance, formation, fence."""
    records = np.zeros(1, PARAMETERS)
    groups = {"Every trigger": trigger_tunables(records)}
    for mode in TRIGGERS:
        groups[f"Trigger `{mode}`"] = trigger_tunables(records, mode)
    groups["Every law"] = tunables(LawParameters, records["common"])
    for kind, law in LAWS.items():
        groups[f"`{kind}`"] = law_tunables(law, records[kind])
    for kind, guidance in GUIDANCE_LAWS.items():
        gains = records["guidance"][kind]
        groups[f"Guidance `{kind}`"] = tunables(guidance, gains, "GUID_", GuidanceParameters)
    groups["Formation"] = tunables(FormationParameters, records["formation"], "FORM_")
    groups["Failsafe"] = tunables(FailsafeParameters, records["failsafe"], "COM_")
    fence = fence_records(FenceParameters(), RallyParameters())
    groups["Fence and rally points"] = fence_tunables(fence)
    own = {group: list(found) for group, found in groups.items()}
    head = ("parameter", "expected", "key", "meaning")
    return "\n\n".join(
        f"### {group}\n\n"
        + table(
            head,
            ((f"`{t.name}`", range_of(t.quantity), f"`{t.field}`", t.quantity.doc) for t in found),
        )
        for group, found in own.items()
        if found
    )
