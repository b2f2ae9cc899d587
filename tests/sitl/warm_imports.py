"""What the process that forks warm commands imports, and calls once for its machine code.

Sweeps and campaigns would import statistics and figures for a second each.
"""

import matplotlib.backends.backend_agg
import matplotlib.backends.backend_svg  # noqa: F401 - figures need it
import pandas  # noqa: F401 - pyarrow imports it
import typer
import warm  # noqa: F401 - each forked command runs a function of it

import ftc_lab.figures.campaign
import ftc_lab.figures.sweep
import ftc_lab.reports.campaign
import ftc_lab.reports.sweep
import ftc_lab.reproduce  # noqa: F401 - as the others: commands that are forked need it
from gcs.commands.cli import app
from gcs.fleet.fork_server import _load_compiled_code

typer.main.get_group(app).load_all()  # type: ignore[attr-defined]  # our own class
_load_compiled_code()
