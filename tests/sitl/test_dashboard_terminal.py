"""The dashboard in a real terminal: tmux types and reads the screen."""

import contextlib
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from flying import BIN, TIMEOUT_S, environment, processes_of, run, scenario_tree, wait_until
from needs import needs
from station import Up, up

TLOG = Path(__file__).parents[1] / "data" / "dashboard" / "flight.tlog"

KEY_S = 0.3  # between keys, as a person types

pytestmark = [
    pytest.mark.sitl,
    needs("tmux"),
]


class Tmux:
    """A tmux server of its own with one window, which shows how the program ended."""

    def __init__(self, folder: Path, *command: str | Path) -> None:
        self._socket = folder / "tmux"
        env = environment(TERM="xterm-256color", NO_COLOR="", COLUMNS="")
        ended = f"{' '.join(map(str, command))}; echo status $?; sleep 300"
        self._run("new-session", "-d", "-x", "80", "-y", "24", ended, env=env)

    def _run(self, *arguments: str, env: dict[str, str] | None = None) -> str:
        command = ["tmux", "-f", os.devnull, "-S", str(self._socket), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=env)
        return done.stdout

    def press(self, *keys: str) -> None:
        for key in keys:
            self._run("send-keys", key)
            time.sleep(KEY_S)

    @property
    def screen(self) -> str:
        return self._run("capture-pane", "-p")

    def shows(self, *texts: str) -> None:
        end = time.monotonic() + TIMEOUT_S
        while missing := [text for text in texts if text not in (screen := self.screen)]:
            assert time.monotonic() < end, f"{missing} not on the screen:\n{screen}"
            time.sleep(0.05)

    def has_cursor_beside(self, label: str) -> None:
        """A field takes the keys that come after its focus, which takes a moment."""

        def beside() -> bool:
            row = int(self._run("display-message", "-p", "#{cursor_y}"))
            return label in self.screen.splitlines()[row]

        wait_until(beside, f"cursor beside {label}")

    def hides(self, word: str) -> None:
        wait_until(lambda: word not in self.screen, f"no {word}")

    def close(self) -> None:
        with contextlib.suppress(subprocess.CalledProcessError):
            self._run("kill-server")


@contextlib.contextmanager
def tmux(folder: Path, *command: str | Path) -> Iterator[Tmux]:
    terminal = Tmux(folder, *command)
    try:
        yield terminal
    finally:
        terminal.close()


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Up]:
    with up(tmp_path / "fleet", tree=scenario_tree(faults=[])) as fleet:
        yield fleet


def test_an_operator_flies_the_fleet_and_sets_a_fault(fleet: Up, tmp_path: Path) -> None:
    with tmux(tmp_path, BIN / "gcs", "--connect", fleet.hub) as terminal:
        terminal.shows("3 UAVs", "1 ● 0", "3 ● 0", "ready", "LOITER", "Wire")
        terminal.press("*", "s")
        terminal.shows("3 marked", "AUTO")
        terminal.press("a")
        terminal.shows("Arm UAV 1, 2, 3?", "Simulated time begins")
        terminal.press("Enter")
        terminal.shows("3 armed", "ARMED AUTO")
        terminal.press("3")
        terminal.shows("New fault")
        terminal.press("n")
        terminal.hides("x disarm")  # the form takes the keys now
        terminal.press("Tab", "Tab")
        terminal.has_cursor_beside("effectiveness")
        terminal.press("0", ".", "5")
        terminal.shows("effectiveness 0.5")
        terminal.press("C-s")
        terminal.shows("3 active", "rudder at 50 %")  # of the marked ones
        assert fleet.gcs_json("fault", "list", "--uav", "1")[0]["faults"][0]["active"]
        terminal.shows("x disarm")  # the form was left
        terminal.press("C")
        terminal.shows("Clear all faults of UAV 1, 2, 3")
        terminal.press("Enter")
        terminal.shows("0 active", "cleared")
        terminal.press("?")
        terminal.shows("Keys", "Arm the marked UAVs")
        terminal.press("Escape")
        terminal.hides("Keys")
        terminal.press("q")
        terminal.shows("status 0")
    assert fleet.gcs_json("status")["vehicles"][0]["armed"]  # the fleet flies on
    assert not [c for c in processes_of(tmp_path).values() if "--connect" in c]


def test_a_log_is_replayed(tmp_path: Path) -> None:
    with tmux(tmp_path, BIN / "gcs", "log", TLOG, "--at", "20", "--speed", "0.1") as terminal:
        terminal.shows("flight.tlog", "▶ simulated 0:20", "3 armed", "1/1")
        terminal.press("k")
        terminal.shows("‖ simulated 0:20")
        terminal.press("j", "j")
        terminal.shows("‖ simulated 0:1", "0/1")
        terminal.press("a", "3")  # actions are off
        terminal.shows("waiting", "rudder at 90 %")
        terminal.press("q")
        terminal.shows("status 0")


def test_without_a_terminal_there_is_help() -> None:
    done = run("gcs")
    assert done.returncode == 0
    assert "dashboard" in done.stdout
    assert "ATTITUDE.roll" in run("gcs", "log", TLOG).stdout  # listed
    done = run("gcs", "log", TLOG, "--at", "20")
    assert done.returncode == 2
    assert "error: the dashboard needs a terminal" in done.stderr
    done = run("gcs", "--theme", "light", "status")
    assert done.returncode == 2
    assert "--theme before `status` is for the dashboard" in done.stderr
