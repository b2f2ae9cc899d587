"""A start waits for who is alive, and goes on beside another station's upload."""

import asyncio
import math
from typing import Any

import pytest
from slow_vehicle import SlowVehicle

from gcs.console.errors import CommandRefused, NoAnswer
from gcs.fleet import start
from gcs.fleet.start import Liveness
from gcs.scenario.model import Scenario
from gcs.station.fleet_state import FleetState
from gcs.station.patience import USUAL
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.services.machine import SystemId

HEARTBEAT = dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 3, 3)
LONG_S = 600
PAUSE_S = start._PAUSE_S


def beat(heard: FleetState, uav: int, now: float) -> None:
    message = parse(FramePacker(uav, 1).pack(HEARTBEAT))
    assert message is not None
    heard.receive(message, now)


def test_who_is_heard_or_computes_is_waited_for_without_end() -> None:
    """UAV 1 only sends, UAV 2 only computes, as one that compiles."""
    heard, computed = FleetState(), {1: 5.0, 2: 0.0}
    signs = Liveness(heard, computed.get, [1, 2], 0.0)
    for second in range(LONG_S):
        if second % 30 == 0:
            beat(heard, 1, float(second))
            computed[2] += 0.01
        signs.check(float(second))


@pytest.mark.parametrize("unknown", [False, True])
def test_who_does_neither_ends_the_start(unknown: bool) -> None:
    """Even where nobody can say whether its process computes."""
    heard = FleetState()
    signs = Liveness(heard, lambda _: None if unknown else 1.0, [1, 2], 0.0)

    def wait() -> None:
        for second in range(LONG_S):
            beat(heard, 1, float(second))
            if second < 20:
                beat(heard, 2, float(second))
            elif second > 90:
                pytest.fail("it is waited for too long")
            signs.check(float(second))

    with pytest.raises(NoAnswer, match="UAV 2 does not seem alive: for 60 s"):
        wait()


class Beside:
    """Another station, which begins an upload some times."""

    def __init__(self, slow: SlowVehicle, uploads: int, own: SystemId) -> None:
        self._slow, self._left, self._own = slow, uploads, own

    def begin(self) -> None:
        if self._left:
            self._left -= 1
            count = dialect.MAVLink_mission_count_message(7, 1, 3, 0)
            message: Any = parse(FramePacker(*self._own).pack(count))
            self._slow.mission.receive(message, self._slow.now)


@pytest.mark.parametrize("own", [SystemId(255, 190), SystemId(254, 190)], ids=["same", "other"])
@pytest.mark.parametrize("uploads", [1, 5, 100])
def test_an_upload_of_another_station_is_outlasted_and_told_once(
    monkeypatch: pytest.MonkeyPatch, scenario1: Scenario, own: SystemId, uploads: int
) -> None:
    monkeypatch.setattr(start, "_PAUSE_S", 0.0)
    slow, said = SlowVehicle(0.3, math.inf, USUAL), list[str]()
    beside, items = Beside(slow, uploads, own), scenario1.mission_items()
    nobody: Any = None
    starting = start._Start(nobody, [7], lambda _: None, said.append)

    async def upload(vehicle: Vehicle) -> None:
        beside_too: Any = vehicle.with_patience(USUAL)
        whole = beside_too.upload_mission

        async def begun(*arguments: Any) -> None:
            slow.now += PAUSE_S
            slow.mission.handle_timer(slow.now)
            beside.begin()
            await whole(*arguments)

        beside_too.upload_mission = begun
        await starting._upload(beside_too, items)

    if uploads > 50 and own != SystemId(255, 190):
        with pytest.raises(CommandRefused):
            asyncio.run(slow.until_done(upload))
        return
    asyncio.run(slow.until_done(upload))
    assert len(slow.mission.items) == len(items)
    assert len(said) <= 1
    if own != SystemId(255, 190):
        assert said
        assert said[0].endswith("another station uploads, too: trying again")
