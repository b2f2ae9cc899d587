"""The known state of all vehicles. No socket and no clock, like `VehicleState`."""

from gcs.station.notifications import NOTICE, Notification
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect
from mavlink_defs.capture.saving import saving
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.services.machine import sender_of


class FleetState:
    """Vehicles by system id, discovered by their HEARTBEATs.

    Attributes:
        vehicles: The vehicles heard so far, lost ones included.
        unconfirmed: Systems that have sent something, but no HEARTBEAT yet.
    """

    def __init__(self) -> None:
        self.vehicles: dict[int, VehicleState] = {}
        self.unconfirmed: set[int] = set()

    def receive(self, message: MAVLink_message, now: float) -> list[Notification]:
        """Process any message."""
        sender = sender_of(message)
        state = self.vehicles.get(sender.system)
        if state is not None:
            return state.receive(message, now) if state.address == sender else []
        if sender.component != dialect.MAV_COMP_ID_AUTOPILOT1:
            return []
        if not isinstance(message, dialect.MAVLink_heartbeat_message):
            self.unconfirmed.add(sender.system)
            return []
        if message.type == dialect.MAV_TYPE_GCS:
            return []
        state = self.vehicles[sender.system] = VehicleState(sender, now)
        self.unconfirmed.discard(sender.system)
        found = Notification(now, sender.system, "link", NOTICE, "vehicle found")
        return [found, *state.receive(message, now)]

    def handle_timer(self, now: float) -> list[Notification]:
        """Detect lost links; call it often."""
        return [
            notifications
            for state in self.vehicles.values()
            for notifications in state.handle_timer(now)
        ]

    @property
    def missing(self) -> list[int]:
        """Members of the fleets of these vehicles that were not heard, or are lost; ascending."""
        members = frozenset[int]().union(*(state.fleet for state in self.vehicles.values()))
        present = {system for system, state in self.vehicles.items() if not state.lost}
        return sorted(members - present)

    @property
    def events(self) -> int:
        """Events of all vehicles and channels."""
        return sum(state.counts.total for state in self.vehicles.values())

    @property
    def saving(self) -> float | None:
        """Share of all periodic transmissions that was saved; None before any step."""
        steps = sum(state.counts.steps for state in self.vehicles.values())
        return saving(self.events, steps)
