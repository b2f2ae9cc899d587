"""What the process that forks warm commands imports, and calls once for its machine code."""

import typer

import gcs.fleet.flight
import gcs.lab.campaigns.preload  # noqa: F401 - flies once
from gcs.cli import COMMANDS, app
from gcs.fleet.fork_server import _load_compiled_code

_group = typer.main.get_group(app)
for _name in COMMANDS:
    _group.load(_name)  # type: ignore[attr-defined]  # our own class
_load_compiled_code()
