"""Sections on the private messages, enums and commands, from the dialect."""

import xml.etree.ElementTree as ET
from pathlib import Path

from scripts.docs_table import table

DIALECT = Path(__file__).parents[1] / "mavlink_defs" / "ftc.xml"


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
