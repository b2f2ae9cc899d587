"""A check that is switched off for a line says why on that line."""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[3]
ROOMS = (
    *("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "ftc_lab"),
    *("fuzzing", "benchmarks", "tests"),
)
OFF = re.compile(r"# (noqa|type: ignore)\b.*")
WITH_REASON = re.compile(
    r"#[ ]noqa: [A-Z]+[0-9]+(, [A-Z]+[0-9]+)* - \w"
    r"|#[ ]type: ignore\[[a-z-]+(, [a-z-]+)*\]  # \w"
)


def without_reason(text: str) -> Iterator[int]:
    """Yield the numbers of the lines that switch a check off and do not say why."""
    for number, line in enumerate(text.splitlines(), 1):
        off = OFF.search(line)
        if off is not None and not WITH_REASON.match(off[0]):
            yield number


def test_every_check_that_is_switched_off_has_its_reason() -> None:
    files = [ROOT / "hatch_build.py", *(f for room in ROOMS for f in (ROOT / room).rglob("*.py"))]
    found = [
        f"{file.relative_to(ROOT)}:{number}"
        for file in files
        if file.name != "dialect.py"  # generated
        for number in without_reason(file.read_text())
    ]
    assert found == []


def test_what_counts_as_a_reason() -> None:
    mute, ignore = "x = 1  # " + "noqa", "x = 1  # " + "type: ignore"
    bad = [
        mute,
        f"{mute}: E501",
        f"{mute}: E501 - ",
        f"{mute} - because",
        ignore,
        f"{ignore}[misc]",
        f"{ignore}  # because",
    ]
    good = [
        f"{mute}: E501 - because",
        f"{mute}: E501, N806 - because",
        f"{ignore}[misc]  # because",
        "x = 1",
    ]
    assert list(without_reason("\n".join([*bad, *good]))) == list(range(1, len(bad) + 1))
