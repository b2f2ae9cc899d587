"""Telemetry of one autopilot to one ground station: available messages, streams, rates.

Intervals count simulated time while it runs, so that a flight faster than real time is as
finely resolved as any, and wall-clock time while the aircraft is frozen.

Making and sending a message takes time that the next control step should not wait for. So no more
than a few are made between two steps, the most overdue first; and each message has its
own phase, so that few are due at a time.
"""

import math
from collections.abc import Callable, Collection, Sequence

from ftc_autopilot.vehicle.controller_messages import ControllerMessages
from ftc_autopilot.vehicle.diagnosis_messages import DiagnosisMessages
from ftc_autopilot.vehicle.estimator_messages import EstimatorMessages
from ftc_autopilot.vehicle.fence import VehicleFence
from ftc_autopilot.vehicle.formation_messages import FormationMessages
from ftc_autopilot.vehicle.message import declared_in
from ftc_autopilot.vehicle.mission import Mission
from ftc_autopilot.vehicle.path_messages import PathMessages
from ftc_autopilot.vehicle.runway import RunwayMessages
from ftc_autopilot.vehicle.sensor_messages import SensorMessages, TrueStateSensors
from ftc_autopilot.vehicle.state_messages import StateMessages
from ftc_autopilot.vehicle.status_messages import StatusMessages
from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.dialect import MAVLink_message

MAKERS = (
    StateMessages,
    TrueStateSensors,
    SensorMessages,
    PathMessages,
    ControllerMessages,
    DiagnosisMessages,
    EstimatorMessages,
    FormationMessages,
    StatusMessages,
    Mission,
    VehicleFence,
    RunwayMessages,
)
"""Classes whose methods make messages; a vehicle has one of the two of sensors."""

_DECLARED = tuple(declared_in(*MAKERS))

DEFAULT_INTERVALS_US = {
    each.number: each.every_us
    for each in sorted(_DECLARED, key=lambda each: (each.every_us or 0, each.number))
    if each.every_us is not None
}
"""Message ids that are streamed from the start, and their intervals [µs], the shortest first."""

MIN_INTERVAL_US = 20_000
"""No message is streamed more often."""

_HEARTBEAT_US = 1_000_000  # it cannot be changed
_PHASE_US = 1_000  # between the first messages of two streams
_MAX_INTERVAL_US = INT32_MAX  # of MESSAGE_INTERVAL
_OFF, _NOT_AVAILABLE = -1, 0
_NEW = -1  # when a stream is due whose phase is not set [µs]: at once


class Telemetry:
    """Determines which messages are due, and makes them."""

    def __init__(self, *makers: object) -> None:
        """Start with the default intervals.

        Args:
            makers: Objects of the classes of `MAKERS`, which make the messages. What is not known
                now makes none.
        """
        self._makers: dict[int, Callable[[], MAVLink_message | None]] = {
            each.number: getattr(maker, each.maker)
            for maker in makers
            for each in declared_in(type(maker))
        }
        self._intervals_us = dict(DEFAULT_INTERVALS_US)
        order = dict.fromkeys((*DEFAULT_INTERVALS_US, *self._makers))
        self._phases_us = {i: k * _PHASE_US % MIN_INTERVAL_US for k, i in enumerate(order)}
        self._due_us = dict.fromkeys(self._intervals_us, _NEW)

    def receive(self, message: MAVLink_message) -> None:
        """Take in a REQUEST_DATA_STREAM, the old way to ask for rates [Hz]."""
        if isinstance(message, dialect.MAVLink_request_data_stream_message):
            starts = bool(message.start_stop) and message.req_message_rate > 0
            interval_us = 1e6 / message.req_message_rate if starts else -1.0
            of_all = message.req_stream_id == dialect.MAV_DATA_STREAM_ALL
            for each in _DECLARED:
                if (
                    each.number in self._makers
                    and each.stream is not None
                    and (of_all or each.stream == message.req_stream_id)
                ):
                    self._set_interval(each.number, interval_us)

    def due(self, clock_us: int, most: int | None = None) -> list[MAVLink_message]:
        """Make the messages whose interval has passed on the given clock [µs].

        Args:
            clock_us: The clock.
            most: How many at most; the others come first at the next call. None: all.
        """
        overdue = []
        for message_id, interval_us in self._intervals_us.items():
            due_us = self._due_us[message_id]
            if due_us == _NEW or due_us > clock_us + interval_us:  # or the clock was set back
                due_us = self._due_us[message_id] = clock_us + self._phases_us[message_id]
            if due_us <= clock_us:
                overdue.append((due_us, message_id))
        chosen = [message_id for _, message_id in sorted(overdue)[:most]]
        for message_id in chosen:
            self._due_us[message_id] += self._intervals_us[message_id]
            if self._due_us[message_id] <= clock_us:  # what was missed is left out
                self._due_us[message_id] = clock_us + self._intervals_us[message_id]
        made = (self._makers[message_id]() for message_id in chosen)
        return [message for message in made if message is not None]

    def next_due_us(self) -> int:
        """Return when the next message is due, on the clock of `due` [µs]; far away if none is."""
        return min(self._due_us.values(), default=2**62)

    def shortest_interval_us(self) -> int:
        """Return the shortest interval of a stream [µs]; far away if there is none."""
        return min(self._intervals_us.values(), default=2**62)

    def most_per_step(self, step_us: int) -> int:
        """Return messages per control period [µs] that exceed all of them at the shortest interval.

        With this limit between two steps all rates are sustained, with room for answers.
        """
        return 1 + len(self._makers) * min(step_us, MIN_INTERVAL_US) // MIN_INTERVAL_US

    def streams(self, message_id: int) -> bool:
        """Return whether a message is sent periodically."""
        return message_id in self._intervals_us

    @property
    def available(self) -> Collection[int]:
        """Ids of all messages that can be made."""
        return self._makers.keys()

    def make(self, message_id: int) -> MAVLink_message | None:
        """Make one message, if it can be made now; its id must be among the makers'."""
        return self._makers[message_id]()

    # commands: params are from the MAV_CMD

    def set_interval(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_SET_MESSAGE_INTERVAL: id, µs; 0 restores the default, negative stops."""
        message_id, interval_us = _whole(params[0]), params[1]
        if message_id == dialect.MAVLINK_MSG_ID_HEARTBEAT and interval_us in {0.0, _HEARTBEAT_US}:
            return dialect.MAV_RESULT_ACCEPTED
        if message_id not in self._makers or not math.isfinite(interval_us):
            return dialect.MAV_RESULT_DENIED
        self._set_interval(message_id, interval_us)
        return dialect.MAV_RESULT_ACCEPTED

    def request(self, params: Sequence[float]) -> MAVLink_message | None:
        """Execute MAV_CMD_REQUEST_MESSAGE: return the message, None if there is none."""
        message_id = _whole(params[0])
        if message_id == dialect.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            return self.interval(params[1:])
        maker = self._makers.get(message_id)
        return None if maker is None else maker()

    def interval(self, params: Sequence[float]) -> MAVLink_message:
        """Execute MAV_CMD_GET_MESSAGE_INTERVAL: return the MESSAGE_INTERVAL of a message id."""
        message_id = _whole(params[0])
        interval_us = _OFF if message_id in self._makers else _NOT_AVAILABLE
        interval_us = self._intervals_us.get(message_id, interval_us)
        if message_id == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            interval_us = _HEARTBEAT_US
        return dialect.MAVLink_message_interval_message(message_id & 0xFFFF, interval_us)

    def _set_interval(self, message_id: int, interval_us: float) -> None:
        chosen_us: int | None = round(min(max(interval_us, MIN_INTERVAL_US), _MAX_INTERVAL_US))
        if interval_us == 0.0:
            chosen_us = DEFAULT_INTERVALS_US.get(message_id)
        if chosen_us is None or interval_us < 0.0:
            self._intervals_us.pop(message_id, None)
            self._due_us.pop(message_id, None)
            return
        if self._intervals_us.get(message_id) != chosen_us:
            self._intervals_us[message_id] = chosen_us
            self._due_us[message_id] = _NEW


def _whole(value: float) -> int:
    """Return a parameter as a whole number; -1 if it is none."""
    return int(value) if math.isfinite(value) and value == int(value) else -1
