"""Commands that request a message, or set the interval of one, from the station that asks."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from ftc_autopilot.vehicle.commands import Handler
from ftc_autopilot.vehicle.telemetry import MIN_INTERVAL_US, Telemetry
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message

_OLDER_REQUESTS = {  # commands that ask for one message
    dialect.MAV_CMD_GET_HOME_POSITION: dialect.MAVLINK_MSG_ID_HOME_POSITION,
    dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
}


class MessageRequests:
    """Answers what ground stations ask for beyond the default streams.

    Attributes:
        station: Number of the ground station whose command is being executed.
    """

    def __init__(
        self,
        telemetry: Sequence[Telemetry],
        others: Mapping[float, Callable[[], MAVLink_message]],
        queue: Callable[[Sequence[MAVLink_message], int], None],
        say: Callable[[int, str], None],
    ) -> None:
        """Start.

        Args:
            telemetry: Of each ground station.
            others: What makes the messages that are no telemetry, by message id.
            queue: Takes messages and the number of the ground station they are for.
            say: Takes severity and text of a STATUSTEXT.
        """
        self.station = 0
        self._telemetry, self._others = telemetry, others
        self._queue, self._say = queue, say

    def handlers(self) -> dict[int, Handler]:
        """Return what executes each command."""
        older = {command: partial(self._request_one, i) for command, i in _OLDER_REQUESTS.items()}
        return {
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            dialect.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            dialect.MAV_CMD_REQUEST_MESSAGE: self._request,
            **older,
        }

    def _request(self, params: tuple[float, ...]) -> int:
        telemetry, make = self._telemetry[self.station], self._others.get(params[0])
        message = make() if make else telemetry.request(params)
        if message is None and params[0] in telemetry.available:  # it is not known yet
            return dialect.MAV_RESULT_TEMPORARILY_REJECTED
        if message is None:
            return dialect.MAV_RESULT_UNSUPPORTED
        self._queue([message], self.station)
        return dialect.MAV_RESULT_ACCEPTED

    def _request_one(self, message_id: int, _: tuple[float, ...]) -> int:
        return self._request((float(message_id),))

    def _set_interval(self, params: tuple[float, ...]) -> int:
        telemetry = self._telemetry[self.station]
        result = telemetry.set_interval(params)
        if result == dialect.MAV_RESULT_ACCEPTED and 0.0 < params[1] < MIN_INTERVAL_US:
            text = f"interval is {params[1]:g} us, must be >= {MIN_INTERVAL_US} us, which it is now"
            self._say(dialect.MAV_SEVERITY_NOTICE, f"Message {params[0]:g}: {text}")
            self._queue([telemetry.interval(params)], self.station)
        return result

    def _get_interval(self, params: tuple[float, ...]) -> int:
        self._queue([self._telemetry[self.station].interval(params)], self.station)
        return dialect.MAV_RESULT_ACCEPTED
