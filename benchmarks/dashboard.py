"""The dashboard with 30 vehicles: CPU share, and time from a key to the screen.

Method: the real program (`gcs --connect udpin:...`) runs on a pseudo-terminal of 200 × 50
characters. This process plays the vehicles: frames of pymavlink over UDP at the vehicles' own
rates, 10 Hz for four messages, 5 Hz for two, 2 Hz and 1 Hz for the rest, 54 messages per second
and vehicle. A key moves the cursor of the fleet table to the next vehicle, and the time counts
until the pointer "▸" is written at another line of the terminal. CPU is what the kernel has
counted for the process, user and system, per second of wall-clock time.
"""

import contextlib
import fcntl
import math
import os
import pty
import re
import selectors
import signal
import socket
import statistics
import struct
import sys
import termios
import time
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.endpoint import free_ports
from mavlink_defs.framing.frames import FramePacker, parse

VEHICLES = 30
KEYS = 60
COLUMNS, LINES = 200, 50
WARM_UP_S = 12.0  # until the plots and sparklines have something to show
CYCLE = 10  # ticks of 0.1 s
_MOVE = re.compile(r"\x1b\[(?=\d+;\d+H)")  # of the cursor


@dataclass(frozen=True)
class Load:
    """Results of the measurement.

    Attributes:
        cpu_percent: Of one core.
        key_ms: From each key to the screen.
        messages_per_s: That were sent to the dashboard.
    """

    cpu_percent: float
    key_ms: list[float]
    messages_per_s: float


class Vehicles:
    """Thirty vehicles on one socket."""

    def __init__(self, port: int) -> None:
        self.sent = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.setblocking(False)
        self._speakers = {i: FramePacker(i, 1) for i in range(1, VEHICLES + 1)}
        self._begin = time.monotonic()
        self._tick = 0
        self._due: list[tuple[float, int]] = []
        self._random = Random(1)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def work(self) -> float:
        """Send due messages, answer requests; return the time until more is due [s]."""
        now = time.monotonic() - self._begin
        if not self._due:  # vehicles do not all send at once
            self._tick += 1
            spread = [(self._tick + self._random.random()) * 0.1 for _ in self._speakers]
            self._due = sorted(zip(spread, self._speakers, strict=True))
        while self._due and self._due[0][0] <= now:
            _, system = self._due.pop(0)
            for message in telemetry(system, now, self._tick):
                self._send(system, message)
        self._answer()
        return max(self._due[0][0] - now, 0.0) if self._due else 0.0

    def _send(self, system: int, message: MAVLink_message) -> None:
        with contextlib.suppress(ConnectionRefusedError, BlockingIOError):
            self._socket.send(self._speakers[system].pack(message))
            self.sent += 1

    def _answer(self) -> None:
        with contextlib.suppress(ConnectionRefusedError, BlockingIOError):
            while True:
                message = parse(self._socket.recv(2048))
                system = getattr(message, "target_system", 0)
                if system not in self._speakers or message is None:
                    continue
                station = (message.get_srcSystem(), message.get_srcComponent())
                if isinstance(message, dialect.MAVLink_command_long_message):
                    refusal = dialect.MAV_RESULT_UNSUPPORTED
                    ack = dialect.MAVLink_command_ack_message(
                        message.command, refusal, 0, 0, *station
                    )
                    self._send(system, ack)
                elif isinstance(message, dialect.MAVLink_mission_request_list_message):
                    self._send(system, dialect.MAVLink_mission_count_message(*station, 0))


def telemetry(system: int, now: float, tick: int) -> Iterator[MAVLink_message]:
    """Return the messages that a vehicle sends in one tenth of a second."""
    ms, wave = round(now * 1000), math.sin(now + system)
    four = [50.0 + wave, wave, 2.0 * wave, 10.0 + wave]
    yield dialect.MAVLink_attitude_message(ms, 0.1 * wave, 0.05 * wave, 0.2, 0.0, 0.0, 0.0)
    yield dialect.MAVLink_local_position_ned_message(
        ms, 50.0 * now, 30.0 * system, -100.0 + wave, 50.0, 0.0, 0.0
    )
    small = [0.1 * value for value in four]
    yield dialect.MAVLink_ftc_tracking_message(ms, four, small, small)
    held = [0.1 * wave, 0.2, -0.1 * wave, 0.5, *[0.0] * 28]
    yield dialect.MAVLink_actuator_output_status_message(ms * 1000, 4, held)
    if tick % 2 == system % 2:
        yield dialect.MAVLink_vfr_hud_message(four[0], 50.0, 10, 50, 100.0, 0.0)
        events = [int(now * 250), int(now * 60), int(now * 30), int(now * (3 + wave))]
        yield dialect.MAVLink_ftc_events_message(
            ms, ms, events, [1000] * 4, sum(events), [0] * 4, 0
        )
    if tick % 5 == system % 5:
        yield dialect.MAVLink_ftc_adaptation_message(ms, 1.0, 1.0, 1.0, 1.0, 1.0)
    if tick % CYCLE == system % CYCLE:
        yield dialect.MAVLink_system_time_message(0, ms)
        yield dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_FIXED_WING,
            dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
            dialect.MAV_MODE_FLAG_SAFETY_ARMED | 1,
            10,
            dialect.MAV_STATE_ACTIVE,
            3,
        )


class Terminal:
    """The dashboard on a pseudo-terminal."""

    def __init__(self, port: int) -> None:
        self.pid, self.master = pty.fork()
        if self.pid == 0:  # the child becomes the dashboard
            os.environ.update(TERM="xterm-256color", COLORTERM="truecolor")
            code = "from gcs.__main__ import main; main()"
            arguments = ["-c", code, "--connect", f"udpin:127.0.0.1:{port}"]
            os.execv(sys.executable, [sys.executable, *arguments])
        size = struct.pack("HHHH", LINES, COLUMNS, 0, 0)
        fcntl.ioctl(self.master, termios.TIOCSWINSZ, size)
        self.line = 0
        self._tail = ""

    def read(self) -> None:
        """Take in what was written, and note the line of the pointer."""
        self._tail += os.read(self.master, 1 << 16).decode(errors="replace")
        places = _MOVE.split(self._tail)
        self._tail = places[-1]
        for place in places:  # what is written from one cursor position on
            line, _, text = place.partition(";")
            if "▸" in text and line.isdecimal():
                self.line = int(line)

    def press(self, key: bytes) -> None:
        """Type a key."""
        os.write(self.master, key)

    def cpu_s(self) -> float:
        """Processor time of the dashboard so far [s]."""
        with open(f"/proc/{self.pid}/stat") as stat:
            fields = stat.read().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def close(self) -> None:
        """End the dashboard."""
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        os.close(self.master)


def measure(keys: int = KEYS, warm_up_s: float = WARM_UP_S) -> Load:
    """Run the dashboard; takes half a minute."""
    (port,) = free_ports(1)
    terminal, vehicles, random = Terminal(port), Vehicles(port), Random(2)
    key_ms: list[float] = []
    with selectors.DefaultSelector() as selector:
        selector.register(terminal.master, selectors.EVENT_READ)
        try:
            _run(terminal, vehicles, selector, warm_up_s)
            begin, cpu_s, sent = time.monotonic(), terminal.cpu_s(), vehicles.sent
            for i in range(keys):
                before, pressed = terminal.line, time.perf_counter()
                terminal.press(b"\x1b[B" if i % 20 < 10 else b"\x1b[A")
                while terminal.line == before:
                    if time.perf_counter() - pressed > 5.0:
                        raise RuntimeError("the dashboard does not react to a key")
                    _run(terminal, vehicles, selector, 0.0)
                key_ms.append((time.perf_counter() - pressed) * 1e3)
                _run(terminal, vehicles, selector, random.uniform(0.1, 0.4))
            wall_s = time.monotonic() - begin
            share = (terminal.cpu_s() - cpu_s) / wall_s
            return Load(100.0 * share, key_ms, (vehicles.sent - sent) / wall_s)
        finally:
            terminal.close()
            vehicles.close()


def _run(
    terminal: Terminal, vehicles: Vehicles, selector: selectors.BaseSelector, for_s: float
) -> None:
    end = time.monotonic() + for_s
    while True:
        wait_s = min(vehicles.work(), max(end - time.monotonic(), 0.001))
        if selector.select(wait_s):
            terminal.read()
        if time.monotonic() >= end:
            return


def main() -> None:
    """Measure and print."""
    load = measure()
    worst, middle = max(load.key_ms), statistics.median(load.key_ms)
    print(
        f"{VEHICLES} vehicles, {load.messages_per_s:.0f} messages/s: {load.cpu_percent:.0f} % of "
        f"one core, key to screen {middle:.0f} ms, worst of {KEYS} {worst:.0f} ms"
    )


if __name__ == "__main__":
    main()
