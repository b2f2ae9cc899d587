"""``gcs new``: start a scenario of your own, or a project with a control law."""

import keyword
import re
import shutil
from pathlib import Path
from typing import Annotated

import typer

from ftc_autopilot.control.laws import LAWS
from gcs.errors import BadInput
from gcs.terminal import print_line
from mavlink_defs.config.yaml_text import yaml_of

EPILOG = """
Examples:

- gcs new my.yaml && gcs fly my.yaml
- gcs new --project my-law && pip install -e ./my-law && gcs fly my_law/first

Exit status: 0 written, 2 the file or folder exists or cannot be written.
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
# controller: {{kind: pid}}          # or another of `gcs laws`; proposed is the paper's law
# trigger: {{mode: periodic}}        # send every channel in every control period
# trigger: {{b2_deg: 0.5}}           # absolute threshold of the surfaces
# uncertainty: {{mass: 1.1}}         # the true aircraft is heavier than the controller knows
"""


PROJECT = Path(__file__).parents[1] / "project"
"""Template of a project; PROJECT and PACKAGE in its texts and paths are replaced."""
_RENAMED = {"gitignore": ".gitignore"}


def new(
    file: Annotated[
        Path | None,
        typer.Argument(help="New scenario file.", metavar="FILE", show_default=False),
    ] = None,
    project: Annotated[
        Path | None,
        typer.Option(
            help="New folder for a project: a control law, a scenario, a campaign and tests, as a "
            "package that registers them.",
            metavar="FOLDER",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write a commented scenario, or a whole project, to start from."""
    if (file is None) == (project is None):
        raise BadInput("expected either FILE or --project FOLDER", "see `gcs new --help`")
    if file is not None:
        _write_scenario(file)
    elif project is not None:
        _write_project(project)


def _write_project(folder: Path) -> None:
    """Write the files of the template, with the folder's name as the project's and package's."""
    name = folder.resolve().name
    package = re.sub(r"[-. ]+", "_", name).lower()
    if not re.fullmatch(r"[a-z][a-z0-9_]*", package) or keyword.iskeyword(package):
        text = f"--project is {name!r}, which makes no name of a package"
        raise BadInput(text, "letters, digits, - and _, beginning with a letter, as in my-law")
    if package in LAWS:
        text = f"--project is {name!r}, and {package} is a law of ftc-sitl"
        raise BadInput(text, "choose another name")
    if folder.exists():
        raise BadInput(f"{folder} already exists and was not changed", "choose another name")
    part = folder.with_name(f"{name}.part")
    try:
        for path in sorted(PROJECT.rglob("*")):
            if path.is_dir() or "__pycache__" in path.parts:
                continue
            inner = path.relative_to(PROJECT).as_posix().replace("PACKAGE", package)
            target = part / _RENAMED.get(inner, inner)
            target.parent.mkdir(parents=True, exist_ok=True)
            text = path.read_text(encoding="utf-8")
            text = text.replace("PACKAGE", package).replace("PROJECT", name)
            target.write_text(text, encoding="utf-8")
        part.rename(folder)
    except OSError as problem:
        shutil.rmtree(part, ignore_errors=True)
        raise BadInput(f"cannot write {folder}: {problem.strerror}") from problem
    print_line(
        f"{folder} written: its law is in {package}/law.py\n"
        f"next: pip install -e {folder} && gcs fly {package}/first"
    )


def _write_scenario(file: Path) -> None:
    try:
        with file.open("x", encoding="utf-8") as out:
            out.write(_TEXT.format(name=yaml_of({"name": file.stem})))
    except FileExistsError:
        text = f"{file} already exists and was not changed"
        raise BadInput(text, "choose another name, or remove it") from None
    except OSError as problem:
        raise BadInput(f"cannot write {file}: {problem.strerror}") from problem
    print_line(f"{file} written; `gcs fly {file}` flies it")
