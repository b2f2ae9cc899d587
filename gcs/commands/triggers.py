"""``gcs triggers [show|header]``: the event triggers that scenarios can choose."""

from ftc_autopilot.control.triggers import TRIGGERS, trigger_of
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.control.triggers.plugin import own_record
from ftc_autopilot.plugins.loading import TRIGGERS as GROUP
from gcs.commands.plugin_app import plugin_app
from gcs.commands.plugins import PluginKind

app = plugin_app(
    PluginKind(
        "trigger", "ftc_trigger.h", GROUP, dict(TRIGGERS), trigger_of, TriggerParameters, own_record
    ),
    "triggers",
    "triggers",
    ("", "show dynamic", "show my_trigger.py:EveryNth"),
)
