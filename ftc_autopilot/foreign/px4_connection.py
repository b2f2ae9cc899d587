"""The TCP port at which PX4 looks for its simulator.

PX4 connects, and begins with a HEARTBEAT. Whoever connects and says something else is turned away,
and so is everybody else while PX4 is connected: what strangers send there is never read as PX4's.
"""

import contextlib
import errno
import select
import socket
from typing import TypeAlias

from ftc_autopilot.foreign.base import ForeignError
from mavlink_defs.endpoint import EndpointError, PortTaken
from sitl_plant.foreign.px4.lockstep import is_px4

_BLOCK = 65536  # bytes read at a time
_MOST_CALLERS = 8  # that have not said yet who they are

Callers: TypeAlias = dict[socket.socket, bytes]


class Px4Connection:
    """The connection of one PX4."""

    def __init__(self, host: str, port: int, whose: str) -> None:
        """Listen.

        Raises:
            PortTaken: The port is in use.
            EndpointError: The address is not one of this machine's.
        """
        self._callers: Callers = {}  # what each has said
        self._px4: socket.socket | None = None
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._listener.setblocking(False)
        try:
            self._listener.bind((host, port))
            self._listener.listen()
        except OSError as problem:
            self._listener.close()
            where = f"TCP port {port} on {host}"
            if problem.errno == errno.EADDRINUSE:
                text = f"{where} is in use, and {whose} looks for its simulator there"
                raise PortTaken(f"{text}; stop the other program") from None
            text = f"cannot listen at {where} for {whose}: {problem.strerror}"
            raise EndpointError(f"{text}; use 127.0.0.1") from None

    @property
    def is_open(self) -> bool:
        """Whether PX4 is connected."""
        return self._px4 is not None

    def receive(self, timeout_s: float) -> bytes:
        """Return what PX4 has sent, as soon as there is something; nothing after a time [s].

        Raises:
            ForeignError: It has closed its connection.
        """
        px4 = [] if self._px4 is None else [self._px4]
        sockets = [self._listener, *self._callers, *px4]
        ready, _, _ = select.select(sockets, [], [], max(timeout_s, 0.0))
        if self._px4 in ready:
            return self._from_px4()
        if self._listener in ready:
            self._accept()
        for caller in [one for one in self._callers if one in ready]:
            heard = self._hear(caller)
            if self._px4 is not None:
                return heard
        return b""

    def _from_px4(self) -> bytes:
        assert self._px4 is not None
        data = b""
        with contextlib.suppress(OSError):
            data = self._px4.recv(_BLOCK)
        if not data:
            raise ForeignError("PX4 has closed its connection to the simulator")
        return data

    def _accept(self) -> None:
        with contextlib.suppress(OSError):  # it has gone again
            caller, _ = self._listener.accept()
            if self._px4 is None and len(self._callers) < _MOST_CALLERS:
                caller.setblocking(False)
                self._callers[caller] = b""
            else:
                self._turn_away(caller)

    def _hear(self, caller: socket.socket) -> bytes:
        """Read what a caller says; it is followed, and returned, if it shows that it is PX4."""
        try:
            data = caller.recv(_BLOCK)
        except OSError:
            data = b""
        said = self._callers[caller] = self._callers[caller] + data
        verdict = is_px4(said) if data else False
        if verdict:
            del self._callers[caller]
            caller.setblocking(True)
            caller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._px4 = caller
            for other in list(self._callers):
                self._turn_away(other)
            return said
        if verdict is False:
            self._turn_away(caller)
        return b""

    def _turn_away(self, caller: socket.socket) -> None:
        self._callers.pop(caller, None)
        caller.close()

    def send(self, data: bytes, timeout_s: float) -> None:
        """Send PX4 something.

        Raises:
            ForeignError: It has closed its connection, or takes nothing for so long.
        """
        assert self._px4 is not None
        self._px4.settimeout(timeout_s)
        try:
            self._px4.sendall(data)
        except TimeoutError:
            raise ForeignError(f"PX4 has read nothing for {timeout_s:g} s") from None
        except OSError as problem:
            text = f"PX4 has closed its connection to the simulator: {problem.strerror}"
            raise ForeignError(text) from None

    def close(self) -> None:
        """Close it, and listen no more."""
        for sock in (self._listener, self._px4, *self._callers):
            if sock is not None:
                sock.close()
