"""The commands of `gcs`: its own, and those that other packages register.

A package registers one by an entry point of the group `ftc_sitl.commands`: its name is the
command's, and it leads to a `GcsCommand`, in a module that imports nothing else of weight.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from gcs.console.errors import BadInput
from gcs.console.extras import TOOLS_PACKAGES, WEB_PACKAGES, check_packages

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "ftc_sitl.commands"


class GcsCommand(NamedTuple):
    """A command, which is imported when it is run; until then only its line of help is there."""

    module: str
    """It has a function of the command's name, `_` for `-`, or a typer `app`.

    The function's docstring is its help. What follows `Examples:` is shown below the options, as
    `EPILOG` of the module is.
    """
    line: str
    """Of help: the first line of the command's own."""
    panel: str = "Other packages"
    """Of the help."""
    extra: str = ""
    """What it needs besides the core, one of ftc-sitl's extras, and the packages of that."""
    packages: tuple[str, ...] = ()


def _panel(title: str, **commands: tuple[str, str]) -> dict[str, GcsCommand]:
    return {
        name: GcsCommand(f"gcs.commands.{module}", line, title)
        for name, (module, line) in commands.items()
    }


OWN: Mapping[str, GcsCommand] = {
    **_panel(
        "Fly",
        new=("new", "Write a commented scenario, or a whole project, to start from."),
        scenarios=("scenarios", "List the bundled scenarios and additions."),
        fly=("fly", "Fly a scenario to its end and record it."),
        up=("up", "Start a fleet that flies until it is stopped (Ctrl-C)."),
        start=("control", "Start flying the mission."),
        status=("status", "Show link, mode, attitude, events and faults of each vehicle."),
        fault=("fault", "Set, clear and list faults of actuators and sensors."),
        runs=("runs", "List what was flown, write a page of it, and add notes."),
    ),
    **_panel(
        "Operate",
        arm=("control", "Arm vehicles; time begins when the whole fleet is armed."),
        disarm=("control", "Disarm vehicles; in flight they refuse unless forced."),
        mode=("control", "Change the mode: fly the mission, circle, or follow targets."),
        mission=("mission", "Show, upload, download and fly missions."),
        formation=("formation", "See the formation in space, and change slots."),
        profile=("profile", "Upload, download and check reference profiles."),
        param=("param", "List, read, set, save, load and compare parameters."),
        record=("record", "Record every frame that vehicles send, until Ctrl-C."),
        log=("log", "Replay a log of any autopilot, or list what is in it."),
        web=("web", "Serve the dashboard to browsers until Ctrl-C."),
    ),
    **_panel(
        "Study",
        export=("export", "Convert a recording, or a log, for other programs."),
    ),
    **_panel(
        "Aircraft and laws",
        laws=("laws", "List the control laws, ours and other packages', or show one."),
        triggers=("triggers", "List the triggers, ours and other packages', or show one."),
        guidance=("guidance", "List the guidance laws, ours and other packages', or show one."),
    ),
    **_panel(
        "Wire",
        wire=("wire", "Count frames and bytes of a capture or a relay."),
        wireshark=("wireshark", "Write a Wireshark dissector for all messages (Lua)."),
        key=("key", "Make a key file for MAVLink 2 signing."),
        config=("config", "Write the configurations of a fleet that spans several hosts."),
    ),
}
"""Our commands, in the order of the help."""
OWN = {
    **OWN,
    "web": OWN["web"]._replace(extra="web", packages=WEB_PACKAGES),
    "wireshark": OWN["wireshark"]._replace(extra="tools", packages=TOOLS_PACKAGES),
}
GONE = {"ardupilot": "gcs fly SCENARIO --set autopilot.kind=ardupilot"}
"""What does now what a command of the version before did."""


def registered() -> dict[str, "EntryPoint"]:
    """Return the commands of other packages, by name; none of them takes the name of our own."""
    from importlib.metadata import entry_points  # takes time, of every command

    return {point.name: point for point in entry_points(group=GROUP) if point.name not in OWN}


def command_of(point: "EntryPoint") -> GcsCommand:
    """Return a command that another package registers.

    Raises:
        BadInput: It cannot be imported, or is something else.
    """
    try:
        found = point.load()
    except (Exception, SystemExit) as problem:
        why = f" cannot be imported: {type(problem).__name__}: {problem}"
        raise BadInput(_whose(point) + why, "mend or remove that package") from problem
    if not isinstance(found, GcsCommand):
        why = f": expected a `gcs.command_list.GcsCommand`, got {type(found).__name__}"
        raise BadInput(_whose(point) + why, "mend or remove that package")
    return found


def _whose(point: "EntryPoint") -> str:
    package = "" if point.dist is None else f" ({point.dist.name} {point.dist.version})"
    return f"the command {point.name!r} of {point.value}{package}"


def load(name: str, command: GcsCommand) -> Any:
    """Import the module of a command.

    Raises:
        BadInput: It needs packages that are not installed.
    """
    if command.extra:
        check_packages(command.packages, f"gcs {name}", command.extra)
    return import_module(command.module)
