"""What only shows something ends with its session, whatever state its terminal is in."""

import contextlib
import fcntl
import os
import pty
import select
import signal
import socket
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from flying import BIN, TIMEOUT_S, environment, wait_until
from test_stopping import processes_marked
from test_web import free_port

pytestmark = pytest.mark.sitl

TLOG = Path(__file__).parents[1] / "data" / "dashboard" / "flight.tlog"
NOBODY = ("--connect", "udpout:127.0.0.1:9")
END_S = 120.0  # of what ends within 2 s, on a machine that is not busy
UPGRADE = (
    "GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)


class Terminal:
    """A pseudo-terminal: its shell runs a script, which runs a program."""

    def __init__(self, mark: str, *arguments: str | Path) -> None:
        self.mark = mark
        self.master, self.slave = pty.openpty()
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack("4H", 24, 80, 0, 0))
        self.shell = subprocess.Popen(
            ["sh", "-c", """sh -c '"$0" "$@"; :' "$0" "$@"; read _""", *arguments],
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            env=environment(MARK=mark, TERM="xterm-256color", COLUMNS="", NO_COLOR=""),
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # noqa: PLW1509 - no thread holds a lock here
        )

    def read(self, text: bytes = b"") -> None:
        """Read what it shows until a text has come."""
        received, end = b"", time.monotonic() + TIMEOUT_S
        while text not in received:
            assert time.monotonic() < end, received
            if select.select([self.master], [], [], 0.1)[0]:
                received += os.read(self.master, 1 << 16)

    def fill(self) -> None:
        """Leave no room for another character."""
        own = os.open(os.ttyname(self.slave), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        while select.select([], [own], [], 0.2)[1]:  # the kernel makes room for a while
            with contextlib.suppress(BlockingIOError):
                while True:
                    os.write(own, b"x")
        os.close(own)

    @property
    def has_ended(self) -> bool:
        """Whether its shell is alone; reads what is shown until then."""
        if select.select([self.master], [], [], 0)[0]:
            os.read(self.master, 1 << 16)
        return set(processes_marked(self.mark)) == {self.shell.pid}

    @property
    def script(self) -> int:
        return child_of(self.shell.pid)

    @property
    def program(self) -> int:
        return child_of(self.script)

    def close(self) -> None:
        for descriptor in (self.master, self.slave):
            with contextlib.suppress(OSError):
                os.close(descriptor)


def child_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])


@contextlib.contextmanager
def terminal(mark: str, *arguments: str | Path) -> Iterator[Terminal]:
    shown = Terminal(mark, *arguments)
    try:
        yield shown
    finally:
        for pid in processes_marked(mark):
            os.kill(pid, signal.SIGKILL)
        shown.close()
        shown.shell.wait()


ENDS: dict[str, Callable[[Terminal], None]] = {
    "SIGTERM": lambda shown: os.kill(shown.program, signal.SIGTERM),
    "SIGHUP": lambda shown: os.kill(shown.program, signal.SIGHUP),
    "closed terminal": Terminal.close,
    "killed parent": lambda shown: os.kill(shown.script, signal.SIGKILL),
    "killed": lambda shown: os.kill(shown.program, signal.SIGKILL),
}


def check_end(shown: Terminal, end: str) -> None:
    """Nothing that was started in the terminal is left, but shells that wait to write to it."""
    shells = {shown.shell.pid, shown.script}
    ENDS[end](shown)
    deadline = time.monotonic() + END_S
    while left := set(processes_marked(shown.mark)) - shells:
        assert time.monotonic() < deadline, [
            Path(f"/proc/{pid}/cmdline").read_bytes() for pid in left
        ]
        time.sleep(0.02)


DASHBOARDS = pytest.mark.parametrize("program", [NOBODY, ("log", TLOG)], ids=["dashboard", "log"])


@DASHBOARDS
@pytest.mark.parametrize("end", ["SIGTERM", "SIGHUP", "closed terminal", "killed parent"])
def test_a_dashboard_ends_whose_terminal_nobody_reads(
    program: tuple[str, ...], end: str, tmp_path: Path
) -> None:
    with terminal(str(tmp_path), BIN / "gcs", *program) as shown:
        shown.read(b"Fleet")
        shown.fill()
        check_end(shown, end)


@DASHBOARDS
def test_a_dashboard_that_is_read_leaves_its_terminal_as_it_was(
    program: tuple[str, ...], tmp_path: Path
) -> None:
    with terminal(str(tmp_path), BIN / "gcs", *program) as shown:
        before = termios.tcgetattr(shown.slave)
        shown.read(b"Fleet")
        assert termios.tcgetattr(shown.slave) != before
        os.kill(shown.program, signal.SIGTERM)
        wait_until(lambda: shown.has_ended, "it ends")
        assert termios.tcgetattr(shown.slave) == before


HANGS = """
import time, tty
from gcs.console.stopping import end_with_session
end_with_session(lambda: None)
tty.setraw(0)
print("Fleet", flush=True)
time.sleep(600)
"""


def test_what_is_ended_by_force_leaves_its_terminal_as_it_was(tmp_path: Path) -> None:
    """As is a dashboard that does not come to that itself, on a machine that is too busy."""
    with terminal(str(tmp_path), sys.executable, "-c", HANGS) as shown:
        before = termios.tcgetattr(shown.slave)
        shown.read(b"Fleet")
        os.kill(shown.program, signal.SIGTERM)
        wait_until(lambda: shown.has_ended, "it ends")
        assert termios.tcgetattr(shown.slave) == before


@pytest.mark.parametrize("end", ENDS)
def test_a_server_ends_with_its_views(end: str, tmp_path: Path) -> None:
    port = free_port()
    web = ("web", *NOBODY, "--listen", f"127.0.0.1:{port}")
    with terminal(str(tmp_path), BIN / "gcs", *web) as shown:
        shown.read(b"Ctrl-C stops it")
        shown.fill()
        with socket.create_connection(("127.0.0.1", port)) as page:
            page.sendall(UPGRADE.format(port=port).encode())
            assert page.recv(12) == b"HTTP/1.1 101"
            wait_until(lambda: len(processes_marked(shown.mark)) == 4, "a view is there")
            check_end(shown, end)
