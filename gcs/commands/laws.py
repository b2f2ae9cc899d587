"""``gcs laws [show|header]``: the control laws that scenarios can choose."""

from ftc_autopilot.control.laws import LAWS, law_of
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.plugins.loading import LAWS as GROUP
from gcs.commands.plugin_app import plugin_app
from gcs.commands.plugins import PluginKind

app = plugin_app(
    PluginKind(
        "law", "ftc_law.h", GROUP, dict(LAWS), law_of, LawParameters, lambda law: law.record()
    ),
    "laws",
    "control laws",
    ("", "show surviving", "show my_law.py:MyLaw", "header my_law.py:MyLaw > my_law_parameters.h"),
)
