"""Short answers of a vehicle: ping, time, and refusals of services that it does not have.

https://mavlink.io/en/services/ping.html, timesync.html, ftp.html; the log download is
ArduPilot's. Requests for files or logs are answered at once with "none", so that no client waits.
"""

from mavlink_defs import dialect
from mavlink_defs.services.machine import Machine, SystemId, is_for, sender_of

_FTP_SIZE = 251
_FTP_REQUESTS = range(1, 128)  # op codes; the others are answers
_FTP_NAK = 129
_FTP_UNKNOWN_COMMAND = 7
_MAX_NS = 2**63 - 1


class Responder(Machine[None]):
    """Answers single messages; it has no state."""

    def __init__(self, own: SystemId) -> None:
        super().__init__()
        self._own = own

    def receive(self, message: dialect.MAVLink_message, now: float) -> None:
        """Take in any message; answer those that need only an answer.

        Args:
            message: The message.
            now: Time by the clock that the vehicle's time stamps have [s].
        """
        if not is_for(message, self._own):
            return
        sender = sender_of(message)
        match message:
            case dialect.MAVLink_ping_message(target_system=0, target_component=0):
                answer = dialect.MAVLink_ping_message(message.time_usec, message.seq, *sender)
                self._outbox.append(answer)
            case dialect.MAVLink_timesync_message(tc1=0):
                own_ns = min(max(round(now * 1e9), 1), _MAX_NS)
                self._outbox.append(dialect.MAVLink_timesync_message(own_ns, message.ts1))
            case dialect.MAVLink_file_transfer_protocol_message():
                self._refuse_file(message, sender)
            case dialect.MAVLink_log_request_list_message():
                self._outbox.append(dialect.MAVLink_log_entry_message(0, 0, 0, 0, 0))

    def handle_timer(self, now: float) -> None:
        """Do nothing: nothing is ever due."""

    def deadline(self) -> float | None:
        """Return None: nothing is ever awaited."""
        return None

    def _refuse_file(
        self, message: dialect.MAVLink_file_transfer_protocol_message, sender: SystemId
    ) -> None:
        sequence, session, opcode = (
            message.payload[0] | message.payload[1] << 8,
            message.payload[2],
            message.payload[3],
        )
        if opcode not in _FTP_REQUESTS:
            return
        following = (sequence + 1) & 0xFFFF
        head = [following & 0xFF, following >> 8, session, _FTP_NAK, 1, opcode, 0, 0]
        payload = [*head, 0, 0, 0, 0, _FTP_UNKNOWN_COMMAND]
        payload += [0] * (_FTP_SIZE - len(payload))
        self._outbox.append(dialect.MAVLink_file_transfer_protocol_message(0, *sender, payload))
