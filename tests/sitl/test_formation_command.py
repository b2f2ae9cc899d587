"""`gcs formation` against a fleet that flies a mission in formation."""

from collections.abc import Iterator
from typing import Any

import pytest
from flying import hexagon_tree, wait_until
from station import ALL, BAD_INPUT, REFUSED, Up, failed, up

pytestmark = pytest.mark.sitl


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    """Three UAVs in V formation, waiting to be armed; in lockstep they fly well on any machine."""
    with up(tmp_path_factory.mktemp("fleet"), "--lockstep", tree=hexagon_tree()) as fleet:
        yield fleet


def shown(fleet: Up) -> dict[int, dict[str, Any]]:
    return {vehicle["uav"]: vehicle for vehicle in fleet.gcs_json("formation", "show", *ALL)}


def is_slot(fleet: Up, uav: int, *slot: float) -> bool:
    return bool(shown(fleet)[uav]["slot_m"] == pytest.approx(slot, abs=0.2))


def test_the_formation_is_shown_and_a_slot_is_changed(fleet: Up) -> None:
    assert not shown(fleet)[1]["flies_in_formation"]
    assert fleet.gcs("start", *ALL).returncode == 0
    assert fleet.gcs("arm", *ALL).returncode == 0
    wait_until(lambda: all(t["flies_in_formation"] for t in shown(fleet).values()), "a formation")
    before = shown(fleet)
    assert before[2]["slot_m"] == [-20.0, 20.0, 0.0]
    assert before[1]["nearest"] in {2, 3}
    assert 25.0 < before[1]["distance_m"] < 30.0
    assert (before[3]["cause"], before[3]["policy"]) == ("well", "stay")

    text = fleet.gcs("formation", "slot", "--uav", "3", "-26", "-20", "2").stdout
    assert text == "UAV 3 takes slot -26 m ahead, -20 m right, 2 m up\n"
    wait_until(lambda: is_slot(fleet, 3, -26.0, -20.0, 2.0), "the slot that was ordered")
    assert is_slot(fleet, 2, -20.0, 20.0, 0.0)
    assert fleet.gcs("formation", "slot", "--uav", "3", "--planned").returncode == 0
    wait_until(lambda: is_slot(fleet, 3, -20.0, -20.0, 0.0), "the planned slot")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("--uav", "3", "-50", "-20"), "expected three distances AHEAD RIGHT UP [m], or --planned"),
        (("--uav", "3"), "expected three distances"),
        (("-50", "-20", "8"), "expected --uav with one UAV, as two cannot have one slot, got none"),
        (("--planned", "1", "2", "3"), "expected three distances"),
    ],
)
def test_a_slot_that_is_not_understood_is_refused(
    fleet: Up, arguments: tuple[str, ...], reason: str
) -> None:
    assert reason in failed(fleet.gcs("formation", "slot", *arguments), BAD_INPUT)


def test_a_slot_that_is_too_far_is_refused_by_the_vehicle(fleet: Up) -> None:
    done = fleet.gcs("formation", "slot", "--uav", "2", "--", "-5000", "0", "0")
    assert done.returncode == REFUSED
    assert "Slot: ahead is -5000 m, must be -1000 to 1000 m" in done.stderr
