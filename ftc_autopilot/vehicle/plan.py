"""The plan of one vehicle, as ground stations call it: mission, fence and rally points."""

from collections.abc import Callable, Sequence

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.guidance.fence_parameters import FenceRecords
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.fence import VehicleFence
from ftc_autopilot.vehicle.mission import Mission
from ftc_autopilot.vehicle.mission_checkpoint import MissionCheckpoint
from ftc_autopilot.vehicle.modes import Modes, Say
from ftc_autopilot.vehicle.rally import VehicleRally
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.profile import ItemError
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission import MissionItem
from mavlink_defs.services.mission_types import MissionTypes

_MISSION, _FENCE, _RALLY = (
    dialect.MAV_MISSION_TYPE_MISSION,
    dialect.MAV_MISSION_TYPE_FENCE,
    dialect.MAV_MISSION_TYPE_RALLY,
)


class VehiclePlan:
    """Receives the parts of a plan by the mission protocol, and fits them together.

    Attributes:
        mission: The mission.
        fence: The fence.
        rally: The rally points.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        hot: HotState,
        modes: Modes,
        guide: Callable[[MissionItem], int],
        records: FenceRecords,
        clock: VehicleClock,
        say: Say,
    ) -> None:
        """Hold nothing.

        Args:
            config: The configuration.
            hot: What the compiled loop knows.
            modes: Modes of the vehicle.
            guide: As of `Mission`.
            records: Parameters of fence and rally points.
            clock: The time since boot.
            say: Announces a text.
        """
        own = SystemId(config.id, dialect.MAV_COMP_ID_AUTOPILOT1)
        self._home, self._path, self._say = modes.path.home, modes.path, say
        self.fence = VehicleFence(own, config.origin, records.fence, modes, hot, clock, say)
        self.mission = Mission(own, modes, self._home, guide, self.fence.enable, say)
        self.rally = VehicleRally(own, config.origin, records.rally, self._path, self.fence, say)
        self._servers = {
            _MISSION: self.mission.server,
            _FENCE: self.fence.server,
            _RALLY: self.rally.server,
        }
        self._types = MissionTypes(own, self._servers)
        self._saved: tuple[int, MissionCheckpoint] | None = None

    def receive(self, message: MAVLink_message, now: float, station: int) -> None:
        """Take in a message of a ground station, which has a number."""
        self._types.receive(message, now, station)
        self._handle_events()

    def handle_timer(self, now: float) -> None:
        """Do what is due, and follow the flight."""
        self._types.handle_timer(now)
        self.mission.follow()
        self._handle_events()
        self.fence.handle_timer()

    def deadline(self) -> float | None:
        """Return when `handle_timer` is to be called [s]; None if no timer runs."""
        return self._types.deadline()

    def messages_to_send(self) -> list[tuple[MAVLink_message, int | None]]:
        """Hand over what is to be sent, and the number of the station; None: to all."""
        return [*self.mission.reached(), *self._types.messages_to_send()]

    def note_home(self) -> None:
        """Follow a home that was moved."""
        self.mission.server.refresh_home()
        home = self._home.at
        if self.fence.watch.room((home.north_m, home.east_m, home.height_m)) < 0.0:
            self._say(dialect.MAV_SEVERITY_WARNING, "home is outside the fence")

    def restart(self) -> None:
        """Return to the state after the uploads, for another flight."""
        self.mission.restart()
        self.fence.restart()

    # checkpoints

    def checkpoint(self) -> tuple[int, MissionCheckpoint]:
        """Return the plan, and a number that changes with it."""
        servers, states = self._servers.values(), (self.fence.state(), self.rally.state())
        home, airspeed = self._home.at, self._path.airspeed
        number = hash((*(server.revision for server in servers), airspeed, home, states))
        if self._saved is None or self._saved[0] != number:
            items = tuple(item for server in servers for item in server.items)
            self._saved = number, MissionCheckpoint(items, home, airspeed, states)
        return self._saved

    def resume(
        self, saved: MissionCheckpoint | None, profile: list[MissionItem], item: int
    ) -> None:
        """Go on from a checkpoint.

        Args:
            saved: The plan; None: there is none but, perhaps, a profile.
            profile: Its items, home included.
            item: Item of the mission that is flown.
        """
        if saved is None:
            self.mission.resume(profile, item)
            return
        self._home.at, self._path.airspeed = saved.home, saved.airspeed
        mission, fence, rally = (
            [item for item in saved.items if item.mission_type == kind] for kind in self._servers
        )
        self.mission.resume(mission, item)
        self.fence.resume(fence, saved.states[0])
        self.rally.resume(rally, saved.states[1])

    # inside

    def _handle_events(self) -> None:
        mission, fence, rally = (
            part.handle_events() for part in (self.mission, self.fence, self.rally)
        )
        if self.fence.watch.is_empty:
            return
        if fence or rally:
            self.rally.tell_if_outside()
        if (mission or fence) and self._path.items:
            self._tell_if_left(self._path.items)

    def _tell_if_left(self, items: Sequence[MissionItem]) -> None:
        """Warn of a mission that leaves the fence; ArduPlane takes it as well."""
        try:
            path = self._path.planner.path(items, home=self._home.at)
        except ItemError:  # of another home
            return
        if (item := self.fence.watch.left_by(path)) is not None:
            text = f"the mission leaves the fence on the way to item {item}"
            self._say(dialect.MAV_SEVERITY_WARNING, text)
