"""What commands do with a vehicle's answer: files of what vehicles hold, ranges of parameters."""

import asyncio
import inspect
import operator
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from gcs.commands import mission, param
from gcs.commands.transfer import write_held
from gcs.console.errors import BadInput, CommandRefused
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item


def test_what_all_vehicles_hold_is_written(tmp_path: Path) -> None:
    write_held(tmp_path / "held", {2: "a", 1: "a"}, "profile", operator.eq, str.upper)
    assert (tmp_path / "held").read_text() == "A"


def test_different_ones_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="UAV 1, 2 hold different profiles"):
        write_held(tmp_path / "held", {2: "a", 1: "b"}, "profile", operator.eq, str.upper)
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"--out is .*, a folder, expected a file"):
        write_held(tmp_path, {1: "a"}, "profile", operator.eq, str.upper)


class OneVehicle:
    """A station that knows one vehicle, which holds home alone and refuses each value."""

    as_json = True
    system = 3

    def act(self, action: Callable[[Any], Coroutine[Any, Any, str]], _: Any = None) -> None:
        asyncio.run(action(self))

    async def download_mission(self) -> tuple[Any, ...]:
        return (mission_item(0, dialect.MAV_CMD_NAV_WAYPOINT),)

    async def download_fence(self) -> tuple[Any, ...]:
        text = "UAV 3 refused the download of its fence"
        raise CommandRefused(text, dialect.MAV_MISSION_UNSUPPORTED)

    async def set_param(self, name: str, value: float) -> None:
        text = f"UAV 3 refused {name} = {value:g}"
        raise CommandRefused(text, dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)


def test_home_alone_is_no_mission_to_write(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="the vehicles hold none"):
        inspect.unwrap(mission.download)(station=OneVehicle(), out=tmp_path / "held.plan")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("FORM_ON_LOST", "UAV 3 refused FORM_ON_LOST = 7: expected [0, 3]"),
        ("GUID_XTRACK_P", "UAV 3 refused GUID_XTRACK_P = 7: expected (0, 8] 1/s"),
        ("NO_SUCH", "UAV 3 refused NO_SUCH = 7"),
    ],
)
def test_a_value_out_of_range_is_refused_with_the_range(name: str, expected: str) -> None:
    with pytest.raises(CommandRefused) as refusal:
        inspect.unwrap(param.set_)(station=OneVehicle(), name=name, value=7.0)
    assert str(refusal.value) == expected
