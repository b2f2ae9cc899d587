"""The private dialect takes no number and no name of any dialect that pymavlink ships.

But for what it borrows from ArduPilot, which must be the same there.
"""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pymavlink
import pytest

import mavlink_defs
from mavlink_defs import dialect

FTC = Path(mavlink_defs.__file__).parent / "ftc.xml"
SHIPPED = sorted(
    path
    for path in (Path(pymavlink.__file__).parent / "dialects" / "v20").glob("*.xml")
    if path.stem != "ftc"  # a copy of ours, as docs/how-to/clients.md has it
)
BORROWED: set[tuple[str, int | str]] = {("message id", 193), ("name", "EKF_STATUS_REPORT")}


def taken(path: Path) -> Iterator[tuple[str, int | str]]:
    """Everything that a dialect file itself, without its includes, claims."""
    root = ElementTree.parse(path).getroot()
    for message in root.iterfind("messages/message"):
        yield "message id", int(message.attrib["id"])
        yield "name", message.attrib["name"]
    for enum in root.iterfind("enums/enum"):
        if enum.attrib["name"] != "MAV_CMD":
            yield "name", enum.attrib["name"]
        for entry in enum.iterfind("entry"):
            yield "name", entry.attrib["name"]
            if enum.attrib["name"] == "MAV_CMD":
                yield "command", int(entry.attrib["value"], 0)


def test_pymavlink_ships_the_dialects_that_are_compared() -> None:
    assert {"common", "ardupilotmega", "all"} <= {path.stem for path in SHIPPED}


@pytest.mark.parametrize("shipped", SHIPPED, ids=lambda path: path.stem)
def test_nothing_collides(shipped: Path) -> None:
    assert not (set(taken(FTC)) - BORROWED) & set(taken(shipped))


def test_what_is_borrowed_is_the_same() -> None:
    from pymavlink.dialects.v20 import ardupilotmega

    ours = dialect.MAVLink_ekf_status_report_message
    theirs = ardupilotmega.MAVLink_ekf_status_report_message
    assert (ours.id, ours.crc_extra) == (theirs.id, theirs.crc_extra)
    assert ours.ordered_fieldnames == theirs.ordered_fieldnames


def test_nothing_is_taken_twice() -> None:
    ours = list(taken(FTC))
    assert len(ours) == len(set(ours))


def test_generated_dialect_matches_the_xml() -> None:
    root = ElementTree.parse(FTC).getroot()
    for message in root.iterfind("messages/message"):
        generated = dialect.mavlink_map[int(message.attrib["id"])]
        assert generated.msgname == message.attrib["name"]
        assert sorted(generated.fieldnames) == sorted(
            field.attrib["name"] for field in message.iterfind("field")
        )
