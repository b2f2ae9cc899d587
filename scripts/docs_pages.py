"""Reference pages from the code: a hook of mkdocs that fills them in when the site is built.

The comment ``<!-- generated: keys trigger -->`` becomes the table of the keys of `trigger`.
"""

import html
import json
import re
import types
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
import typer
import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from typer.cli import get_docs_for_click

from ftc_autopilot.common.schedule import Schedule
from ftc_autopilot.control.controller import PARAMETERS
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.control.triggers.base import TriggerParameters
from ftc_autopilot.guidance.formation import Formation, FormationParameters, Slot
from ftc_autopilot.guidance.laws import GUIDANCE_LAWS
from ftc_autopilot.guidance.laws.base import GuidanceParameters
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_autopilot.vehicle.param_table import law_tunables, trigger_tunables, tunables
from gcs.cli import whole_command
from gcs.lab.campaigns import distributions
from gcs.lab.campaigns.model import Campaign, DrawnFault, Factor, Kept
from gcs.lab.campaigns.sensor_faults import DrawnSensorFault
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
from sitl_plant.aircraft_config import Aircraft, Uncertainty
from sitl_plant.ardupilot.config import ArduPilot
from sitl_plant.atmosphere import Dryden, Wind
from sitl_plant.config import Disturbance, Sinusoid
from sitl_plant.hardware import EngineServo, Sensor, Sensors, Servos, SurfaceServo
from sitl_plant.navigation_sensors import (
    Accelerometer,
    Barometer,
    Gnss,
    Gyro,
    Magnetometer,
    NavigationSensors,
    Pitot,
)
from sitl_plant.plant_section import JsbSimPlant, PluginPlant
from sitl_plant.propulsion import Propulsion

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
DIALECT = ROOT / "mavlink_defs" / "ftc.xml"
MARK = re.compile(r"^<!-- generated: (\w+)(?: (\S+))? -->$", re.MULTILINE)
SECTIONS: dict[str, type[BaseModel]] = {
    "scenario": Scenario,
    "aircraft": Aircraft,
    "propulsion": Propulsion,
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
    "controller": LawParameters,
    **LAWS,
    "trigger": TriggerParameters,
    **TRIGGERS,
    "uavs": ScenarioUav,
    "network": Network,
    "guidance": PathFollowing,
    "formation": Formation,
    "slot": Slot,
    "profile": ProfileSegment,
    "mission": MissionSection,
    "faults": ScenarioFault,
    "sensor_faults": ScenarioSensorFault,
    "links": Links,
    "impairment": Impairment,
    "ardupilot": ArduPilot,
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


def on_page_markdown(markdown: str, **_: object) -> str:
    """Fill in the generated parts of a page; mkdocs calls this for each page.

    Raises:
        KeyError: The page asks for something that does not exist.
    """
    return MARK.sub(lambda mark: GENERATORS[mark[1]](*filter(None, [mark[2]])), markdown)


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


def page_of(section: str) -> str:
    """Return the page of the reference that has the table of a section."""
    mark = f"<!-- generated: keys {section} -->"
    pages = sorted((DOCS / "reference").glob("*.md"))
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
    """Return the tables of the parameters: of triggers, laws, guidance, formation."""
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


def messages() -> str:
    """Return a section for each private message, with its fields."""
    return "\n\n".join(map(message_section, ET.parse(DIALECT).iter("message")))


def message_section(message: ET.Element) -> str:
    """Return heading, description and fields of a message."""
    rows, extension = [], ""
    for child in message:
        if child.tag == "extensions":
            extension = " (extension)"
        elif child.tag == "field":
            enum = child.get("enum")
            text = (child.text or "") + (f" [{enum}](#enum-{enum.lower()})" if enum else "")
            kind = child.attrib["type"] + extension
            rows.append((f"`{child.attrib['name']}`", f"`{kind}`", child.get("units", ""), text))
    name, number = message.attrib["name"], message.attrib["id"]
    fields = table(("field", "type", "unit", "meaning"), rows)
    return f"### {name}\n\nId {number}. {message.findtext('description')}\n\n{fields}"


def enums() -> str:
    """Return a section for each private enum."""
    return "\n\n".join(
        f"### {enum.attrib['name']} {{ #enum-{enum.attrib['name'].lower()} }}\n\n"
        f"{enum.findtext('description')}\n\n"
        + table(
            ("value", "name", "meaning"),
            (
                (e.attrib["value"], f"`{e.attrib['name']}`", e.findtext("description", ""))
                for e in enum.iter("entry")
            ),
        )
        for enum in ET.parse(DIALECT).iter("enum")
        if enum.attrib["name"] != "MAV_CMD"
    )


def commands() -> str:
    """Return a section for each private command, with its parameters."""
    entries = ET.parse(DIALECT).iterfind(".//enum[@name='MAV_CMD']/entry")
    head = ("parameter", "name", "unit", "range", "meaning")
    return "\n\n".join(
        f"### {entry.attrib['name']}\n\nId {entry.attrib['value']}. "
        f"{entry.findtext('description')}\n\n" + table(head, map(param_row, entry.iter("param")))
        for entry in entries
    )


def param_row(param: ET.Element) -> tuple[str, ...]:
    """Return the row of one parameter of a command."""
    low, high = param.get("minValue"), param.get("maxValue")
    if low and high:
        limits = f"[{low}, {high}]"
    else:
        limits = f"≥ {low}" if low else f"≤ {high}" if high else ""
    label, unit = param.get("label", ""), param.get("units", "")
    return param.attrib["index"], label, unit, limits, param.text or ""


def command_line() -> str:
    """Return a section for each command of `gcs`, as its help text has it.

    Lists of commands have whole sentences, and link to the commands; usage lines can be copied.
    """
    _show_whole_sentences(command := whole_command())
    text = get_docs_for_click(obj=command, ctx=typer.Context(command, info_name="gcs"), name="gcs")
    text = text.partition("\n")[2].replace("```console\n$ ", "```text\n")
    name = "gcs"

    def linked(line: re.Match[str]) -> str:
        nonlocal name
        if line["heading"]:
            name = line["heading"]
            return f"#{line[0]}"
        command = f"{name} {line['entry']}"
        return f"* [`{command}`](#{command.replace(' ', '-')})"

    # commands have small letters only, unlike options and arguments
    return re.sub(
        r"^(?:#+ `(?P<heading>.+)`$|\* `(?P<entry>[a-z]+)`)", linked, text, flags=re.MULTILINE
    )


def _show_whole_sentences(command: Any) -> None:
    for sub in getattr(command, "commands", {}).values():
        sub.short_help = (sub.help or "").partition("\n\n")[0].replace("\n", " ")
        _show_whole_sentences(sub)


def pages(title: str) -> str:
    """Return a list of the pages under a title of the navigation, each with its first sentence."""
    return "\n".join(
        f"- [{name}]({path}){first_sentence(DOCS / path)}"
        for name, path in navigation()[title].items()
    )


def navigation() -> dict[str, dict[str, str]]:
    """Return the pages of the site by title and name, as `mkdocs.yml` has them, paths in `docs`.

    The home page is not among them.
    """
    _, *groups = yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]
    return {
        title: {name: path for page in entries for name, path in page.items()}
        for group in groups
        for title, entries in group.items()
    }


def first_sentence(page: Path) -> str:
    """Return ": " and the first sentence of a page without its links; nothing without prose."""
    text = re.sub(r"^```.*?^```|^<!--.*?-->", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    prose = (part for part in text.split("\n\n") if re.match(r"[\w\"*`]", part.lstrip("\n")))
    paragraph = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", " ".join(next(prose, "").split()))
    sentence = re.match(r"((?:`[^`]*`|[^`])*?(?<!Fig))(?:[.?] |[.:]$)", paragraph)
    return f": {sentence[1]}." if sentence else ""


def readme(title: str) -> str:
    """Return a section of the README without its heading; `_` in its title stand for blanks."""
    text = (ROOT / "README.md").read_text().split(f"\n## {title.replace('_', ' ')}\n")[1]
    return text.partition("\n## ")[0].strip("\n").replace("](docs/", "](")


def table(head: tuple[str, ...], rows: Iterable[Iterable[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(
        "| " + " | ".join(" ".join(cell.split()).replace("|", r"\|") for cell in line) + " |"
        for line in lines
    )


def notebook(name: str) -> str:
    """Return a notebook of `docs/notebooks` as Markdown, with the outputs that it holds."""
    cells = json.loads((DOCS / "notebooks" / f"{name}.ipynb").read_text())["cells"]
    return "\n\n".join(part for cell in cells for part in _cell_parts(cell))


def _cell_parts(cell: dict[str, Any]) -> Iterator[str]:
    """Yield a cell and its outputs as Markdown: text, HTML without its style, or a picture."""
    source = "".join(cell["source"])
    if cell["cell_type"] != "code":
        yield source
        return
    yield f"```python\n{source}\n```"
    for output in cell["outputs"]:
        shown = output.get("data", {"text/plain": output.get("text")})
        if "image/png" in shown:
            picture = shown["image/png"].replace("\n", "")
            yield f'<img alt="{html.escape(source)}" src="data:image/png;base64,{picture}">'
        elif "text/html" in shown:
            yield re.sub(r"<style.*?</style>\n?", "", "".join(shown["text/html"]), flags=re.DOTALL)
        else:
            yield f"```text\n{''.join(shown['text/plain']).rstrip()}\n```"


GENERATORS: dict[str, Callable[..., str]] = {
    "keys": keys,
    "parameters": parameters,
    "messages": messages,
    "enums": enums,
    "commands": commands,
    "command_line": command_line,
    "pages": pages,
    "readme": readme,
    "notebook": notebook,
}
