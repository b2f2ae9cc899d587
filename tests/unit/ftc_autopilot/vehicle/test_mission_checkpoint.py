"""The mission that an autopilot keeps: it comes back whole or not at all."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.vehicle.mission_checkpoint import (
    KeptMission,
    read_kept_mission,
    write_kept_mission,
)
from mavlink_defs.mission_files import mission_item

numbers = st.floats(allow_nan=False)
whole = st.integers(-(2**31), 2**31 - 1)


def fields(mission: KeptMission) -> list[object]:
    items = [(i.seq, i.command, i.frame, i.param1, i.param4, i.x, i.y, i.z) for i in mission.items]
    return [items, mission.home, mission.airspeed]


@given(
    st.lists(
        st.tuples(st.integers(0, 65535), numbers, numbers, whole, whole, numbers), max_size=20
    ),
    st.builds(Home, numbers, numbers, numbers),
    numbers,
)
def test_it_comes_back(
    tmp_path_factory: pytest.TempPathFactory,
    rows: list[tuple[int, float, float, int, int, float]],
    home: Home,
    airspeed: float,
) -> None:
    path = tmp_path_factory.mktemp("kept") / "uav1.mission"
    items = tuple(
        mission_item(seq, command, (a, 0.0, 0.0, b), x, y, z)
        for seq, (command, a, b, x, y, z) in enumerate(rows)
    )
    mission = KeptMission(items, home, airspeed)
    write_kept_mission(path, mission)
    again = read_kept_mission(path)
    assert again is not None
    assert fields(again) == fields(mission)


def test_what_is_not_whole_is_none(tmp_path: Path) -> None:
    path = tmp_path / "uav1.mission"
    assert read_kept_mission(path) is None
    write_kept_mission(path, KeptMission((mission_item(0, 16),), Home(), 40.0))
    whole_file = path.read_bytes()
    for damaged in (whole_file[:-1], whole_file[:10], b"", whole_file[:-1] + b"x"):
        path.write_bytes(damaged)
        assert read_kept_mission(path) is None
