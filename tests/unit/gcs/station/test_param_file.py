"""Parameter files: what is saved is read as the same numbers, and wrong lines are all named."""

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.console.errors import CommandRefused
from gcs.station.param_file import (
    READ_ONLY,
    difference_lines,
    differing,
    read_param_file,
    set_values,
    text_of,
)
from gcs.station.param_metadata import _FIXED, permitted
from mavlink_defs import dialect
from mavlink_defs.config.models import ConfigError
from mavlink_defs.services.param import Param

DATA = Path(__file__).parents[3] / "data"
_names = st.text("ABCXYZ_0123456789", min_size=1, max_size=16)
_values = st.floats(width=32, allow_nan=False, allow_infinity=False)


@given(values=st.dictionaries(_names, _values, min_size=1))
def test_what_is_saved_differs_in_nothing(
    tmp_path_factory: pytest.TempPathFactory, values: dict[str, float]
) -> None:
    path = tmp_path_factory.mktemp("params") / "a.parm"
    held = [Param(name, value, dialect.MAV_PARAM_TYPE_REAL32) for name, value in values.items()]
    path.write_text(text_of(held, "UAV 1"))
    read = read_param_file(path)
    assert {name: np.float32(value) for name, value in read.items()} == {
        name: np.float32(value) for name, value in values.items()
    }
    assert not differing(held, read)


def test_only_what_differs_or_lacks_is_named() -> None:
    held = [Param("A", 0.1, 9), Param("B", 2.0, 9)]
    assert differing(held, {"A": 0.1, "B": 3.0, "C": 1.0}) == {"B": 2.0, "C": None}


def test_what_qgroundcontrol_saves_is_read(tmp_path: Path) -> None:
    """Of the autopilot only, whatever the vehicle; but a line of two numbers is no name."""
    assert read_param_file(DATA / "others" / "qgc.params") == {"K1_ROLL": 45.0, "TRIG_MODE": 1.0}
    path = tmp_path / "a.params"
    path.write_text("7\t1\tA\t1.5\t9\n7\t100\tA\t2\t6\n")
    assert read_param_file(path) == {"A": 1.5}
    path.write_text("x\t1\tA\t1.5\t9\n")
    with pytest.raises(ConfigError, match="line 1: expected NAME VALUE"):
        read_param_file(path)


class Held:
    """A vehicle that takes parameters, but none above 9."""

    def __init__(self) -> None:
        self.system, self.asked = 1, dict[str, float]()

    async def set_param(self, name: str, value: float) -> None:
        self.asked[name] = value
        if value > 9.0:
            raise CommandRefused(f"{name} refused", dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)


@given(
    st.dictionaries(_names, st.none() | st.floats(0.0, 9.0), min_size=1),
    st.sets(st.integers(0, 5)),
)
def test_names_that_a_vehicle_does_not_have_are_not_asked_for_and_share_a_line(
    held: dict[str, float | None], wrong: set[int]
) -> None:
    values = {name: 10.0 if k in wrong else 5.0 for k, name in enumerate(held)}
    vehicle: Any = Held()
    known = [name for name, value in held.items() if value is not None]
    unknown = [name for name in held if name not in known]
    refused = [name for name in known if values[name] > 9.0]
    try:
        text = asyncio.run(set_values(vehicle, values, held))
    except CommandRefused as problem:
        first, *others = str(problem).splitlines()
        assert others == [f"{name} refused" for name in refused]
        assert first.startswith(f"UAV 1: {len(known) - len(refused)} of {len(held)} set")
        assert (f"{len(unknown)} unknown name" in first) == bool(unknown)
        assert first.count(",") <= 7
    else:
        assert not refused
        assert not unknown
        assert text.startswith(f"UAV 1: {len(known)} parameter")
    assert vehicle.asked == {name: values[name] for name in known}
    assert len(difference_lines(1, held, values)) == len(known) + bool(unknown)


def test_every_wrong_line_is_named_and_shows_no_control_character(tmp_path: Path) -> None:
    path = tmp_path / "bad.parm"
    path.write_text(
        "# fine\nA 1\nA 2\nB\nC nan\nD x\x1b[2J\nE,5 # fine\nF 1e39\n" + "G" * 17 + " 1\n"
    )
    with pytest.raises(ConfigError) as error:
        read_param_file(path)
    text = str(error.value)
    assert [f"line {n}" in text for n in range(1, 10)] == [n not in (1, 2, 7) for n in range(1, 10)]
    assert "\x1b" not in text


def test_a_file_without_parameters_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "empty.parm"
    path.write_text("# nothing\n")
    with pytest.raises(ConfigError, match="no parameters"):
        read_param_file(path)


def test_what_is_read_only_is_what_the_metadata_say() -> None:
    assert frozenset(_FIXED) == READ_ONLY
    assert {permitted(name) for name in READ_ONLY} == {"read only"}
    assert permitted("TRIG_B2_DEG") == "[0, 10]"
