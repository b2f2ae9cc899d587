"""The sockets of the hub: one that everybody knows, and one for each that it talks to.

A datagram of a known peer goes to the socket that is connected to it, with a buffer of its own:
so a ground station that floods the hub fills its own buffer, and nobody else's.
"""

import asyncio
import contextlib
import socket
from collections.abc import Callable
from functools import partial

from gcs.fleet.hub import Hub
from mavlink_defs.endpoint import connected_twin
from mavlink_defs.runtime.spool import unwritten

_BATCH = 64  # datagrams that are received from one peer before it is another's turn
_MAX_DATAGRAM = 2048  # bytes; a MAVLink frame has 280 at most
_FORGET_S = 1.0


class HubSocket:
    """Serves a hub while the running event loop does."""

    def __init__(
        self, sock: socket.socket, hub: Hub, on_message: Callable[[str], None] = lambda _: None
    ) -> None:
        """Serve from now on.

        Args:
            sock: Bound UDP socket; closed by `close`.
            hub: Decides who gets what.
            on_message: Called with the first datagram's problem that the hub fails on, if any.
        """
        self._sock, self._hub = sock, hub
        self._on_message = on_message
        self._failed = False
        self._twins: dict[tuple[str, int], socket.socket] = {}
        self._loop = asyncio.get_running_loop()
        self._listen(sock)
        self._timer = self._loop.call_later(_FORGET_S, self._forget)

    def close(self) -> None:
        """Stop, and close the sockets."""
        self._timer.cancel()
        for sock in (self._sock, *self._twins.values()):
            self._loop.remove_reader(sock)
            sock.close()
        self._twins.clear()

    def _listen(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._loop.add_reader(sock, partial(self._receive, sock))

    def _receive(self, sock: socket.socket) -> None:
        now = self._loop.time()
        for _ in range(_BATCH):
            try:
                datagram, sender = sock.recvfrom(_MAX_DATAGRAM)
            except BlockingIOError:
                return
            except OSError:  # of a datagram sent before, to a port that was closed
                continue
            forwarded = [(datagram, peer) for peer in self._route(datagram, sender, now)]
            for frame, peer in (*forwarded, *self._hub.answers):
                with contextlib.suppress(OSError):  # a full buffer, or nobody there
                    self._sock.sendto(frame, peer)
            self._hub.answers.clear()
            if sender not in self._twins and self._hub.knows(sender):
                with contextlib.suppress(OSError):  # none to be had: the common one serves it
                    self._twins[sender] = connected_twin(self._sock, sender)
                    self._listen(self._twins[sender])

    def _route(self, datagram: bytes, sender: tuple[str, int], now: float) -> list[tuple[str, int]]:
        """Route as the hub does; what it fails on is dropped, and the next is served."""
        try:
            return self._hub.route(datagram, sender, now)
        except Exception as problem:
            self._hub.drops["that the hub failed on"] += 1
            if not self._failed:
                self._failed = True
                self._on_message(f"hub: {unwritten(problem)}; the fleet flies on")
            return []

    def _forget(self) -> None:
        """Close the sockets of those that the hub has forgotten."""
        for peer in [peer for peer in self._twins if not self._hub.knows(peer)]:
            self._loop.remove_reader(self._twins[peer])
            self._twins.pop(peer).close()
        self._timer = self._loop.call_later(_FORGET_S, self._forget)
