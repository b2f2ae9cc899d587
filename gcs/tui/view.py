"""The data that widgets read: vehicles, events and faults, as of the last refresh.

`DataSource` is where it all comes from: a running fleet (`LiveSource`), or a telemetry log
(`gcs.tui.playback`). `FleetView` adds what the operator has chosen.
"""

from collections.abc import Callable
from typing import Protocol

from gcs.station.fleet_state import FleetState
from gcs.station.notifications import Notification
from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_state import VehicleState
from gcs.tui.event_log import EventLog
from gcs.tui.fault_history import FaultHistory
from gcs.tui.guard import Guarded

SILENT_S = 1.5
"""Silence after which a vehicle is shown as silent; its notification comes later [s]."""

_AGEING_S = 0.5


class FleetClient(Protocol):
    """The part of a client that the dashboard uses."""

    @property
    def fleet(self) -> FleetState:
        """The state of the vehicles."""
        ...

    def now(self) -> float:
        """Return the time on its clock [s]."""
        ...

    def vehicle(self, system: int) -> Vehicle:
        """Return a vehicle that was heard."""
        ...


class DataSource(Protocol):
    """A source of the dashboard's data: a running fleet or a log."""

    title: str
    read_only: str
    """Why nothing can be done with its vehicles, such as "this is a log"; "" if it can."""
    offers_files: bool
    """Whether files of this machine can be looked at: not by who may only look at vehicles."""
    event_log: EventLog
    fault_history: FaultHistory

    @property
    def fleet(self) -> FleetState:
        """The state of the vehicles."""
        ...

    def now(self) -> float:
        """Return the time on the clock of the data [s]."""
        ...

    def paced_by(self) -> float:
        """Return the time that drawing is paced by [s]: `now`, or the position in a log."""
        ...

    def since_1970(self, at: float) -> float:
        """Convert a time of that clock to time since 1970 [s]."""
        ...

    def vehicle(self, system: int) -> Vehicle:
        """Return a vehicle to send requests to.

        Raises:
            KeyError: It was not heard of, or the source is `read_only`.
        """
        ...


class LiveSource:
    """A running fleet. Give `receive` to the client as `on_notification`, then `attach` it."""

    def __init__(
        self,
        title: str,
        epoch: float,
        identity: tuple[int, int] = (255, 190),
        *,
        read_only: str = "",
    ) -> None:
        """Make a source without a client.

        Args:
            title: What is shown as the connection.
            epoch: Time since 1970 when the client's clock showed 0 [s].
            identity: System and component id of the station.
            read_only: Why nothing may be sent to vehicles; "" if it may.
        """
        self.title, self.read_only, self.offers_files = title, read_only, not read_only
        self.event_log, self.fault_history = EventLog(), FaultHistory(identity)
        self._epoch = epoch
        self._client: FleetClient | None = None

    def attach(self, client: FleetClient) -> None:
        """Take the data from this client."""
        self._client = client

    @property
    def _attached(self) -> FleetClient:
        if self._client is None:
            raise RuntimeError("attach a client before the data are read")
        return self._client

    def receive(self, notifications: Notification) -> None:
        """Take in notifications of the client."""
        state = self.fleet.vehicles.get(notifications.system) if self._client else None
        at = self.since_1970(notifications.at)
        self.event_log.receive(notifications, at, state.time_s if state else None)
        self.fault_history.receive(notifications, at)
        if state is not None:
            self.fault_history.update(state, at)

    @property
    def fleet(self) -> FleetState:
        """The state of the vehicles."""
        return self._attached.fleet

    def now(self) -> float:
        """Return the time on the client's clock [s]."""
        return self._attached.now()

    def paced_by(self) -> float:
        """Return the same."""
        return self.now()

    def since_1970(self, at: float) -> float:
        """Convert a time of the client's clock to time since 1970 [s]."""
        return self._epoch + at

    def vehicle(self, system: int) -> Vehicle:
        """Return a vehicle to send requests to; KeyError if there is none, or none may be sent."""
        if self.read_only:
            raise KeyError(system)
        return self._attached.vehicle(system)


class FleetView:
    """Vehicles as of the last `update`, and the operator's choice among them.

    Attributes:
        source: Where the data come from.
        now: Time of the last update, on the clock of the source [s].
        paced_by_s: The same on the clock that drawing is paced by [s].
        states: The vehicles in ascending order, lost ones included.
        marked: System ids that actions are for; none means the selected one.
    """

    def __init__(self, source: DataSource) -> None:
        self.source = source
        self.now = self.paced_by_s = 0.0
        self.states: tuple[VehicleState, ...] = ()
        self._chosen: int | None = None
        self.marked: set[int] = set()
        self._token: object = None

    def update(self) -> bool:
        """Update the states; return whether there is anything new to show."""
        source = self.source
        self.now, self.paced_by_s = source.now(), source.paced_by()
        vehicles = source.fleet.vehicles
        self.states = tuple(vehicles[system] for system in sorted(vehicles))
        for state in self.states:
            source.fault_history.update(state, source.since_1970(self.now))
        self.marked &= vehicles.keys()
        heard = tuple((state.system, state.heard_at) for state in self.states)
        ages = any(state.age_s(self.now) > _AGEING_S for state in self.states)
        ageing = round(self.now, 1) if ages else None
        token = (heard, ageing, source.event_log.count, self.selected, frozenset(self.marked))
        changed, self._token = token != self._token, token
        return changed

    @property
    def selected(self) -> int | None:
        """The vehicle that the operator chose, else the first one."""
        if self._chosen in self.source.fleet.vehicles:
            return self._chosen
        return self.states[0].system if self.states else None

    def select(self, system: int) -> None:
        """Choose a vehicle."""
        self._chosen = system

    @property
    def state(self) -> VehicleState | None:
        """The selected vehicle."""
        return next((s for s in self.states if s.system == self.selected), None)

    @property
    def systems(self) -> tuple[int, ...]:
        """All system ids, ascending."""
        return tuple(state.system for state in self.states)

    @property
    def targets(self) -> tuple[int, ...]:
        """The vehicles that actions are for: the marked ones, else the selected one."""
        if self.marked:
            return tuple(sorted(self.marked))
        return () if self.selected is None else (self.selected,)

    def is_silent(self, state: VehicleState) -> bool:
        """Return whether nothing has come from a vehicle for `SILENT_S`."""
        return state.lost or state.age_s(self.now) >= SILENT_S

    def select_next(self, step: int) -> None:
        """Select the vehicle `step` further in the list, which wraps around."""
        systems = self.systems
        if systems:
            at = systems.index(self.selected) if self.selected is not None else 0
            self._chosen = systems[(at + step) % len(systems)]

    def first(self, condition: Callable[[VehicleState], bool]) -> int | None:
        """Return the first vehicle, from the selected one on, that meets a condition."""
        systems = self.systems
        at = systems.index(self.selected) if self.selected is not None else 0
        order = (*self.states[at:], *self.states[:at])
        return next((state.system for state in order if condition(state)), None)


class Panel(Guarded):
    """A widget that shows the vehicles; mixed in before another widget class."""

    def show_view(self, view: FleetView) -> None:
        """Draw what has changed."""
        raise NotImplementedError
