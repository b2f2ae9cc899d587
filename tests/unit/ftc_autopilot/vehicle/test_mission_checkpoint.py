"""The mission of a checkpoint comes back whole or not at all."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.vehicle.mission_checkpoint import (
    MissionCheckpoint,
    load_mission,
    save_mission,
)
from mavlink_defs.mission_files import mission_item

numbers = st.floats(allow_nan=False, width=32)
whole = st.integers(-(2**31), 2**31 - 1)


def fields(mission: MissionCheckpoint) -> list[object]:
    items = [item.to_dict() for item in mission.items]
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
    path = tmp_path_factory.mktemp("process") / "uav1.mission"
    items = tuple(
        mission_item(seq, command, (a, 0.0, 0.0, b), x, y, z)
        for seq, (command, a, b, x, y, z) in enumerate(rows)
    )
    mission = MissionCheckpoint(items, home, airspeed)
    save_mission(path, mission)
    again = load_mission(path)
    assert again is not None
    assert fields(again) == fields(mission)


def test_what_is_not_whole_is_none(tmp_path: Path) -> None:
    path = tmp_path / "uav1.mission"
    assert load_mission(path) is None
    save_mission(path, MissionCheckpoint((mission_item(0, 16),), Home(), 40.0))
    whole_file = path.read_bytes()
    for damaged in (whole_file[:-1], whole_file[:10], b"", whole_file[:-1] + b"x"):
        path.write_bytes(damaged)
        assert load_mission(path) is None
