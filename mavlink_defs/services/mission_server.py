"""The mission microservice (https://mavlink.io/en/services/mission.html), vehicle side.

Missions, fences and rally points are transferred alike: one server holds the items of one type.
"""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from mavlink_defs import dialect
from mavlink_defs.dialect import (
    MAVLink_message,
    MAVLink_mission_ack_message,
    MAVLink_mission_clear_all_message,
    MAVLink_mission_count_message,
    MAVLink_mission_current_message,
    MAVLink_mission_item_int_message,
    MAVLink_mission_item_message,
    MAVLink_mission_request_int_message,
    MAVLink_mission_request_list_message,
    MAVLink_mission_request_message,
    MAVLink_mission_request_partial_list_message,
    MAVLink_mission_set_current_message,
    MAVLink_mission_write_partial_list_message,
)
from mavlink_defs.profile import MAX_ITEMS, ProfileError
from mavlink_defs.services.command_server import LATE_S
from mavlink_defs.services.machine import SLOW_S, Machine, SystemId, is_for, sender_of
from mavlink_defs.services.mission import ITEM_TIMEOUT_S, MAX_RETRIES, MissionItem, item_as_int
from mavlink_defs.services.mission_upload import Upload, UploadClient

_MISSION, _ALL = dialect.MAV_MISSION_TYPE_MISSION, dialect.MAV_MISSION_TYPE_ALL
_NAMES = {
    _MISSION: "Mission",
    dialect.MAV_MISSION_TYPE_FENCE: "Fence",
    dialect.MAV_MISSION_TYPE_RALLY: "Rally",
}
_NO_MISSION = 0xFFFF
_MAX_READERS = 16
_GUIDED_ITEM, _ALTITUDE_ITEM = 2, 3  # `current` of an item that is no part of an upload
ON_ITS_OWN = (_GUIDED_ITEM, _ALTITUDE_ITEM)
_SILENCE_S = 30.0
"""Silence of a client after which its upload is cancelled."""
_LATE_AFTER = 3
"""Ignored requests after which a client that is heard is asked every `SLOW_S` only."""


@dataclass(frozen=True)
class MissionAccepted:
    """A new mission is in force; without items (or with home alone) it has been cleared."""

    items: tuple[MissionItem, ...]


@dataclass(frozen=True)
class MissionRefused:
    """Something was refused; the mission in force is as before.

    Attributes:
        result: MAV_MISSION_RESULT.
        text: Text for a STATUSTEXT.
    """

    result: int
    text: str


MissionEvent: TypeAlias = MissionAccepted | MissionRefused


class MissionServer(Machine[MissionEvent]):
    """Holds the mission of one vehicle, or another list of that type, and answers every client.

    A mission is replaced only when the new one is complete and valid. Messages of other types are
    answered UNSUPPORTED; `mission_types.MissionTypes` hands each server what is of its own type.
    One client can upload at a time, and begins again with another
    MISSION_COUNT; any number can download, and a download is cancelled if the mission changes
    meanwhile, so that none is a mixture.

    Two ground stations may have the same address by mistake. Their uploads are not mixed: from
    another station the second one is denied; from the same one it takes the place of the first,
    and is cancelled with it when items are seen to differ.

    The vehicle keeps `mission_state` (MISSION_STATE) and `mission_mode` (of MISSION_CURRENT)
    up to date, and broadcasts `mission_current()` at its own rate besides.

    Attributes:
        items: The mission in force, home included.
        revision: Counts the missions that were in force.
        current: Number of the current item.
        asking: The station that the addressed messages to send are for.
    """

    def __init__(
        self,
        own: SystemId,
        validate: Callable[[Sequence[MissionItem]], None],
        max_items: int = MAX_ITEMS,
        home: Callable[[], MissionItem] | None = None,
        guide: Callable[[MissionItem], int] | None = None,
        jump: Callable[[int], bool] | None = None,
        mission_type: int = _MISSION,
    ) -> None:
        """Start without a mission.

        Args:
            own: SystemId of the vehicle.
            validate: Raises ProfileError for a mission that the vehicle cannot fly.
            max_items: Most items that a mission may have, home included.
            home: Returns what item 0 of every mission is, whatever was uploaded; None leaves it.
            guide: Flies to an item that is sent on its own, as ArduPilot's clients do by `current`
                = 2, and returns MAV_MISSION_RESULT; None refuses it.
            jump: Goes on with an item that is there; False, all as it was, if that cannot be flown.
            mission_type: MAV_MISSION_TYPE of the items.
        """
        super().__init__()
        self._type, self._name = mission_type, _NAMES[mission_type]
        self._own, self._validate, self._max_items = own, validate, max_items
        self._home, self._guide, self._jump = home, guide, jump
        self.items: tuple[MissionItem, ...] = ()
        self.current = 0
        self._upload: Upload | None = None
        self.revision = 0
        self._readers: dict[UploadClient, int] = {}  # of downloads: revision that they read
        self.mission_state = 0
        self.mission_mode = 0
        self.asking = 0

    def set_current(self, seq: int) -> bool:
        """Make `seq` the current item and announce it; False if there is no such item."""
        if not 0 <= seq < len(self.items):
            return False
        self.current = seq
        self._outbox.append(self.mission_current())
        return True

    def go_to(self, seq: int) -> bool:
        """Continue the mission with item `seq`; False, and all is as it was, if it cannot."""
        if not 0 <= seq < len(self.items):
            text = f"Mission has no item {seq} to go to"
            self._happened.append(MissionRefused(dialect.MAV_MISSION_INVALID_SEQUENCE, text))
            return False
        if self._jump is not None and not self._jump(seq):
            return False
        return self.set_current(seq)

    def restore(self, items: tuple[MissionItem, ...], current: int) -> None:
        """Put a mission in force again that was accepted before, without announcing it."""
        home = items[:1] if self._home is None else (self._home(),)
        self.items, self.current = (*home, *items[1:]) if items else (), current

    def clear(self) -> None:
        """Drop the mission, and an upload in progress."""
        self._upload = None
        self._replace(())

    def refresh_home(self) -> None:
        """Let item 0 be what `home` returns now; a download in progress begins again."""
        if self.items and self._home is not None:
            self.items = (self._home(), *self.items[1:])
            self.revision += 1

    def mission_current(self) -> MAVLink_mission_current_message:
        """Return the MISSION_CURRENT of the current item; home does not count in its total."""
        total = len(self.items) - 1 if len(self.items) > 1 else _NO_MISSION
        return MAVLink_mission_current_message(
            self.current, total, self.mission_state, self.mission_mode
        )

    def receive(self, message: MAVLink_message, now: float, station: int = 0) -> None:
        """Take in any message; of the mission protocol the ones for us are answered.

        Args:
            message: The message.
            now: Time [s].
            station: Identifies the sender's link; answers must go back over it.
        """
        if not is_for(message, self._own):
            return
        sender = UploadClient(sender_of(message), station)
        upload = self._going_on()
        if upload is not None and upload.sender == sender:
            upload.heard_s = now
        self.asking = station
        match message:
            case MAVLink_mission_count_message():
                self._on_count(message, sender, now)
            case MAVLink_mission_item_int_message() | MAVLink_mission_item_message():
                self._on_item(message, sender, now)
            case MAVLink_mission_request_list_message():
                self._on_request_list(message, sender)
            case MAVLink_mission_request_int_message() | MAVLink_mission_request_message():
                self._on_request(message.seq, message.mission_type, sender)
            case MAVLink_mission_clear_all_message():
                self._on_clear(message, sender)
            case MAVLink_mission_ack_message():
                self._on_ack(message, sender)
            case MAVLink_mission_set_current_message() if self._type == _MISSION:
                self.go_to(message.seq)
            case (
                MAVLink_mission_write_partial_list_message()
                | MAVLink_mission_request_partial_list_message()
            ):
                self._ack(sender, message.mission_type, dialect.MAV_MISSION_UNSUPPORTED)

    def handle_timer(self, now: float) -> None:
        """Request the awaited item again, or cancel the upload.

        On a busy machine a client may be late with everything: it has ignored a request only if
        it was heard since, and one that has ignored several is asked less often.
        """
        upload = self._going_on()
        if upload is None or now < upload.asked_s + _timeout_s(upload):
            return
        self.asking = upload.sender.station
        if upload.heard_s > upload.asked_s:
            upload.ignored += 1
        if upload.ignored > MAX_RETRIES or now - upload.heard_s > _SILENCE_S:
            self._end_stuck(upload)
        else:
            upload.retries += 1
            self._request_item(upload, now)

    def deadline(self) -> float | None:
        """Return the time at which an awaited item is requested again [s]."""
        upload = self._going_on()
        return None if upload is None else upload.asked_s + _timeout_s(upload)

    def _going_on(self) -> Upload | None:
        upload = self._upload
        return upload if upload is not None and upload.result is None else None

    def busy_for(self, sender: UploadClient) -> bool:
        """Return whether another client uploads; one that is stuck is made to give way."""
        upload = self._going_on()
        if upload is None or upload.sender == sender:
            return False
        if upload.retries < MAX_RETRIES:
            return True
        self._end_stuck(upload)
        return False

    def _end_stuck(self, upload: Upload) -> None:
        text = f"{self._name} upload: item {len(upload.items)} did not come"
        self._end_upload(upload, dialect.MAV_MISSION_OPERATION_CANCELLED, text)

    def _on_count(
        self, message: MAVLink_mission_count_message, sender: UploadClient, now: float
    ) -> None:
        mission_type, count = message.mission_type, message.count
        if self.busy_for(sender):
            self._ack(sender, mission_type, dialect.MAV_MISSION_DENIED)
            return
        before, sequence = self._going_on(), message.get_seq()
        if before and before.sequence == sequence and now <= before.begun_s + LATE_S:
            return  # the network has duplicated it
        # From the same client the upload begins again: it may be another mission.
        self._upload = upload = Upload(
            sender, mission_type, count, sequence=sequence, begun_s=now, heard_s=now
        )
        if mission_type != self._type:
            text = f"Mission type {mission_type} is not supported"
            self._end_upload(upload, dialect.MAV_MISSION_UNSUPPORTED, text)
        elif count > self._max_items:
            text = f"{self._name} has {count} items, at most {self._max_items} fit"
            self._end_upload(upload, dialect.MAV_MISSION_NO_SPACE, text)
        elif count == 0:  # the same as clearing
            self._replace(())
            self._end_upload(upload, dialect.MAV_MISSION_ACCEPTED)
        else:
            self._request_item(upload, now)

    def _on_item(
        self, item: MissionItem | MAVLink_mission_item_message, sender: UploadClient, now: float
    ) -> None:
        upload = self._upload
        if item.current in ON_ITS_OWN:
            guide = self._guide if item.current == _GUIDED_ITEM else None
            result = dialect.MAV_MISSION_UNSUPPORTED if guide is None else guide(item_as_int(item))
            self._ack(sender, item.mission_type, result)
        elif upload is None or (upload.sender, upload.mission_type) != (sender, item.mission_type):
            self._ack(sender, item.mission_type, dialect.MAV_MISSION_INVALID_SEQUENCE)
        elif upload.result is not None:
            # A repeated last item means that the answer was lost; other items are delayed.
            if upload.result != dialect.MAV_MISSION_ACCEPTED:
                self._ack(sender, item.mission_type, upload.result)
            elif item.seq == upload.count - 1:
                differs = upload.differs(item, -1)
                result = dialect.MAV_MISSION_INVALID_SEQUENCE if differs else upload.result
                self._ack(sender, item.mission_type, result)
        elif item.seq == len(upload.items):
            upload.items.append(item_as_int(item))
            upload.retries = upload.ignored = 0
            if len(upload.items) < upload.count:
                self._request_item(upload, now)
            else:
                self._complete(upload)
        elif item.seq > len(upload.items):
            self._request_item(upload, now)  # out of sequence: the expected one is requested
        elif upload.differs(item, item.seq):
            text = f"{self._name} upload: item {item.seq} came twice, with different contents"
            self._end_upload(upload, dialect.MAV_MISSION_OPERATION_CANCELLED, text)
        # A stored item came twice. A request now would double all that follow.

    def _complete(self, upload: Upload) -> None:
        try:
            self._validate(upload.items)
        except ProfileError as error:
            text = error.text if self._type == _MISSION else f"{self._name}: {error.text}"
            self._end_upload(upload, error.mav_mission_result, text)
        else:
            home = upload.items[:1] if self._home is None else [self._home()]
            self._replace((*home, *upload.items[1:]))
            self._end_upload(upload, dialect.MAV_MISSION_ACCEPTED)

    def _on_request_list(
        self, message: MAVLink_mission_request_list_message, sender: UploadClient
    ) -> None:
        mission_type = message.mission_type
        if mission_type != self._type:
            self._ack(sender, mission_type, dialect.MAV_MISSION_UNSUPPORTED)
            return
        count = len(self.items)
        self._readers.pop(sender, None)
        self._readers[sender] = self.revision
        if len(self._readers) > _MAX_READERS:
            del self._readers[next(iter(self._readers))]
        self._outbox.append(MAVLink_mission_count_message(*sender.address, count, mission_type))

    def _on_request(self, seq: int, mission_type: int, sender: UploadClient) -> None:
        if mission_type != self._type or seq >= len(self.items):
            self._ack(sender, mission_type, dialect.MAV_MISSION_INVALID_SEQUENCE)
        elif self._readers.get(sender, self.revision) != self.revision:
            # Until it asks for the list again: this answer can be lost, too.
            self._ack(sender, mission_type, dialect.MAV_MISSION_OPERATION_CANCELLED)
        else:
            item = copy.copy(self.items[seq])
            item.target_system, item.target_component = sender.address
            item.current = int(self._type == _MISSION and seq == self.current)
            self._outbox.append(item)

    def _on_clear(self, message: MAVLink_mission_clear_all_message, sender: UploadClient) -> None:
        mission_type = message.mission_type
        if mission_type not in {self._type, _ALL}:
            self._ack(sender, mission_type, dialect.MAV_MISSION_UNSUPPORTED)
        elif self.busy_for(sender):
            self._ack(sender, mission_type, dialect.MAV_MISSION_DENIED)
        else:
            self.clear()
            self._ack(sender, mission_type, dialect.MAV_MISSION_ACCEPTED)

    def _on_ack(self, message: MAVLink_mission_ack_message, sender: UploadClient) -> None:
        self._readers.pop(sender, None)
        upload = self._going_on()
        if upload is None or message.type == dialect.MAV_MISSION_ACCEPTED:
            return  # an acceptance ends a download
        if (upload.sender, upload.mission_type) == (sender, message.mission_type):
            upload.result = dialect.MAV_MISSION_OPERATION_CANCELLED  # by the sender itself

    def _replace(self, items: tuple[MissionItem, ...]) -> None:
        self.items, self.current = items, 0
        self.revision += 1
        self._happened.append(MissionAccepted(items))

    def _request_item(self, upload: Upload, now: float) -> None:
        upload.asked_s = now
        request = MAVLink_mission_request_int_message(
            *upload.sender.address, len(upload.items), upload.mission_type
        )
        self._outbox.append(request)

    def _end_upload(self, upload: Upload, result: int, text: str = "") -> None:
        upload.result = result
        upload.items = upload.items[-1:]
        self._ack(upload.sender, upload.mission_type, result)
        if result != dialect.MAV_MISSION_ACCEPTED:
            self._happened.append(MissionRefused(result, text))

    def _ack(self, sender: UploadClient, mission_type: int, result: int) -> None:
        self._outbox.append(MAVLink_mission_ack_message(*sender.address, result, mission_type))


def _timeout_s(upload: Upload) -> float:
    return ITEM_TIMEOUT_S if upload.ignored < _LATE_AFTER else SLOW_S
