"""The commands of the lab, as `gcs` finds them by entry points of `ftc_sitl.commands`."""

from gcs.command_list import GcsCommand
from gcs.console.extras import DESIGN_PACKAGES, LAB_PACKAGES


def _command(name: str, line: str, panel: str, packages: tuple[str, ...] = ()) -> GcsCommand:
    extra = "lab" if packages else ""
    return GcsCommand(f"ftc_lab.commands.{name}", line, panel, extra, packages)


compare = _command("compare", "Compare two flights, or two campaigns.", "Fly")
campaign = _command(
    "campaign", "Fly every draw of a campaign, on all cores or a cluster.", "Study", LAB_PACKAGES
)
sweep = _command(
    "sweep", "Fly every combination of values, in process, on all cores.", "Study", LAB_PACKAGES
)
baseline = _command(
    "baseline",
    "Find the slowest periodic senders that match a flight.",
    "Study",
    LAB_PACKAGES,
)
diagnose = _command("diagnose", "Say what failed in a flight, and when.", "Study")
estimate = _command("estimate", "Estimate a flight by its recorded sensors.", "Study", LAB_PACKAGES)
replay_fault = _command(
    "replay_fault",
    "Fly a flight that failed again, by its own and by other laws.",
    "Study",
    LAB_PACKAGES,
)
reproduce = _command(
    "reproduce", "Fly the paper's scenarios, compare with its results.", "Study", LAB_PACKAGES
)
aircraft = _command(
    "aircraft",
    "List the bundled aircraft, or show one: limits, trim, modes.",
    "Aircraft and laws",
    DESIGN_PACKAGES,
)
design = _command(
    "design",
    "Write a scenario for an aircraft, parameters derived from it.",
    "Aircraft and laws",
    DESIGN_PACKAGES,
)
identify = _command(
    "identify",
    "Identify an aircraft from a simulator or the log of a flight.",
    "Aircraft and laws",
    DESIGN_PACKAGES,
)
trim = _command(
    "trim",
    "Compute where an actuator may be stuck in level flight.",
    "Aircraft and laws",
    DESIGN_PACKAGES,
)
