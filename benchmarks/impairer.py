"""One direction of an impaired link, for datagrams of Python, in benchmarks and tests."""

import numpy as np

from mavlink_defs.capture.impairing import COPIES, Fate, new_directions, put
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.constants import MAX_DATAGRAM


class Impairer:
    """One direction of a link.

    Args:
        impairment: Impairment of the link.
        path: Name of the direction. Two paths with one seed do not lose the same datagrams.
    """

    def __init__(self, impairment: Impairment, path: str) -> None:
        self._directions = new_directions([(impairment, path)])
        self._due_s = np.zeros(COPIES)
        self._data = np.zeros(MAX_DATAGRAM, np.uint8)
        self._copies = np.zeros((COPIES, MAX_DATAGRAM), np.uint8)

    @property
    def fate(self) -> Fate:
        """What became of the datagrams so far."""
        return Fate.of(self._directions.fates[0])

    def send(
        self, datagram: bytes, now_s: float, schedule_s: float | None = None
    ) -> list[tuple[float, bytes]]:
        """Put a datagram on the link.

        Args:
            datagram: Its UDP payload.
            now_s: The time, which does not go backwards [s].
            schedule_s: The time that outages count, if another [s].

        Returns:
            Times of arrival at the other end [s], and datagrams: none, one or two.
        """
        length, at_s = len(datagram), now_s if schedule_s is None else schedule_s
        self._data[:length] = np.frombuffer(datagram, np.uint8)
        arrivals = put(
            self._directions,
            0,
            self._data,
            length,
            float(now_s),
            float(at_s),
            self._due_s,
            self._copies,
        )
        return [
            (float(self._due_s[k]), self._copies[k, :length].tobytes()) for k in range(arrivals)
        ]
