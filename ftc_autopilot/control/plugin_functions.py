"""The C functions of the plug-ins that a controller uses, made of their Python functions."""

from typing import Protocol

from ftc_autopilot.common.records import record_dtype
from ftc_autopilot.control.laws import LAWS, own_parameters
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.laws.plugin import LAW
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.step import ParametersRecord
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.control.triggers.plugin import TRIGGER
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.guidance.laws.plugin import GUIDANCE
from ftc_autopilot.guidance.path import PATH
from ftc_autopilot.plugins.models import PLUGIN
from sitl_plant.airframe.aircraft import AIRCRAFT

_LIMITS = record_dtype(GuidanceParameters)


class Chosen(Protocol):
    """What a UAV flies by: a scenario, or the configuration of a controller."""

    @property
    def controller(self) -> LawParameters:
        """Its control law."""

    @property
    def trigger(self) -> TriggerParameters:
        """Its trigger."""

    @property
    def guidance(self) -> GuidanceParameters:
        """Its guidance law."""


def bind(record: ParametersRecord, chosen: Chosen) -> None:
    """Write to a record of PARAMETERS which functions its plug-ins have; ours have none there.

    Raises:
        PluginError: One cannot be used.
    """
    law, trigger, guidance = chosen.controller, chosen.trigger, chosen.guidance
    if law.kind not in LAWS:
        part = record[PLUGIN]
        part["step"], part["init"] = LAW.functions(type(law), AIRCRAFT, SIGNALS)
        own = own_parameters(record, type(law), law.kind)
        for name in ("by_bank", "heading_gain_1_s", "bank_limit_rad"):
            if name in (own.dtype.names or ()):
                part[name] = own[name]
    if trigger.mode not in TRIGGERS:
        part = record["trigger"][PLUGIN]
        part["step"], part["init"] = TRIGGER.functions(type(trigger))
    if guidance.kind not in GUIDANCE_LAWS:
        part = record["guidance"][PLUGIN]
        part["step"], part["init"] = GUIDANCE.functions(type(guidance), AIRCRAFT, _LIMITS, PATH)
