"""Parameter files: what is saved is read as the same numbers, and wrong lines are all named."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.station.param_file import READ_ONLY, differing, read_param_file, text_of
from gcs.station.param_metadata import _FIXED, permitted
from mavlink_defs import dialect
from mavlink_defs.config.models import ConfigError
from mavlink_defs.services.param import Param

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
