"""The parameters of a vehicle, made from the models of its configuration.

A field's name in capitals is the parameter's name; unit and range are those that the field
declares. A field without an upper bound gets one for its parameter: `SPAN` times the largest number
of its default. Setting a parameter changes the record that compiled code reads, between two steps.
A scheduled value is read as of now; setting it makes it constant.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, get_args, get_origin

import numpy as np
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ftc_autopilot.common.records import in_si, record_dtype
from ftc_autopilot.common.schedule import Schedule
from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controller import number_of
from ftc_autopilot.control.controllers import NOT_STARTED, Controllers
from ftc_autopilot.control.laws import own_parameters
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.laws.surviving.gains import LoopWeights
from ftc_autopilot.control.triggers import MODES, PLUGIN_MODE, TRIGGERS, trigger_of
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.control.triggers.plugin import own_record
from ftc_autopilot.guidance.fence_parameters import (
    ACTION_NUMBERS,
    ActionName,
    FenceParameters,
    FenceRecords,
    RallyParameters,
    fence_records,
)
from ftc_autopilot.guidance.formation import FormationParameters
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.plugins.models import PLUGIN, owned
from mavlink_defs import dialect
from mavlink_defs.config.quantity import Quantity, describe
from mavlink_defs.services.param import MAX_NAME
from mavlink_defs.services.param_server import INT32, REAL32, Parameter, ParamValueError

SPAN = 10.0
"""Largest value of a parameter whose field declares no upper bound, relative to its default."""

_ALWAYS = np.array([math.inf])
_AXES = ("ROLL", "PITCH", "YAW")
_SHORTER = {  # with an axis or a prefix, these would be too long
    "reference_bandwidth_rad_s": "REF_BANDWIDTH",
    "time_constant_s": "TIME_CONST",
    "rate_limit_deg_s": "RATE_LIMIT",
    "omega_d_limit_deg_s": "OMEGA_D_LIMIT",
    "integral_limit_deg": "INT_LIMIT",
    "trim_airspeed_m_s": "TRIM_AIRSPEED",
    "diagnosis": "DIAG",
    "throttle": "THR",
    "fallback_threshold": "FALLBACK_THRESH",
    "fallback_error_deg": "FALLBACK_ERR_DEG",
    "event_rate_cooldown_s": "EVENT_COOLDOWN_S",
    "speed_limit_m_s": "SPEED_LIMIT",
    "slot_speed_m_s": "SLOT_SPEED",
    "separation_rate": "SEPAR_RATE",
    "degraded_below": "DEGRADED",
    "leave_ahead_m": "LEAVE_AHEAD",
    "leave_right_m": "LEAVE_RIGHT",
    "cross_track_1_s": "XTRACK_P",
    "cross_track_lead_s": "XTRACK_LEAD",
    "cross_track_integral_1_s2": "XTRACK_I",
    "course_1_s": "COURSE_P",
    "bank_feedback": "BANK_P",
    "height_1_s": "HEIGHT_P",
    "height_integral_1_s2": "HEIGHT_I",
    "climb_feedback": "CLIMB_P",
    "rounding_s": "ROUNDING",
    "wind_time_s": "WIND_TIME",
    "alt_max_m": "ALT_MAX",
    "alt_min_m": "ALT_MIN",
    "radius_m": "RADIUS",
    "margin_m": "MARGIN",
    "ret_alt_m": "RET_ALT",
}
_AT_THE_START = {"phi_v0", "g_v0", "beta_v0", "phi_omega0", "beta_omega0"}
"""Fields that a law reads in its first step only."""
_BEFORE = set(LoopWeights.model_fields)
"""Fields that a law has read before: gains follow from them when the autopilot is made."""


@dataclass(frozen=True)
class Tunable:
    """One number of a model.

    Attributes:
        name: Of the parameter.
        field: Of the model.
        type: INT32 or REAL32.
        quantity: Unit, range, meaning.
        times: Last instant of each window of the number [s]; one that never ends if it is
            constant. Shape (windows,).
        cells: Where the number is in a record, in each window, shape (windows, copies).
        factor: The number in the record is the value times this.
    """

    name: str
    field: str
    type: int
    quantity: Quantity
    times: np.ndarray
    cells: np.ndarray
    factor: float

    def at(self, t: float) -> float:
        """Return the value at time t [s]."""
        cell = float(self.cells[np.argmax(self.times >= t), 0])
        # 15 digits are the value's that was put, without the rounding of the conversion
        return cell if self.factor == 1.0 else float(f"{cell / self.factor:.15g}")

    def put(self, value: float) -> None:
        """Put a value in force, in all windows.

        Raises:
            ParamValueError: It is out of range.
        """
        q = self.quantity
        low = (q.gt is None or value > q.gt) and (q.ge is None or value >= q.ge)
        high = (q.lt is None or value < q.lt) and (q.le is None or value <= q.le)
        if not (low and high):
            expected = q.range() if q.range()[0] in "<>" else f"in {q.range()}"
            raise ParamValueError(f"is {value:g}, must be {expected}")
        self.cells[:] = value * self.factor


def _tunables_of(config: AutopilotConfig, controllers: Controllers) -> list[Tunable]:
    records, law = controllers.uavs["parameters"], type(config.controller)
    guidance = config.guidance.kind  # its gains; limits belong to the path, which is made once
    guidance_law, gains = type(config.guidance), records["guidance"]
    own = owned(gains[PLUGIN], record_dtype(guidance_law, GuidanceParameters))
    gains = gains[guidance] if guidance in GUIDANCE_LAWS else own
    found = [
        *trigger_tunables(records),
        *trigger_tunables(records, config.trigger.mode),
        *tunables(LawParameters, records["common"]),
        *law_tunables(law, own_parameters(records, law, config.controller.kind)),
        *tunables(guidance_law, gains, "GUID_", base=GuidanceParameters),
    ]
    if config.formation is not None:
        found += tunables(FormationParameters, records["formation"], "FORM_")
    return found


def _clock_s(hot: HotState, controllers: Controllers) -> float:
    """Return the time since the start of the profile or mission [s]; 0 before."""
    start = int(controllers.uavs[0]["guidance"]["start_step"])
    return 0.0 if start == NOT_STARTED else max(hot.step - start, 0) * hot.step_us / 1e6


def _put_at_the_start(controllers: Controllers, tunable: Tunable, value: float) -> None:
    if controllers.uavs[0]["controller"]["steps"] > 0:
        raise ParamValueError("acts at the start only", dialect.MAV_PARAM_ERROR_READ_ONLY)
    tunable.put(value)


def _put_action(tunable: Tunable, value: float) -> None:
    if 0.0 <= value <= max(ACTION_NUMBERS) and value not in ACTION_NUMBERS:
        raise ParamValueError(f"is {value:g}, must be {tunable.quantity.doc}")
    tunable.put(value)


def parameters_of(
    config: AutopilotConfig,
    hot: HotState,
    controllers: Controllers,
    fence: FenceRecords | None = None,
) -> list[Parameter]:
    """Return all parameters of a vehicle: of trigger, law, guidance, formation, fence, identity.

    Args:
        config: Its configuration.
        hot: What the compiled loop knows.
        controllers: Of one UAV.
        fence: Parameters of fence and rally points; None: as configured.
    """
    kind = config.controller.kind
    fence = fence or fence_records(config.fence, config.rally)

    def put_mode(tunable: Tunable, value: float) -> None:
        mode = (*MODES, config.trigger.mode)[int(value)] if 0 <= value <= PLUGIN_MODE else ""
        if mode and not config.controller.goes_with(mode):
            raise ParamValueError(f"is {value:g}, which does not go with the law {kind}")
        tunable.put(value)
        controllers.uavs["controller"]["trigger"] = np.zeros(
            (), controllers.uavs["controller"].dtype["trigger"]
        )

    read_only = {
        "SYSID_THISMAV": config.id,
        "MAV_TYPE": dialect.MAV_TYPE_FIXED_WING,
        "MAV_AUTOPILOT": config.mav_autopilot,
        "STEP_US": config.step_us,
        "CTRL_LAW": number_of(kind),
    }
    parameters = [
        Parameter(name, INT32, partial(float, value)) for name, value in read_only.items()
    ]
    found = [*_tunables_of(config, controllers), *fence_tunables(fence)]
    for tunable in map(_with_own, _distinct(found, read_only)):
        put: Callable[[float], None] = tunable.put
        if tunable.name == "TRIG_MODE":
            put = partial(put_mode, tunable)
        elif tunable.name == "FENCE_ACTION":
            put = partial(_put_action, tunable)
        elif tunable.field in _AT_THE_START:
            put = partial(_put_at_the_start, controllers, tunable)
        get = partial(lambda tunable: tunable.at(_clock_s(hot, controllers)), tunable)
        is_fixed = tunable.field in _BEFORE
        parameters.append(Parameter(tunable.name, tunable.type, get, None if is_fixed else put))
    return parameters


def law_tunables(law: type[LawParameters], records: np.ndarray) -> Iterator[Tunable]:
    """Find the numbers of a law, its fallback's first; records as `law.record`, (1,)."""
    if law.FALLBACK is not None:
        yield from tunables(law, records["fallback"], base=LawParameters)
    yield from tunables(law, records, base=LawParameters)


def fence_tunables(records: FenceRecords) -> Iterator[Tunable]:
    """Find the numbers of fence and rally points."""
    for tunable in tunables(FenceParameters, records.fence, "FENCE_"):
        if tunable.field != "action":
            yield tunable
            continue
        pairs = zip(ACTION_NUMBERS, get_args(ActionName), strict=True)
        doc = ", ".join(f"{number} {name}" for number, name in pairs)
        yield replace(tunable, quantity=Quantity("", None, 0, None, max(ACTION_NUMBERS), doc))
    yield from tunables(RallyParameters, records.rally, "RALLY_")


def trigger_tunables(records: np.ndarray, mode: str | None = None) -> Iterator[Tunable]:
    """Find the numbers of the triggers.

    Args:
        records: One record of `ftc_autopilot.control.controller.PARAMETERS`, shape (1,).
        mode: Of the trigger, for what it has beyond the others; None for what all have.
    """
    record, prefix = records["trigger"], "TRIG_"
    if mode is None:
        doc = ", ".join(f"{i} {each}" for i, each in enumerate(MODES))
        own = int(records["mode"][0])
        doc += f", {PLUGIN_MODE} a plug-in" if own == PLUGIN_MODE else ""
        quantity = Quantity("", None, 0, None, max(len(MODES) - 1, own), doc)
        cells = records["mode"].reshape(1, 1)
        yield Tunable(f"{prefix}MODE", "mode", INT32, quantity, _ALWAYS, cells, 1.0)
        yield from tunables(TriggerParameters, record, prefix)
    elif mode not in MODES:
        trigger = trigger_of(mode)
        own = owned(record[PLUGIN], own_record(trigger))
        yield from tunables(trigger, own, prefix, base=TriggerParameters)
    elif mode in (record.dtype.names or ()):
        yield from tunables(TRIGGERS[mode], record[mode], prefix, base=TriggerParameters)


def tunables(
    model: type[BaseModel], records: np.ndarray, prefix: str = "", base: type[BaseModel] = BaseModel
) -> Iterator[Tunable]:
    """Find the numbers that a model has beyond a base class.

    Args:
        model: The model.
        records: One record of `ftc_autopilot.common.records.record_dtype`, shape (1,).
        prefix: Of the parameters' names.
        base: The base class.
    """
    for field, info in model.model_fields.items():
        in_record, factor = in_si(field)
        if field in base.model_fields or in_record not in (records.dtype.names or ()):
            continue
        annotation, places = info.annotation, records[in_record]
        name = prefix + _SHORTER.get(field, field.upper())
        if isinstance(annotation, type) and issubclass(annotation, Schedule):
            (annotation,) = annotation.__pydantic_generic_metadata__["args"]
            times, places = places[0, :, 0], places[0, :, 1:]
        elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield from tunables(annotation, places, f"{name}_")
            continue
        else:
            times, places = _ALWAYS, places.reshape(1, -1)
        parts = get_args(annotation) if get_origin(annotation) is tuple else ()
        for column, (part, axis) in enumerate(zip(parts, _axes(len(parts)), strict=True)):
            cells = places[:, column : column + 1]
            quantity = _bounded(_quantity(part, info), info.default)
            yield Tunable(_cut(name, axis), field, REAL32, quantity, times, cells, factor)
        if not parts:
            whole = annotation in {int, bool} or get_origin(annotation) is Literal
            quantity = _bounded(_quantity(annotation, info), info.default)
            type_ = INT32 if whole else REAL32
            yield Tunable(_cut(name), field, type_, quantity, times, places, factor)


def _quantity(annotation: Any, info: FieldInfo) -> Quantity:
    """Return the declaration of a number, or of the field that it belongs to."""
    if get_origin(annotation) is Literal:
        choices = get_args(annotation)
        doc = ", ".join(f"{i} {choice}" for i, choice in enumerate(choices))
        return Quantity("", None, 0, None, len(choices) - 1, doc)
    if annotation is bool:
        return Quantity("", None, 0, None, 1, info.description or "")
    for declared in (*getattr(annotation, "__metadata__", ()), info):
        if isinstance(declared, FieldInfo) and (quantity := describe(declared)) is not None:
            return quantity
    return Quantity("", None, None, None, None, info.description or "")


def _bounded(quantity: Quantity, default: Any) -> Quantity:
    """Return a declaration with an upper bound, by the default if it has none and that is not 0."""
    largest = max(map(abs, _numbers(default)), default=0.0)
    if largest == 0.0 or quantity.le is not None or quantity.lt is not None:
        return quantity
    return replace(quantity, le=float(f"{SPAN * largest:.12g}"))


def _with_own(tunable: Tunable) -> Tunable:
    """Return a number whose range holds the vehicle's own value: a scenario may put it higher."""
    own = float(tunable.cells[np.isfinite(tunable.cells)].max(initial=0.0)) / tunable.factor
    if tunable.quantity.le is None or own <= tunable.quantity.le:
        return tunable
    return replace(tunable, quantity=replace(tunable.quantity, le=float(f"{own:.12g}")))


def _numbers(default: Any) -> Iterator[float]:
    """Yield the numbers of a default: one, one for each axis, or of each window of a schedule."""
    if isinstance(default, list | tuple):
        for part in default:
            yield from _numbers(part["value"] if isinstance(part, dict) else part)
    elif isinstance(default, int | float):
        yield float(default)


def _axes(n: int) -> tuple[str, ...]:
    return _AXES if n == len(_AXES) else tuple(str(i + 1) for i in range(n))


def _cut(name: str, axis: str = "") -> str:
    """Return a name that fits, with its axis; the longest word is shortened."""
    end = f"_{axis}" if axis else ""
    parts = name.split("_")
    while len("_".join(parts)) + len(end) > MAX_NAME:
        longest = max(range(len(parts)), key=lambda i: len(parts[i]))
        parts[longest] = parts[longest][:-1]
    return "_".join(parts) + end


def _distinct(found: Iterable[Tunable], taken: Iterable[str]) -> Iterator[Tunable]:
    """Append numbers to names that several parameters share."""
    names = set(taken)
    for tunable in found:
        name, number = tunable.name, 2
        while name in names:
            name, number = _cut(tunable.name, str(number)), number + 1
        names.add(name)
        yield replace(tunable, name=name)
