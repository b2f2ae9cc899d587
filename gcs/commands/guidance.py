"""``gcs guidance [show|header]``: the guidance laws that scenarios can choose."""

from ftc_autopilot.guidance.laws import GUIDANCE_LAWS, guidance_of
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.guidance.laws.plugin import own_record
from ftc_autopilot.plugins.loading import GUIDANCE_LAWS as GROUP
from gcs.commands.plugin_app import plugin_app
from gcs.commands.plugins import PluginKind

app = plugin_app(
    PluginKind(
        "guidance law",
        "ftc_guidance.h",
        GROUP,
        dict(GUIDANCE_LAWS),
        guidance_of,
        GuidanceParameters,
        own_record,
    ),
    "guidance",
    "guidance laws",
    ("", "show path", "show my_guidance.py:Gentle"),
)
