"""The program of a foreign autopilot, as a child process in a folder of its own."""

import contextlib
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from ftc_autopilot.foreign.base import ForeignError, ForeignInputError

_PR_SET_PDEATHSIG = 1  # of <sys/prctl.h>
_END_S = 5.0


class Child:
    """A child that has ended when this process has: it is killed, not asked.

    Attributes:
        folder: Its working folder, which goes with it.
    """

    def __init__(self, what: str, system: int) -> None:
        """Make the folder; `start` starts the program.

        Args:
            what: The program, for messages: "ArduPlane".
            system: System id of the UAV.
        """
        self._what, self._system = what, system
        self.folder = Path(tempfile.mkdtemp(prefix=f"ftc-sitl-uav{system}-"))
        self._log = self.folder / "output.txt"
        self._popen: subprocess.Popen[bytes] | None = None

    def start(
        self, binary: str, arguments: Sequence[str], environment: Mapping[str, str] | None = None
    ) -> None:
        """Start the program.

        Args:
            binary: File of the program.
            arguments: Its arguments.
            environment: Variables that are set for it, beside what this process has.

        Raises:
            ForeignInputError: There is no such program, or it cannot be executed.
        """
        path = Path(binary).expanduser().resolve()
        of = f"UAV {self._system}: autopilot.binary is {binary}"
        if not path.is_file():
            raise ForeignInputError(f"{of}, and there is no such file; name {self._what}'s program")
        if not os.access(path, os.X_OK):
            raise ForeignInputError(f"{of}, which cannot be executed; chmod +x {path}")
        ends = ctypes.CDLL(None).prctl if sys.platform == "linux" else None

        def end_with_parent() -> None:
            if ends is not None:
                ends(_PR_SET_PDEATHSIG, signal.SIGKILL)

        try:
            with self._log.open("wb") as output:
                self._popen = subprocess.Popen(
                    [str(path), *arguments],
                    cwd=self.folder,
                    env={**os.environ, **(environment or {})},
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=output,
                    preexec_fn=end_with_parent,  # noqa: PLW1509 - this process has one thread
                )
        except OSError as problem:
            text = f"{of}, which is no program for this machine: {problem.strerror}"
            raise ForeignInputError(text) from None

    def check(self, at_s: float | None = None, within_s: float = 0.0) -> None:
        """Check that it runs.

        Args:
            at_s: Simulation time, for the message [s]; None before the flight.
            within_s: How long to wait for its end, if there is a sign of it [s, wall time].

        Raises:
            ForeignError: It has ended.
        """
        if self._popen is None:
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(within_s)
        if self._popen.poll() is None:
            return
        status = self._popen.returncode
        how = f"was ended by signal {-status}" if status < 0 else f"ended with status {status}"
        when = "before the flight" if at_s is None else f"at {at_s:.3f} s"
        raise ForeignError(f"{self._what} {how} {when}{self.last_line()}")

    def last_line(self) -> str:
        """Return the last line that it wrote, behind a colon; nothing if it wrote none."""
        lines: list[str] = []
        with contextlib.suppress(OSError):
            lines = self._log.read_text(errors="replace").strip().splitlines()
        return f": {lines[-1].strip()}" if lines else ""

    def close(self) -> None:
        """End the program, and remove its folder."""
        if self._popen is not None:
            with contextlib.suppress(ProcessLookupError):
                self._popen.kill()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._popen.wait(_END_S)
        shutil.rmtree(self.folder, ignore_errors=True)
