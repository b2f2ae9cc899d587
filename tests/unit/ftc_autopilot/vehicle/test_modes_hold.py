"""No mode sinks: what has nowhere to go holds its height and place, from when it is entered."""

import math
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenario_edits import edit
from vehicle_bench import ACCEPTED
from vehicle_fleet import ARM, SET_MODE, START, Member, VehicleFleet

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.control.laws import KINDS
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, GUIDED, LOITER, RTL
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import segments_to_items

SCENARIO_1 = Path("scenarios/paper/scenario1.yaml")
FLOWN_S, HEIGHT_M = 120.0, 20.0
WHEN_S = (0.0, 0.004, 2.0)
"""Before the start of time, with the first step, and in flight."""
SOON = ("pid", "surviving")
"""Laws of which `make test` sees it; the others take as long each."""


def enter(mode: int) -> Callable[[Member], None]:
    return lambda member: _accepted(member.command(SET_MODE, 1.0, mode))


def wait_for_a_path(member: Member) -> None:
    place = place_of(Origin(), 3000.0, 0.0, 0.0)[:2]
    member.upload([mission_item(0, 16), mission_item(1, 16, (), *place, 100.0)])
    enter(AUTO)(member)


def wait_for_a_profile(member: Member) -> None:
    segments = load_scenario(SCENARIO_1).segments()
    member.upload(segments_to_items(segments, member.uav, 1))
    enter(AUTO)(member)


def lose_the_path(mode: int) -> Callable[[Member], None]:
    """The process dies, its files of missions and paths are gone; the next one resumes."""

    def resume(member: Member) -> None:
        enter(mode)(member)
        _resume(member, mode)

    return resume


def lose_the_mission(member: Member) -> None:
    wait_for_a_path(member)
    _accepted(member.command(START))
    member.vehicle.modes.path.items = ()
    _resume(member, AUTO)


def _resume(member: Member, mode: int) -> None:
    member.controllers.paths[0]["count"] = 0
    member.hot.measured["position"] = member.hot.measured["velocity"] = 0.0
    member.vehicle.modes.resume(mode)


def _accepted(result: int) -> None:
    assert result == ACCEPTED


WAYS: dict[str, Callable[[Member], None]] = {
    "LOITER": enter(LOITER),
    "AUTO before a path": wait_for_a_path,
    "AUTO before a profile": wait_for_a_profile,
    "GUIDED": enter(GUIDED),
    "RTL": enter(RTL),
    "LOITER, its file gone": lose_the_path(LOITER),
    "AUTO, its files gone": lose_the_mission,
}


def fleet_of(law: str) -> Scenario:
    """Return a scenario of UAVs that know nothing of each other, one for each way and time."""
    tree = scenario_tree(SCENARIO_1)
    uav = tree["uavs"][0]
    count = len(WAYS) * len(WHEN_S)
    uavs = [{**uav, "id": k, "name": f"UAV {k}"} for k in range(1, count + 1)]
    network = {"leader_access": dict.fromkeys(range(1, count + 1), 1.0), "edges": []}
    changes: dict[str, Any] = {"controller": {"kind": law}, "faults": [], "step_us": 4000}
    if law == "tube":
        changes["trigger"] = {"mode": "consequence"}
    return scenario_of(SCENARIO_1, edit(tree, {**changes, "uavs": uavs, "network": network}))


@pytest.mark.parametrize("law", SOON)
def test_no_mode_sinks(law: str) -> None:
    _holds(law)


@pytest.mark.parametrize("law", sorted({*KINDS} - {*SOON}))
def test_no_mode_of_another_law_sinks(law: str) -> None:
    _holds(law)


def _holds(law: str) -> None:
    fleet = VehicleFleet(fleet_of(law))
    cases = list(zip(fleet.members, product(WAYS, WHEN_S), strict=True))
    for member in fleet.members:
        _accepted(member.command(ARM, 1.0))
    entered = np.zeros((len(cases), 3))
    heights: list[np.ndarray] = []
    for now, following in zip(WHEN_S, (*WHEN_S[1:], FLOWN_S), strict=True):
        for k, (member, (way, when_s)) in enumerate(cases):
            if when_s == now:
                entered[k] = member.vehicle.modes.path.here()
                WAYS[way](member)
        for seconds in (0.004, following - now - 0.004):  # what resumes needs one state
            fleet.fly(seconds, lambda steps: heights.append(_heights(steps)))
    for k, (member, case) in enumerate(cases):
        begun = round(case[1] * 250)
        off = np.concatenate(heights)[begun:, k] - entered[k, 2]
        assert np.abs(off).max() <= HEIGHT_M, case
        north, east, _ = member.vehicle.modes.path.here()
        near = (0.0, 0.0) if case[0] == "RTL" else entered[k, :2]
        assert math.dist((north, east), near) <= 1500.0, case
        told: Any = member.vehicle.telemetry[0].make(
            dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT
        )
        assert told.alt - 584.0 == pytest.approx(entered[k, 2], abs=2.0), case
        assert not told.type_mask & dialect.POSITION_TARGET_TYPEMASK_Z_IGNORE, case


def _heights(steps: Steps) -> np.ndarray:
    return -np.array(steps.states[:, :, 2])
