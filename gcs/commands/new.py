"""``gcs new``: start a scenario of your own."""

from pathlib import Path
from typing import Annotated

import typer

from gcs.errors import BadInput
from gcs.terminal import print_line
from mavlink_defs.config.yaml_text import yaml_of

EPILOG = """
Examples:

- gcs new my.yaml && gcs fly my.yaml

Exit status: 0 written, 2 the file exists or cannot be written.
"""

_TEXT = """\
# A scenario states only its differences from the one that it extends: a file, or a bundled
# scenario (`gcs scenarios` lists them). Units are part of each key.

extends: paper/scenario1

{name}description: The rudder of follower 2 loses a fifth of its effectiveness.
duration_s: 24.0

# This list replaces the one of paper/scenario1. `faults: []` flies without any.
faults:
  - {{uav: 3, actuator: rudder, effectiveness: 0.8, start_s: 19.0, end_s: 22.0}}

# Remove a "# " to try it:
# controller: {{kind: pid}}          # or backstepping; proposed is the paper's law
# trigger: {{mode: periodic}}        # send every channel in every control period
# trigger: {{b2_deg: 0.5}}           # absolute threshold of the surfaces
# uncertainty: {{mass: 1.1}}         # the true aircraft is heavier than the controller knows
"""


def new(
    file: Annotated[Path, typer.Argument(help="New scenario file.", metavar="FILE")],
) -> None:
    """Write a small commented scenario as a starting point for your own."""
    try:
        with file.open("x", encoding="utf-8") as out:
            out.write(_TEXT.format(name=yaml_of({"name": file.stem})))
    except FileExistsError:
        text = f"{file} already exists and was not changed"
        raise BadInput(text, "choose another name, or remove it") from None
    except OSError as problem:
        raise BadInput(f"cannot write {file}: {problem.strerror}") from problem
    print_line(f"{file} written; `gcs fly {file}` flies it")
