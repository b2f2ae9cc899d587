"""Ctrl-C while a program is starting ends it without a traceback, and leaves no process."""

import os
import signal
import subprocess
import sys
import time
import uuid
from functools import partial
from pathlib import Path
from random import Random

import pytest
from flying import TIMEOUT_S, environment, wait_until, write_scenario
from leftovers import marked

pytestmark = pytest.mark.sitl

PROGRAM = "from {}.__main__ import main; print('begins', flush=True); main()"
"""Says when Python itself has started, from when on what it does is up to us."""
COMMANDS = {
    "fly": ("gcs", "fly", "../scenario.yaml", "--free-ports", "--out", "run"),
    "up": ("gcs", "up", "../scenario.yaml", "--free-ports", "--out", "run"),
    "status": ("gcs", "status", "--connect", "udpin:127.0.0.1:0"),
    "sitl-plant": ("sitl_plant", "none.yaml"),
    "ftc-autopilot": ("ftc_autopilot", "none.yaml"),
}
SAYS = {
    "status": "error: --connect: expected",
    "sitl-plant": "none.yaml: no such file",
    "ftc-autopilot": "none.yaml: no such file",
}
"""How the message begins of those that fail by themselves when they are not interrupted."""
EARLIEST_S, LATEST_S = 0.1, 1.5
"""Instants after Python itself has started, of which an entry point needs a moment to begin."""


@pytest.mark.parametrize("command", COMMANDS)
def test_ctrl_c_at_any_instant_of_the_start(tmp_path: Path, command: str) -> None:
    write_scenario(tmp_path)
    draw = Random(command)
    for instant_s in (draw.uniform(EARLIEST_S, 0.5), draw.uniform(0.5, LATEST_S)):
        mark = uuid.uuid4().hex
        package, *arguments = COMMANDS[command]
        folder = tmp_path / f"{instant_s:.3f}"
        folder.mkdir()
        program = subprocess.Popen(
            [sys.executable, "-c", PROGRAM.format(package), *arguments],
            cwd=folder,
            env={**environment(), "FTC_SITL_MARK": mark},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert program.stdout is not None
        assert program.stdout.readline() == "begins\n"
        time.sleep(instant_s)  # the instant is what is drawn, not what is waited for
        os.kill(program.pid, signal.SIGINT)
        _, stderr = program.communicate(timeout=TIMEOUT_S)
        assert "Traceback" not in stderr
        assert "KeyboardInterrupt" not in stderr
        if program.returncode == -signal.SIGINT:  # maybe after its message
            assert stderr == "" or stderr.startswith(SAYS.get(command, "nothing"))
        wait_until(partial(_none_is_left, mark), "no process is left")


ON_ENTERING = """
import os, signal, sys
import {module} as entered

def interrupted(*arguments):
    os.kill(os.getpid(), signal.SIGINT)

entered.{function} = interrupted
from gcs.commands.cli import main
main()
"""


@pytest.mark.parametrize("function", ["typer.main.get_command", "gcs.commands.cli.stop_as_ctrl_c"])
def test_ctrl_c_before_the_command_is_known(function: str) -> None:
    """At an instant that the other test meets once in hundreds of times."""
    module, name = function.rsplit(".", 1)
    script = ON_ENTERING.format(module=module, function=name)
    done = subprocess.run(
        [sys.executable, "-c", script, "trim", "--help"],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def _none_is_left(mark: str) -> bool:
    return not marked("FTC_SITL_MARK", mark)
