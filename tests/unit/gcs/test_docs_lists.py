"""Lists in the documentation have what the code has, no less and no more.

A list stands between ``<!-- list: NAME -->`` and ``<!-- end: NAME -->``, in a sentence or around a
table, of which one column counts. `lists` says what of the code it is a list of.
"""

import re
import tomllib
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from vehicle_bench import Bench

from ftc_autopilot.control.laws import KINDS
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.guidance import mission_items
from ftc_autopilot.guidance.formation import Policy
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from ftc_autopilot.guidance.mission_commands import ANNOUNCED, command_name
from ftc_autopilot.vehicle.vehicle import _IMPOSSIBLE
from ftc_lab.campaigns.faults import LOSS
from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.store import OUTCOMES
from gcs.commands.cli import _EXIT_DEFECT, whole_command
from gcs.console.errors import GcsError
from gcs.results.columns import COLUMNS, ESTIMATES
from gcs.results.logs.names import MOTORS, OUTPUTS, SERVOS, UNITS
from gcs.scenario.model import load_scenario
from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS, MODE_NAMES
from mavlink_defs.faults import COMMANDS
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.framing.drop_reason import DropReason

ROOT = Path(__file__).parents[3]
TOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
MARKED = re.compile(r"(?=<!-- list: (\S+) -->(.*?)<!-- end: \1 -->)", re.DOTALL)


class Listed(NamedTuple):
    """What a list in the documentation has to name."""

    names: Sequence[str]
    pattern: str = r"`([^`]+)`"  # of a name
    ordered: bool = False
    column: int = 0  # of a table
    others: frozenset[str] = frozenset()  # that may be named as well


def numbered(names: Iterable[tuple[Any, Any]]) -> list[str]:
    return [f"{name} ({number})" for name, number in names]


@cache
def vehicle() -> Any:
    return Bench(load_scenario(ROOT / "scenarios/paper/scenario1.yaml")).vehicle


def commands_of_a_vehicle() -> list[str]:
    handled = {*vehicle()._handlers(), *vehicle()._place_handlers(), *COMMANDS}
    names = dialect.enums["MAV_CMD"]
    return [names[number].name for number in handled.difference(_IMPOSSIBLE)]


def streamed_messages() -> list[str]:
    return [dialect.mavlink_map[number].msgname for number in vehicle().telemetry[0].available]


def private_messages() -> list[str]:
    return [m.msgname for m in dialect.mavlink_map.values() if m.msgname.startswith("FTC_")]


def options(command: Any) -> set[str]:
    return {name for parameter in command.params for name in parameter.opts}


def own_options(command: Any, group: Any) -> list[str]:
    """The options that are of a command only, not of all that talk to vehicles."""
    shown = {n for one in command.params if not one.hidden for n in one.opts if n[0] == "-"}
    return sorted(shown - options(group.commands["arm"]))


def commands_with(option: str, group: Any, prefix: str = "") -> list[str]:
    found = []
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            found += commands_with(option, command, f"{prefix}{name} ")
        elif option in options(command):
            found.append(prefix + name)
    return found


def rooms(package: str) -> list[str]:
    """The rooms of a package, from the lowest floor to the highest."""
    contracts = TOOLS["importlinter"]["contracts"]
    [layers] = [one["layers"] for one in contracts if one.get("containers") == [package]]
    return [room for layer in reversed(layers) for room in layer.split(" | ")]


def errors(error: type[GcsError] = GcsError) -> set[int]:
    return {error.exit_status}.union(*map(errors, error.__subclasses__()))


@pytest.fixture(scope="module")
def lists() -> dict[str, Listed]:
    """What each list has to name."""
    command: Any = whole_command()
    fault = command.commands["fault"].commands
    return {
        "actuators": Listed(ACTUATORS),
        "commands": Listed(["up", *commands_with("--connect", command)], r"`gcs ([a-z ]*[a-z])"),
        "designs": Listed(get_args(Campaign.model_fields["design"].annotation)),
        "drop-reasons": Listed([reason.text for reason in DropReason], r"[^,\n]+", ordered=True),
        "exit-statuses": Listed([str(status) for status in {0, _EXIT_DEFECT, *errors()}], r"\d+"),
        "fault-kinds": Listed([LOSS, *(kind.name for kind in ACTUATOR_FAULTS.kinds)]),
        "fault-options": Listed(own_options(fault["set"], command)),
        "sensor-fault-options": Listed(own_options(fault["sensor"].commands["set"], command)),
        "gcs-rooms": Listed(rooms("gcs"), ordered=True),
        "guidance-laws": Listed(list(GUIDANCE_LAWS)),
        "law-numbers": Listed(
            [f"{i} {kind}" for i, kind in enumerate(KINDS)], r"\d+ \w+", ordered=True
        ),
        "laws": Listed(KINDS),
        "mission-items": Listed(
            numbered(
                (dialect.enums["MAV_CMD"][i].name.removeprefix("MAV_CMD_"), i)
                for i in mission_items.COMMANDS
            ),
            r"[A-Z_]+ \(\d+\)",
        ),
        "log-channels": Listed(log_channels(), others=frozenset(UNITS)),
        "mission-commands": Listed(
            numbered((command_name(i), i) for i in ANNOUNCED), r"[A-Z_0-9]+ \(\d+\)", column=1
        ),
        "modes": Listed(
            numbered((name, number) for number, name in MODE_NAMES.items()), r"\w+ \(\d+\)"
        ),
        "outcomes": Listed(OUTCOMES, ordered=True),
        "packages": Listed(TOOLS["hatch"]["build"]["targets"]["wheel"]["packages"]),
        "policies": Listed(get_args(Policy)),
        "sent-messages": Listed(
            sorted({*streamed_messages(), *private_messages()}),
            r"\b[A-Z][A-Z0-9_]{4,}\b",
            column=1,
            others=frozenset(m.msgname for m in dialect.mavlink_map.values()),
        ),
        "triggers": Listed(list(TRIGGERS)),
        "vehicle-commands": Listed(commands_of_a_vehicle(), r"MAV_CMD_\w+"),
    }


def log_channels() -> list[str]:
    """What logs have besides the columns of our recordings; of numbered ones the first and last."""
    own = {column.name for column in (*COLUMNS, *ESTIMATES)}
    between = {name for many in (OUTPUTS, SERVOS, MOTORS) for name in many[1:-1]}
    return [name for name in UNITS if name not in own | between]


def column(text: str, number: int) -> str:
    """One column of a table without its head; the text itself if it has no table."""
    rows = re.findall(r"^\|(.*)\|$", text.replace(r"\|", "/"), re.MULTILINE)
    return "\n".join(row.split("|")[number].strip() for row in rows[2:]) if rows else text


def named(text: str, listed: Listed) -> list[str]:
    return [name.strip() for name in re.findall(listed.pattern, column(text, listed.column))]


def complaint(text: str, listed: Listed) -> str:
    """What is wrong with a list; empty if nothing is."""
    found = named(text, listed)
    if missing := set(listed.names).difference(found):
        return f"lacks {sorted(missing)}"
    if unknown := set(found).difference(listed.names, listed.others):
        return f"has {sorted(unknown)}, which the code has not"
    if listed.ordered and found != list(listed.names):
        return f"is not in the order {listed.names}"
    return ""


def marked_lists() -> list[tuple[str, str, str]]:
    return [(path.name, *found) for path in PAGES for found in MARKED.findall(path.read_text())]


@pytest.mark.parametrize(("page", "name", "text"), marked_lists(), ids=lambda value: value[:20])
def test_a_list_has_what_the_code_has(
    lists: dict[str, Listed], page: str, name: str, text: str
) -> None:
    assert complaint(text, lists[name]) == "", f"{page}: list {name}"


def test_every_list_is_in_the_documentation_and_every_mark_has_an_end(
    lists: dict[str, Listed],
) -> None:
    assert {name for _, name, _ in marked_lists()} == lists.keys()
    marks = sum(path.read_text().count("<!-- list: ") for path in PAGES)
    assert marks == len(marked_lists()) == sum(p.read_text().count("<!-- end: ") for p in PAGES)


@given(data=st.data(), marked=st.sampled_from(marked_lists()))
def test_a_list_that_lacks_a_name_or_has_another_is_found(
    lists: dict[str, Listed], data: st.DataObject, marked: tuple[str, str, str]
) -> None:
    _, name, text = marked
    listed = lists[name]
    lost = data.draw(st.sampled_from(sorted(listed.names)))
    assert complaint(text, listed._replace(names=[*listed.names, f"{lost}x"])).startswith("lacks")
    others = listed._replace(names=[n for n in listed.names if n != lost], others=frozenset())
    assert complaint(text, others).startswith("has")


def test_the_number_of_fault_files_matches_the_folder() -> None:
    count = len(list((ROOT / "scenarios/faults").glob("*.yaml")))
    count_in_page = re.compile(
        r"\b(\d+)\s+(?:more actuator faults|\[?fault files|files of `scenarios/faults)"
    )
    numbers = [number for path in PAGES for number in count_in_page.findall(path.read_text())]
    assert len(numbers) >= 3
    assert set(numbers) == {str(count)}
