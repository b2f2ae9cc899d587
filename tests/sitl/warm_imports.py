"""What the process that forks warm commands imports, and calls once for its machine code.

Sweeps and campaigns would import statistics and figures for a second each.
"""

import matplotlib.backends.backend_agg
import matplotlib.backends.backend_svg  # noqa: F401 - figures need it
import pandas  # noqa: F401 - pyarrow imports it
import typer
import warm  # noqa: F401 - each forked command runs a function of it

import gcs.fleet.flight
import gcs.fleet.preload  # flies once
import gcs.lab.figures.campaign
import gcs.lab.figures.sweep
import gcs.lab.reports.campaign
import gcs.lab.reports.sweep
import gcs.lab.reproduce  # noqa: F401 - as the others: commands that are forked need it
from gcs.cli import COMMANDS, app
from gcs.fleet.fork_server import _load_compiled_code

_group = typer.main.get_group(app)
for _name in COMMANDS:
    _group.load(_name)  # type: ignore[attr-defined]  # our own class
_load_compiled_code()
