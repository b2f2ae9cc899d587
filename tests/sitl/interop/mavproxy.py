"""MAVProxy as a person uses it: lines typed, lines read."""

import contextlib
import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Self

TIMEOUT_S = 600.0
_ANSWER_S = 2.0
_NO_WINDOWS = "log,signing,wp,ftp,param,arm,mode,misc,cmdlong,fence,rally"


class MavProxy:
    """A running MAVProxy, with our dialect; a context manager that leaves nothing behind."""

    _program: tuple[str, ...] = (
        *(sys.executable, "-m", "mavlink_defs.runtime.run_with_dialect"),
        *("mavproxy.py", "--dialect", "ftc"),
    )

    def __init__(self, port: int, folder: Path) -> None:
        self._lines: list[str] = []
        self._popen = subprocess.Popen(
            [
                *self._program,
                "--master",
                f"udpin:127.0.0.1:{port}",
                "--state-basedir",
                folder,
                "--logfile",
                folder / "mavproxy.tlog",
                "--default-modules",
                _NO_WINDOWS,
                "--show-errors",
            ],
            cwd=folder,
            bufsize=0,
            env=os.environ | {"HOME": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End it; it often ignores every request to stop, but not SIGKILL."""
        with contextlib.suppress(OSError):
            self._type("set requireexit True")
            self._type("exit")
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(2.0)
        self._popen.kill()
        self._popen.wait()
        self._reader.join()
        for stream in (self._popen.stdin, self._popen.stdout):
            if stream is not None:
                stream.close()

    def say(self, line: str, expected: str) -> "re.Match[str]":
        """Type a line; the first match of a pattern in what is printed from then on."""
        begin = len(self._lines)
        self._type(line)
        return self.wait_for(expected, begin)

    def ask(self, line: str, expected: str) -> "re.Match[str]":
        """Type a line that shows something, again and again until it shows a pattern."""
        end = time.monotonic() + TIMEOUT_S
        begin = len(self._lines)
        while True:
            self._type(line)
            with contextlib.suppress(AssertionError):
                return self.wait_for(expected, begin, _ANSWER_S)
            assert time.monotonic() < end, f"{line}: no {expected!r} in:\n{self.text}"

    def watch_link(self, packets: int) -> tuple[int, int]:
        """Return how many packets were lost before and after this many more packets came.

        What was lost before is lost in the receive buffer, while modules are loaded.
        """
        pattern = r"link 1 OK \((\d+) packets.* (\d+) lost, "
        first = self.say("link", pattern)
        end = time.monotonic() + TIMEOUT_S
        while int((last := self.say("link", pattern))[1]) < int(first[1]) + packets:
            assert time.monotonic() < end, self.text
            time.sleep(0.1)
        return int(first[2]), int(last[2])

    def wait_for(
        self, expected: str, begin: int = 0, timeout_s: float = TIMEOUT_S
    ) -> "re.Match[str]":
        """Wait for a pattern in what was printed since line `begin`."""
        end = time.monotonic() + timeout_s
        while True:
            text = "\n".join(self._lines[begin:])
            if (match := re.search(expected, text)) is not None:
                return match
            assert time.monotonic() < end, f"waited in vain for {expected!r} in:\n{text}"
            assert self._popen.poll() is None, text
            time.sleep(0.02)

    @property
    def text(self) -> str:
        """All that it has printed."""
        return "\n".join(self._lines)

    def _type(self, line: str) -> None:
        assert self._popen.stdin is not None
        self._popen.stdin.write(f"{line}\n".encode())

    def _read(self) -> None:
        assert self._popen.stdout is not None
        for line in self._popen.stdout:
            self._lines.append(line.decode(errors="replace").rstrip())


class PlainMavProxy(MavProxy):
    """One that does not know our dialect."""

    _program = (sys.executable, str(Path(sys.executable).parent / "mavproxy.py"))
