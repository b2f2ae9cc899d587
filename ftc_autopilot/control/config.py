"""Configuration of a controller: nominal aircraft, laws, triggers, place in the formation.

Names are the paper's, in ASCII; defaults are the values of Table III, or where the paper gives
none, a set that flies well with Table III to the letter. Angles inside the laws are rad.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Self, TypeAlias, cast

from pydantic import (
    AfterValidator,
    Field,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

from ftc_autopilot.control.laws import LAWS, Controller
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.triggers import MODES, Trigger
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.guidance.aircraft_limits import guidance_problems
from ftc_autopilot.guidance.failsafe_parameters import FailsafeParameters
from ftc_autopilot.guidance.formation import Formation
from ftc_autopilot.guidance.laws import Guidance
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_autopilot.guidance.runway import RunwayParameters
from ftc_autopilot.plugins.loading import TRIGGERS, calling, plugin_of
from ftc_autopilot.plugins.models import is_plugin
from mavlink_defs.config.models import HostPort, Loc, Model, Problems, SystemId, repeated
from mavlink_defs.config.quantity import quantity, whole
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.airframe.config import Aircraft


def _by_law(
    value: Any, read: ValidatorFunctionWrapHandler, info: ValidationInfo
) -> TriggerParameters:
    """Read a trigger; by the mode of the law before it, unless a mode is set."""
    law = info.data.get("controller")
    if law is None or not isinstance(value, dict) or "mode" in value:
        return cast("TriggerParameters", read(value))
    if law.TRIGGER not in MODES and not is_plugin(law.TRIGGER, TRIGGERS, MODES):
        text = f"expected TRIGGER of the law {law.kind!r} to be a plug-in or one of"
        text += f" {', '.join(MODES)}, got {law.TRIGGER!r}"
        raise ValueError(f"{text}; mend that class, or name a mode here")
    trigger: TriggerParameters = read({"mode": law.TRIGGER, **value})
    trigger.model_fields_set.discard("mode")  # another law may come, with its own
    return trigger


LawTrigger: TypeAlias = Annotated[Trigger, WrapValidator(_by_law)]
"""The parameters of a trigger, in a model after its `controller`."""


def trigger_problems(
    controller: Controller, trigger: Trigger, step_us: int
) -> Iterator[tuple[Loc, str]]:
    """Yield place and text if law, trigger and control period [µs] do not go together."""
    with calling(type(trigger), "misfits"):
        misfits = list(trigger.misfits(step_us))
    yield from ((("trigger", *loc), text) for loc, text in misfits)
    if type(controller).goes_with(trigger.mode):
        return
    if controller.SELECTS_CHANNELS:
        able = " or ".join(map(repr, sorted(filter(controller.goes_with, MODES))))
        text = f"expected {able}, as the law {controller.kind!r} chooses what is sent"
        yield ("trigger", "mode"), f"{text}, got {trigger.mode!r}"
    else:
        able = ", ".join(kind for kind, law in LAWS.items() if law.SELECTS_CHANNELS)
        text = f"{trigger.mode!r} needs a law that chooses what is sent ({able})"
        yield ("trigger", "mode"), f"{text}, got the law {controller.kind!r}"


def law_problems(controller: Controller, aircraft: Aircraft) -> Iterator[tuple[Loc, str]]:
    """Yield place and text if a law cannot fly a nominal aircraft."""
    with calling(type(controller), "misfits"):
        reasons = list(controller.misfits(aircraft))
    for reason in reasons:
        able = [kind for kind, law in LAWS.items() if not any(law(kind=kind).misfits(aircraft))]
        text = f"expected one of {', '.join(able)}, as {reason}"
        yield ("controller", "kind"), f"{text}; got {controller.kind!r}"
    if getattr(controller, "heading", "") == "rudder" and not aircraft.has("rudder"):
        text = "expected 'auto' or 'bank', as the aircraft has no rudder, got 'rudder'"
        yield ("controller", "heading"), text


def plugins_of(*models: Model) -> dict[str, str]:
    """Return the digest of the code of each plug-in whose parameters are given, by its name."""
    found = (plugin_of(type(model)) for model in models)
    return {plugin.name: plugin.digest for plugin in found if plugin is not None}


def plugin_problems(expected: Mapping[str, str], *models: Model) -> Iterator[tuple[Loc, str]]:
    """Yield place and text if the code of a plug-in is not the one that is expected."""
    for name, digest in plugins_of(*models).items():
        if (other := expected.get(name, digest)) != digest:
            text = f"expected code with digest {other}, it has {digest} now; "
            yield ("plugins", name), f"{text}without this entry the present code is flown"


class FormationTrigger(Model):
    """When an autopilot sends a neighbour message; the paper sends one in every period.

    It compares its tracking errors with what its neighbours extrapolate from its last message.

    Attributes:
        airspeed_m_s: Absolute threshold of the airspeed.
        airspeed_relative: Threshold relative to the airspeed's error.
        attitude_deg: Absolute threshold of roll, pitch and yaw.
        attitude_relative: Threshold relative to the angle's error.
        path_position_m: Threshold of the place on the path.
        position_m: Threshold of north, east and down, on a path.
        longest_silence_s: Time after which a message is sent in any case.
    """

    airspeed_m_s: float = quantity("m/s", default=0.02, ge=0.0)
    airspeed_relative: float = quantity("", default=0.01, ge=0.0, lt=1.0)
    attitude_deg: float = quantity("deg", default=0.05, ge=0.0)
    attitude_relative: float = quantity("", default=0.01, ge=0.0, lt=1.0)
    path_position_m: float = quantity("m", default=0.05, ge=0.0)
    position_m: float = quantity("m", default=0.5, ge=0.0)
    longest_silence_s: float = quantity("s", default=0.2, gt=0.0)

    @property
    def neighbour_timeout_s(self) -> float:
        """Silence after which a neighbour's edge is dropped: five messages in a row lost [s]."""
        return 5.0 * self.longest_silence_s


def _with_ideal_servos(controller: Controller) -> Controller:
    """Return all parameters; servos that are not given are ideal."""
    with calling(type(controller), "with_servos"):
        return controller.with_servos(ActuatorServos())


class Neighbour(Model):
    """One edge of the graph, seen from one of its ends.

    Attributes:
        weight: Weight a_ij.
        address: Where its formation link is received.
    """

    id: SystemId
    weight: float = quantity("", gt=0.0)
    address: HostPort


class ControllerConfig(Model):
    """All that the controller of one UAV needs.

    Attributes:
        step_us: Control period.
        aircraft: The nominal aircraft.
        controller: Control law and its parameters.
        trigger: Event triggers; the law's if there is no `mode`.
        formation_trigger: Trigger of the neighbour messages; none: every period.
        guidance: Guidance law for paths, and its parameters.
        runway_guidance: Take-off and landing.
        failsafe: What it does by itself.
        formation: Formation on paths; none: it flies on the path itself.
        leader_access: Leader access h_i.
        plugins: Digest of the code of each plug-in, by its name.
        neighbours: Neighbours in the communication graph.
    """

    id: SystemId
    step_us: int = whole("us", default=1000, ge=1, le=100_000)
    aircraft: Aircraft
    controller: Annotated[Controller, AfterValidator(_with_ideal_servos)] = Proposed()
    trigger: LawTrigger = Field(default={}, validate_default=True)
    formation_trigger: FormationTrigger | None = None
    guidance: Guidance = PathFollowing()
    runway_guidance: RunwayParameters = RunwayParameters()
    failsafe: FailsafeParameters = FailsafeParameters()
    formation: Formation | None = None
    leader_access: float = quantity("", default=0.0, ge=0.0)
    plugins: dict[str, str] = Field(default={})
    neighbours: tuple[Neighbour, ...] = ()

    @model_validator(mode="after")
    def _neighbours_distinct(self) -> Self:
        ids = [neighbour.id for neighbour in self.neighbours]
        problems = repeated(ids)
        problems += [(i, f"UAV {n} is this UAV itself") for i, n in enumerate(ids) if n == self.id]
        Problems.check((("neighbours", i, "id"), text) for i, text in problems)
        return self

    @model_validator(mode="after")
    def _is_member(self) -> Self:
        if self.formation is not None and self.id not in self.formation.slots:
            text = f"expected a slot of UAV {self.id}, which this autopilot flies"
            raise Problems([(("formation", "slots"), text)])
        return self

    @model_validator(mode="after")
    def _law_and_trigger_fit(self) -> Self:
        Problems.check(trigger_problems(self.controller, self.trigger, self.step_us))
        Problems.check(law_problems(self.controller, self.aircraft))
        Problems.check(guidance_problems(self.guidance, self.aircraft))
        Problems.check(plugin_problems(self.plugins, self.controller, self.trigger, self.guidance))
        return self
