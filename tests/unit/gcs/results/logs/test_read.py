"""Files that are no log, by their names or beginnings."""

from pathlib import Path

import pytest

from gcs.console.errors import BadInput
from gcs.results.logs.read import read_flight

ULOG = b"ULog\x01\x12\x35"


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.bin", b"", "is empty"),
        ("a.bin", b"a text" * 20, "is no log of ArduPilot"),
        ("a.bin", b"\xa3\x95", "has no message of a flight"),
        ("a.bin", b"\xa3\x95\x80" + bytes(300), "has no message of a flight|is a broken log"),
        ("a.ulg", b"", "is empty"),
        ("a.ulg", b"a text" * 20, "is no ULog file"),
        ("a.ulg", ULOG, "is a broken ULog file|no topic of a flight"),
        ("a.ulg", ULOG + bytes(200), "is a broken ULog file|no topic of a flight"),
        ("a.tlog", b"", "no MAVLink frame in it"),
        ("a.tlog", bytes(8) + b"\xfd", "cut off"),
        ("a.tlog", b"# a text, and no log of anything\n" * 9, "no MAVLink frame at byte 8"),
        ("a.arrows", b"a text" * 20, "is no recording"),
    ],
)
def test_what_is_no_log_is_refused_in_a_line(
    name: str, content: bytes, problem: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(BadInput, match=problem) as refused:
        read_flight(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("suffix", [".tlog", ".bin", ".ulg", ".csv", ".parquet", ".mat", ".arrows"])
def test_a_file_that_cannot_be_read_is_named(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"none{suffix}"
    with pytest.raises(BadInput, match=f"cannot read .*none{suffix}: No such file"):
        read_flight(path)
