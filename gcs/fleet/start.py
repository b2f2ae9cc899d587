"""The start of a fleet: mission and faults come to it by MAVLink, as from any ground station.

On a busy machine that takes long. Who is alive is waited for: a vehicle that is heard, or whose
process computes. One that is neither for a while, or whose process ends, ends the start.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Collection
from functools import partial
from typing import TypeAlias

from gcs.console.errors import CommandRefused, NoAnswer
from gcs.fleet.processes import FleetProcesses
from gcs.scenario.model import Scenario
from gcs.station.client import Client
from gcs.station.fleet_state import FleetState
from gcs.station.mission import Mission
from gcs.station.patience import ENDLESS
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect

Tell: TypeAlias = Callable[[str], None]

_MAX_SILENCE_S = 60.0
_LOOK_S = 1.0
_POLL_S = 0.05
_AT_A_TIME = 8
_UPLOADS, _PAUSE_S = 20, 1.0  # tries beside another station's uploads, and between two
_OF_ANOTHER = {dialect.MAV_MISSION_OPERATION_CANCELLED, dialect.MAV_MISSION_DENIED}


async def prepare(
    client: Client,
    fleet: FleetProcesses,
    scenario: Scenario,
    start: bool,
    on_start: Tell = lambda _: None,
    on_message: Tell = lambda _: None,
) -> None:
    """Bring missions and faults to a fleet that starts up.

    Args:
        client: Connected to the fleet.
        fleet: Its processes.
        scenario: The scenario.
        start: Also start the missions and arm, so that simulated time begins.
        on_start: Called with how far the start is.
        on_message: Called with what the user should know.

    Raises:
        BadInput, FlightLost: A process ended.
        CommandRefused: What a vehicle answered.
        NoAnswer: A vehicle does not seem alive.
    """
    ids = [uav.id for uav in scenario.uavs]
    liveness = Liveness(client.fleet, fleet.computed_s, ids, time.monotonic())
    work = asyncio.create_task(_Start(client, ids, on_start, on_message).bring(scenario, start))
    try:
        while not work.done():
            fleet.check()
            liveness.check(time.monotonic())
            await asyncio.wait([work], timeout=_POLL_S)
        await work
    finally:
        work.cancel()
        await asyncio.gather(work, return_exceptions=True)
    fleet.check()


async def start_vehicle(vehicle: Vehicle, scenario: Scenario) -> None:
    """Start the mission of a vehicle, before it is armed; a foreign autopilot has its own way.

    Raises:
        CommandRefused, NoAnswer: As it answers.
    """
    own = scenario.foreign.get(vehicle.id)
    if own is None:
        await vehicle.start_mission()
        return
    mission, slot = scenario.mission is not None, vehicle.id in scenario.slot_keepers
    for command, params in own.commands(has_mission=mission, has_slot=slot):
        await vehicle.command(command, params)


class Liveness:
    """Notices UAVs that are neither heard nor compute."""

    def __init__(
        self,
        heard: FleetState,
        computed_s: Callable[[int], float | None],
        ids: list[int],
        now: float,
    ) -> None:
        """Begin without any.

        Args:
            heard: What is heard of the vehicles.
            computed_s: Returns the processor time of a UAV's process [s]; None if that is unknown.
            ids: System ids of the vehicles.
            now: The time [s].
        """
        self._heard, self._computed_s = heard, computed_s
        self._seen_s = dict.fromkeys(ids, now)
        self._signs: dict[int, tuple[float | None, float | None]] = {}
        self._look_due_s = 0.0

    def check(self, now: float) -> None:
        """Look whether all live; call it often.

        Args:
            now: The time [s].

        Raises:
            NoAnswer: One has been neither for a minute.
        """
        if now < self._look_due_s:
            return
        self._look_due_s = now + _LOOK_S
        for uav, seen_s in self._seen_s.items():
            state = self._heard.vehicles.get(uav)
            sign = (None if state is None else state.heard_at, self._computed_s(uav))
            if sign != self._signs.get(uav):
                self._signs[uav], self._seen_s[uav] = sign, now
            elif now - seen_s > _MAX_SILENCE_S:
                raise NoAnswer(
                    f"UAV {uav} does not seem alive: for {_MAX_SILENCE_S:g} s "
                    "it has not been heard, and its process has not computed"
                )


class _Start:
    def __init__(self, client: Client, ids: list[int], on_start: Tell, on_message: Tell) -> None:
        self._client, self._ids = client, ids
        self._on_start, self._on_message = on_start, on_message

    async def bring(self, scenario: Scenario, start: bool) -> None:
        await self._wait_for_all()
        parts = {**scenario.areas()._asdict(), "mission": scenario.mission_items()}
        for part, items in parts.items():
            if items:
                upload = partial(self._upload, items=items, part=part)
                is_profile = part == "mission" and scenario.mission is None
                others = scenario.foreign if is_profile else ()  # a profile is a law of ours
                await self._each(f"have their {part}", upload, others)
        for uav_id, fault in scenario.fault_commands():
            await self._vehicle(uav_id).set_fault(fault)
        if start:
            await self._each("have started it", partial(start_vehicle, scenario=scenario))
            await self._each("are armed", Vehicle.arm)

    def _vehicle(self, uav: int) -> Vehicle:
        return self._client.vehicle(uav).with_patience(ENDLESS)

    def _tell(self, done: int, what: str) -> None:
        self._on_start(f"{done} of {len(self._ids)} UAVs {what}")

    async def _wait_for_all(self) -> None:
        client, ids = self._client, self._ids
        while waiting := client.not_ready(ids):
            self._tell(len(ids) - len(waiting), "are ready")
            await client.until(lambda: client.not_ready(ids) != waiting, _LOOK_S)

    async def _each(
        self,
        what: str,
        work: Callable[[Vehicle], Awaitable[None]],
        others: Collection[int] = (),
    ) -> None:
        """Do some work with every UAV but others, a few of them at a time: each answers at once."""
        turns, done = asyncio.Semaphore(_AT_A_TIME), 0

        async def in_turn(uav: int) -> None:
            nonlocal done
            async with turns:
                await work(self._vehicle(uav))
            done += 1
            self._tell(done, what)

        await asyncio.gather(*(in_turn(uav) for uav in self._ids if uav not in others))

    async def _upload(self, vehicle: Vehicle, items: Mission, part: str = "mission") -> None:
        """Upload a part of the plan, again if another station's upload came between."""
        uploads = {
            "fence": vehicle.upload_fence,
            "rally": vehicle.upload_rally,
            "mission": vehicle.upload_mission,
        }
        for left in reversed(range(_UPLOADS)):
            try:
                await uploads[part](items)
            except CommandRefused as problem:
                if problem.result not in _OF_ANOTHER or not left:
                    raise
                if left == _UPLOADS - 1:
                    self._on_message(f"{problem}; another station uploads, too: trying again")
                await asyncio.sleep(_PAUSE_S)
            else:
                return
