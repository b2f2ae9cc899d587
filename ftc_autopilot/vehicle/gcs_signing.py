"""Signing on the GCS link: verification of frames, and SETUP_SIGNING, which changes the key.

No socket: frames go in and out.
"""

import ipaddress

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import drop_reason, parse
from mavlink_defs.framing.key_file import load_signer
from mavlink_defs.framing.signing import Signer, is_ahead


class GcsSigning:
    """Signs and checks the frames of the GCS link, if there is a key.

    The key is the key file's until a ground station sets another one, for as long as the
    process lives and for this link only.
    """

    def __init__(self, system: int, key_file: str | None) -> None:
        """Make the signing of one GCS link.

        Args:
            system: Own system id.
            key_file: None: open until a ground station brings a key.

        Raises:
            SigningError: The key cannot be used.
        """
        self._system = system
        self._signer = load_signer(key_file)

    def accept(self, datagram: bytes) -> MAVLink_message | DropReason:
        """Return the message of a datagram, or why it holds none or must not be believed."""
        wrong = None if self._signer is None else self._signer.problem(datagram)
        return wrong or parse(datagram) or drop_reason(datagram)

    def sign(self, frame: bytes) -> bytes:
        """Return a frame as it is to be sent."""
        return frame if self._signer is None else self._signer.sign(frame)

    def set_key(
        self, message: dialect.MAVLink_setup_signing_message, host: str, armed: bool
    ) -> str | None:
        """Adopt the key of an accepted SETUP_SIGNING; zeros mean none.

        Args:
            message: The message. If there is a key, it was signed with it.
            host: IPv4 address that it came from; without a key it must be this machine.
            armed: In flight the key stays.

        Returns:
            The outcome as a text; None if the message is for another vehicle.
        """
        for_me = message.target_system == self._system
        if not for_me or message.target_component not in {0, dialect.MAV_COMP_ID_AUTOPILOT1}:
            return None
        if armed:
            return "signing: key refused, disarm first"
        if self._signer is None and not ipaddress.ip_address(host).is_loopback:
            return "signing: key refused, it must come from this machine"
        if is_ahead(message.initial_timestamp):
            given = message.initial_timestamp
            return f"signing: key refused, initial_timestamp {given} is more than 60 s ahead"
        key = bytes(message.secret_key)
        self._signer = None
        if not any(key):
            return "signing: off, anyone may command"
        self._signer = Signer(key, at_least=message.initial_timestamp)
        return "signing: key set, unsigned frames are refused"
