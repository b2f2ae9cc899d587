"""The hub of ``gcs up``: lets any number of ground stations talk to the same vehicles.

Only one ground station can bind the GCS port. The hub has a port of its own: vehicles send there
as well, and every ground station that sends to it receives their traffic. No socket and no clock:
datagrams and the time go in, destination addresses come out.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from ipaddress import ip_address

from gcs.fleet.uploads import ANSWERS, Peer, Uploads, refusal
from mavlink_defs import dialect
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, drop_reason, of_mavlink1, parse
from mavlink_defs.framing.header import FrameHeader
from mavlink_defs.framing.signing import Signer

PATIENCE_S = 5.0
"""Time without traffic after which a ground station is removed; they send heartbeats."""
MAX_STATIONS = 256
"""Ground stations served at the same time; datagrams of further ones are dropped."""

VEHICLE_RATE_HZ = 200.0
"""Datagrams per second that the hub forwards from one ground station to one vehicle."""
_BURST_S = 2.0
_TOO_OFTEN = "of a station that sends more than its share"


def rate_limit_hz(vehicles: int) -> float:
    """Return how many datagrams per second the hub accepts from one ground station.

    An upload to all vehicles at once stays below; a program that floods does not. For a moment
    there may be more, as many as in two seconds.
    """
    return 1000.0 + 100.0 * vehicles


@dataclass
class _Share:
    """What a sender may still send."""

    left: float  # datagrams
    at: float  # time of that [s]


class Hub:
    """Passes datagrams on between the vehicles of one fleet and its ground stations.

    Attributes:
        drops: Datagrams that were not forwarded, by reason.
        moved: Vehicles heard from a new address, as after a restart; the caller that handles
            them removes them.
        old_speakers: Ground stations heard in MAVLink 1, one of each host; as `moved`.
        answers: Frames that the hub itself has for ground stations, as a vehicle; the caller
            that sends them removes them.
    """

    def __init__(
        self,
        systems: Collection[int],
        signer: Signer | None = None,
        host: str = "127.0.0.1",
        on_vehicle: Callable[[bytes], None] = lambda _: None,
    ) -> None:
        """Make a hub.

        Args:
            systems: System ids of the vehicles.
            signer: Verifies frames from both sides; they are forwarded unchanged.
            host: IPv4 address of the hub. Vehicles are on the same machine.
            on_vehicle: Called with each datagram of a vehicle that is not dropped.
        """
        self.drops: Counter[str] = Counter()
        self.moved: list[int] = []
        self.old_speakers: list[Peer] = []
        self.answers: list[tuple[bytes, Peer]] = []
        self._systems = frozenset(systems)
        self._signer = signer
        self._host = host
        self._on_vehicle = on_vehicle
        self._vehicles: dict[int, Peer] = {}
        self._stations: dict[Peer, float] = {}  # when each was heard last
        self._shares: dict[tuple[Peer, int | None], _Share] = {}
        self._most_shares = MAX_STATIONS * (len(self._systems) + 2)
        self._uploads = Uploads(MAX_STATIONS * len(self._systems))
        self._packers = {k: FramePacker(k, dialect.MAV_COMP_ID_AUTOPILOT1) for k in systems}
        self._old_hosts: set[str] = set()  # hosts of stations that spoke MAVLink 1
        self._rate_hz = rate_limit_hz(len(self._systems))

    def route(self, datagram: bytes, sender: Peer, now: float) -> list[Peer]:
        """Return the addresses to forward a datagram to."""
        if not datagram:
            return []  # a command probes for a hub
        is_vehicle = sender in self._vehicles.values()
        if not (is_vehicle or self._is_within_share((sender, None), self._rate_hz, now)):
            return self._drop(_TOO_OFTEN)
        wrong = None if self._signer is None else self._signer.problem(datagram)
        if wrong is not None:
            return self._drop(wrong.text)
        self._stations = alive = {
            peer: at for peer, at in self._stations.items() if now - at <= PATIENCE_S
        }
        header = FrameHeader.read(datagram)
        if header is not None and self._is_of_vehicle(header):
            known = self._vehicles.get(header.system)
            if known != sender:
                if parse(datagram) is None:
                    return self._drop(drop_reason(datagram).text)
                if not self._is_of_this_machine(sender):
                    return self._drop(DropReason.STRANGER.text)
                self._vehicles[header.system] = sender
                if known is not None:
                    self.moved.append(header.system)
            self._on_vehicle(datagram)
            answer = parse(datagram) if header.message_id in ANSWERS else None
            return list(alive) if answer is None else self._uploads.hearers(answer, list(alive))
        message = parse(datagram)
        if message is None and of_mavlink1(datagram) is None:
            return self._drop(drop_reason(datagram).text)
        if sender not in alive and len(alive) >= MAX_STATIONS:
            return self._drop(f"of more than {MAX_STATIONS} ground stations")
        alive[sender] = now
        if message is None:
            return self._hear_old(sender)
        target = getattr(message, "target_system", 0)
        if not self._is_within_share((sender, target), VEHICLE_RATE_HZ, now):
            return self._drop(_TOO_OFTEN)
        if isinstance(message, dialect.MAVLink_setup_signing_message) and (
            target == 0  # a key is for one
            # the vehicle would see it come from this machine
            or (self._signer is None and not ip_address(sender[0]).is_loopback)
        ):
            return self._drop("SETUP_SIGNING to all or from another machine")
        if target and target not in self._vehicles:
            return self._drop(DropReason.OTHER_TARGET.text)
        return self._to_vehicles(message, [target] if target else self._vehicles, sender, now)

    def knows(self, peer: Peer) -> bool:
        """Return whether an address belongs to a vehicle or a ground station."""
        return peer in self._stations or peer in self._vehicles.values()

    def _to_vehicles(
        self, message: dialect.MAVLink_message, systems: Iterable[int], sender: Peer, now: float
    ) -> list[Peer]:
        """Return the vehicles that a message is passed on to; answer for the others."""
        reached = []
        for system in systems:
            if self._uploads.passes(message, system, sender, now):
                reached.append(self._vehicles[system])
            elif (answer := refusal(message)) is not None:
                frame = self._packers[system].pack(answer)
                signed = frame if self._signer is None else self._signer.sign(frame)
                self.answers.append((signed, sender))
        return reached

    def _hear_old(self, sender: Peer) -> list[Peer]:
        """Note a station that speaks MAVLink 1: hearing vehicles, it may go on in MAVLink 2."""
        if sender[0] not in self._old_hosts and len(self._old_hosts) < MAX_STATIONS:
            self._old_hosts.add(sender[0])
            self.old_speakers.append(sender)
        return self._drop("MAVLink 1")

    def _is_within_share(self, whose: tuple[Peer, int | None], rate_hz: float, now: float) -> bool:
        """Count a datagram of a sender to a vehicle, or to anybody: None.

        The latter before anything is parsed, so that a flood is cheap.
        """
        if whose not in self._shares and len(self._shares) >= self._most_shares:
            self._shares = {k: s for k, s in self._shares.items() if now - s.at <= PATIENCE_S}
            if len(self._shares) >= self._most_shares:
                return False
        most = _BURST_S * rate_hz
        share = self._shares.setdefault(whose, _Share(most, now))
        share.left = min(share.left + (now - share.at) * rate_hz, most)
        share.at = now
        if share.left < 1.0:
            return False
        share.left -= 1.0
        return True

    def _drop(self, reason: str) -> list[Peer]:
        self.drops[reason] += 1
        return []

    def _is_of_this_machine(self, sender: Peer) -> bool:
        return sender[0] == self._host or ip_address(sender[0]).is_loopback

    def _is_of_vehicle(self, header: FrameHeader) -> bool:
        """Check the header only: most traffic is telemetry from a known address."""
        autopilot = dialect.MAV_COMP_ID_AUTOPILOT1
        return header.system in self._systems and header.component == autopilot
