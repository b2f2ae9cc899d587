"""UDP sockets and the clock for compiled code: libc's own functions, called without Python.

Sockets are made and closed by `mavlink_defs.endpoint`; compiled loops get their file
descriptors. Nothing here raises: a failed call returns -1, and a signal that interrupts a wait
ends it early, so that the caller can check its stop flag.

POSIX systems with 64-bit `long` only (Linux, macOS, BSD). Without the compiler the same
functions call the same libc through ctypes.

A connected UDP socket reports at the next call, which then does nothing else, that an earlier
datagram found no bound socket (ECONNREFUSED). `send` and `send_to` therefore try twice; `receive`
returns -1 long before its timeout, so that a caller must check the clock, not count timeouts.
"""

import ctypes
import select
import socket
import sys
import time
from collections.abc import Callable
from inspect import Parameter, Signature
from typing import Any, cast

import numpy as np

from mavlink_defs.runtime.jit import compiled, in_machine_code

ADDRESS_SIZE = 16  # struct sockaddr_in

POLLED = np.dtype([("fd", "i4"), ("events", "i2"), ("found", "i2")])
"""struct pollfd; a negative file descriptor is passed over."""
READABLE = int(select.POLLIN)

_MONOTONIC, _UNIX = int(time.CLOCK_MONOTONIC), int(time.CLOCK_REALTIME)
_NOW = int(socket.MSG_DONTWAIT)
_LOOK = _NOW | int(socket.MSG_PEEK)
_SOCKET = int(socket.SOL_SOCKET)
_MEMORY_INFO, _LOST = 55, 8  # SO_MEMINFO, SK_MEMINFO_DROPS of Linux
_COUNTS_LOST = sys.platform == "linux"
SPIN_S = 1e-4
"""Longest wait that keeps the processor, offered to others [s].

By the clock, not by turns: with many processes a turn takes as long as all of theirs.
"""


def _libc(name: str, result: type, *arguments: type) -> Callable[..., int]:
    """Return a function of libc; compiled code resolves its name when it is loaded."""
    function = getattr(ctypes.CDLL(None), name)
    function.restype, function.argtypes = result, arguments

    def call(*values: int) -> int:
        return cast(int, function(*values))

    named = (Parameter(f"_{k}", Parameter.POSITIONAL_ONLY) for k in range(len(arguments)))
    vars(call)["__signature__"] = Signature(list(named))

    @in_machine_code(call)
    def typed(tools: Any, *_kinds: Any) -> Any:
        kinds: dict[type, Any] = {_INT: tools.types.int32, _POINTER: tools.types.uintp}
        kinds |= {_SIZE: tools.types.uintp, _SSIZE: tools.types.intp}

        def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            passed = [context.get_value_type(kind) for kind in signature.args]
            kind = tools.ir.FunctionType(context.get_value_type(signature.return_type), passed)
            made = tools.cgutils.get_or_insert_function(builder.module, kind, name)
            return builder.call(made, values)

        return kinds[result](*(kinds[argument] for argument in arguments)), build

    return call


_INT, _POINTER, _SIZE, _SSIZE = ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_ssize_t
_recv = _libc("recv", _SSIZE, _INT, _POINTER, _SIZE, _INT)
_recvfrom = _libc("recvfrom", _SSIZE, _INT, _POINTER, _SIZE, _INT, _POINTER, _POINTER)
_send = _libc("send", _SSIZE, _INT, _POINTER, _SIZE, _INT)
_sendto = _libc("sendto", _SSIZE, _INT, _POINTER, _SIZE, _INT, _POINTER, _INT)
_getsockopt = _libc("getsockopt", _INT, _INT, _INT, _INT, _POINTER, _POINTER)
_clock_gettime = _libc("clock_gettime", _INT, _INT, _POINTER)
_poll = _libc("poll", _INT, _POINTER, _SIZE, _INT)
_sched_yield = _libc("sched_yield", _INT)
_nanosleep = _libc("nanosleep", _INT, _POINTER, _POINTER)


@compiled
def receive(fd: int, buffer: np.ndarray) -> int:
    """Wait for one datagram, at most for the socket's receive timeout.

    Args:
        fd: File descriptor of a blocking socket, see `endpoint.set_receive_timeout`.
        buffer: Where to put it, uint8; what does not fit is cut off.

    Returns:
        Length [bytes], or -1 on timeout, signal or error.
    """
    return _recv(fd, buffer.ctypes.data, buffer.size, 0)


@compiled
def receive_now(fd: int, buffer: np.ndarray) -> int:
    """Take one datagram if one is there; otherwise as `receive`."""
    return _recv(fd, buffer.ctypes.data, buffer.size, _NOW)


@compiled
def let_others_run() -> None:
    """Offer the processor to other processes, without sleeping."""
    _sched_yield()


@compiled
def receive_from(fd: int, buffer: np.ndarray, address: np.ndarray) -> int:
    """Wait for one datagram and its sender, at most for the socket's receive timeout.

    Args:
        fd: File descriptor of a blocking IPv4 socket.
        buffer: Where to put the datagram, uint8.
        address: Where to put the sender's sockaddr_in, uint8, shape (ADDRESS_SIZE,).

    Returns:
        Length [bytes], or -1 on timeout, signal or error.
    """
    return _receive_from(fd, buffer, address, np.full(1, ADDRESS_SIZE, np.uint32), 0)


@compiled
def receive_from_soon(fd: int, buffer: np.ndarray, address: np.ndarray) -> int:
    """Take one datagram and its sender that are expected within microseconds.

    The processor is offered to others, but does not fall asleep, for the first moments:
    waking it again would take longer than all the work of a lockstep step. Then as `receive_from`.
    """
    size = np.full(1, ADDRESS_SIZE, np.uint32)
    length = _receive_from(fd, buffer, address, size, _NOW)
    if length >= 0:
        return length
    end_s = monotonic_s() + SPIN_S
    while monotonic_s() < end_s:
        _sched_yield()
        length = _receive_from(fd, buffer, address, size, _NOW)
        if length >= 0:
            return length
    return _receive_from(fd, buffer, address, size, 0)


@compiled
def receive_from_now(fd: int, buffer: np.ndarray, address: np.ndarray) -> int:
    """Take one datagram and its sender if one is there; otherwise as `receive_from`."""
    return _receive_from(fd, buffer, address, np.full(1, ADDRESS_SIZE, np.uint32), _NOW)


@compiled
def waits(fd: int, buffer: np.ndarray) -> bool:
    """Return whether a datagram waits in a socket; it stays there.

    Args:
        fd: File descriptor of a socket.
        buffer: A buffer, uint8, whose first byte is lost.
    """
    return _recv(fd, buffer.ctypes.data, 1, _LOOK) >= 0


@compiled
def datagrams_lost(fd: int) -> int:
    """Return how many datagrams a socket has lost, most of them because its buffer was full.

    A full buffer keeps the oldest. On systems other than Linux, which do not report it, 0.
    """
    if not _COUNTS_LOST:
        return 0
    memory, size = np.zeros(_LOST + 1, np.uint32), np.full(1, 4 * (_LOST + 1), np.uint32)
    return int(memory[_LOST]) if _read_option(fd, memory, size) == 0 else 0


@compiled
def wait_for_any(polled: np.ndarray, timeout_s: float) -> int:
    """Wait until a socket has a datagram or an error.

    Args:
        polled: Sockets and events, dtype POLLED; `found` is written.
        timeout_s: Longest wait [s], rounded up to milliseconds; negative: no limit.

    Returns:
        The number of sockets with something found, 0 after the timeout, -1 on a signal or error.
    """
    timeout_ms = -1 if timeout_s < 0.0 else int(np.ceil(timeout_s * 1e3))
    return _poll(polled.ctypes.data, len(polled), timeout_ms)


@compiled
def same_address(a: np.ndarray, b: np.ndarray) -> bool:
    """Return whether two sockaddr_in have the same port and IPv4 address."""
    for k in range(2, 8):
        if a[k] != b[k]:
            return False
    return True


@compiled
def send(fd: int, buffer: np.ndarray, length: int) -> int:
    """Send buffer[:length] to the peer of a connected socket, without waiting.

    Returns:
        The length, or -1 when the datagram was not sent (full socket buffer, no route, …).
    """
    sent = _send(fd, buffer.ctypes.data, length, _NOW)
    if sent < 0:  # perhaps only the late error of an earlier datagram
        sent = _send(fd, buffer.ctypes.data, length, _NOW)
    return sent


@compiled
def send_to(fd: int, buffer: np.ndarray, length: int, address: np.ndarray) -> int:
    """Send buffer[:length] to a sockaddr_in of shape (ADDRESS_SIZE,); otherwise as `send`."""
    data = buffer.ctypes.data
    sent = _sendto(fd, data, length, _NOW, address.ctypes.data, ADDRESS_SIZE)
    if sent < 0:
        sent = _sendto(fd, data, length, _NOW, address.ctypes.data, ADDRESS_SIZE)
    return sent


@compiled
def monotonic_s() -> float:
    """Return the time of `time.monotonic` [s]."""
    timespec = np.empty(2, np.int64)
    _read_clock(_MONOTONIC, timespec)
    return float(timespec[0] + 1e-9 * timespec[1])


@compiled
def unix_s() -> float:
    """Return the time of `time.time` [s]."""
    timespec = np.empty(2, np.int64)
    _read_clock(_UNIX, timespec)
    return float(timespec[0] + 1e-9 * timespec[1])


@compiled
def sleep_until(t_s: float) -> None:
    """Sleep until `monotonic_s` reaches `t_s` [s]; at once if past, early on a signal."""
    remaining_s = t_s - monotonic_s()
    if remaining_s > 0.0:
        timespec = np.empty(2, np.int64)
        timespec[0] = int(remaining_s)
        timespec[1] = int((remaining_s - timespec[0]) * 1e9)
        _pause(timespec)


# An array must outlive the call that gets its address. Compiled code frees an array after its
# last use, and taking the address is one; arguments are kept alive by the caller.


@compiled
def _receive_from(
    fd: int, buffer: np.ndarray, address: np.ndarray, size: np.ndarray, flags: int
) -> int:
    return _recvfrom(
        fd, buffer.ctypes.data, buffer.size, flags, address.ctypes.data, size.ctypes.data
    )


@compiled
def _read_option(fd: int, memory: np.ndarray, size: np.ndarray) -> int:
    return _getsockopt(fd, _SOCKET, _MEMORY_INFO, memory.ctypes.data, size.ctypes.data)


@compiled
def _read_clock(clock: int, timespec: np.ndarray) -> int:
    return _clock_gettime(clock, timespec.ctypes.data)


@compiled
def _pause(timespec: np.ndarray) -> int:
    return _nanosleep(timespec.ctypes.data, 0)
