"""``gcs new``: start a scenario of your own, or a project with a control law."""

import json
import keyword
import re
import shutil
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from ftc_autopilot.control.laws import LAWS
from gcs.console.errors import BadInput
from gcs.console.lines import print_line
from gcs.console.outputs import make_folder, write_file
from mavlink_defs.config.yaml_text import yaml_of

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
"""Template of a project; PROJECT, PACKAGE and SOURCE in its texts and paths are replaced."""
_RENAMED = {"gitignore": ".gitignore"}


def new(
    file: Annotated[Path | None, typer.Argument(metavar="FILE", show_default=False)] = None,
    project: Annotated[Path | None, typer.Option(metavar="FOLDER", show_default=False)] = None,
    source: Annotated[str | None, typer.Option(metavar="URL", show_default=False)] = None,
) -> None:
    """Write a commented scenario, or a whole project, to start from.

    Args:
        file: New scenario file.
        project: New folder for a project: a control law, a scenario, a campaign and tests, as a
            package that registers them.
        source: Where the project's CI and its users install ftc-sitl from, as pip takes it: the URL
            of a repository (git+https://...) or of a wheel. Without it: where this one is from.

    Examples:
        - gcs new my.yaml && gcs fly my.yaml
        - gcs new --project my-law && pip install -e ./my-law && gcs fly my_law/first
        - gcs new --project my-law --source git+https://example.org/me/ftc-sitl.git

    Exit status: 0 written, 1 it cannot be written, 2 the file or folder exists, or bad input.
    """
    if (file is None) == (project is None):
        raise BadInput("expected either FILE or --project FOLDER", "see `gcs new --help`")
    if file is not None:
        if source is not None:
            raise BadInput("--source is of a project", "gcs new --project FOLDER --source URL")
        _write_scenario(file)
    elif project is not None:
        _write_project(project, _source_of(source))


def _source_of(chosen: str | None) -> str:
    """Return the URL of ftc-sitl as pip takes it: a chosen one, or where this one is from.

    Raises:
        BadInput: It is no URL, or nobody knows where this one is from.
    """
    source = chosen or _own_source()
    if source is None:
        text = "this ftc-sitl does not say where it was installed from"
        raise BadInput(text, "name it by --source, as in --source git+https://HOST/ftc-sitl.git")
    if not re.fullmatch(r"[a-z+]+://[^\s'\"\\]+", source):
        text = f"--source is {source!r}, expected a URL without blanks"
        raise BadInput(text, "as in git+https://example.org/me/ftc-sitl.git or file:///tmp/a.whl")
    return source


def _own_source() -> str | None:
    """Return what pip noted when it installed ftc-sitl from a URL or a folder."""
    noted = json.loads(distribution("ftc-sitl").read_text("direct_url.json") or "{}")
    if (vcs := noted.get("vcs_info")) is not None:
        return f"{vcs['vcs']}+{noted['url']}@{vcs['commit_id']}"
    url: str | None = noted.get("url")
    return url


def _package_of(folder: Path) -> str:
    """Return the name of a new project's package.

    Raises:
        BadInput: The folder exists, or has a name that is taken, or makes none.
    """
    name = folder.resolve().name
    package = re.sub(r"[-. ]+", "_", name).lower()
    if not re.fullmatch(r"[a-z][a-z0-9_]*", package) or keyword.iskeyword(package):
        text = f"--project is {name!r}, which makes no name of a package"
        raise BadInput(text, "letters, digits, - and _, beginning with a letter, as in my-law")
    if package in LAWS:
        text = f"--project is {name!r}, and {package} is a law of ftc-sitl"
        raise BadInput(text, "choose another name")
    if _is_taken(name, package):
        text = f"--project is {name!r}, and {package} is installed here: it would be replaced"
        raise BadInput(text, "choose another name")
    if folder.exists():
        raise BadInput(f"{folder} already exists and was not changed", "choose another name")
    return package


def _is_taken(name: str, package: str) -> bool:
    """Return whether a project of that name would replace, or hide, what is installed."""
    try:
        distribution(name)
    except PackageNotFoundError:
        return find_spec(package) is not None
    return True


def _write_project(folder: Path, source: str) -> None:
    """Write the files of the template, with the folder's name as the project's and package's.

    Args:
        folder: The folder, new.
        source: Where ftc-sitl is installed from, for the CI.

    Raises:
        BadInput: Its name is none of a package, or it cannot be written.
    """
    name, package = folder.resolve().name, _package_of(folder)
    make_folder(folder.parent, "--project")
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
            text = text.replace("SOURCE", source)
            target.write_text(text, encoding="utf-8")
        part.rename(folder)
    except BaseException as problem:
        shutil.rmtree(part, ignore_errors=True)
        if isinstance(problem, OSError):
            raise OSError(problem.errno, problem.strerror, str(folder)) from None
        raise
    print_line(
        f"{folder} written: its law is in {package}/law.py\n"
        f"next: pip install -e {folder} && gcs fly {package}/first"
    )
    if source.startswith("file:"):
        print_line(
            f"its CI installs ftc-sitl from {source}, which other machines do not have: "
            "--source names another place"
        )


def _write_scenario(file: Path) -> None:
    if file.is_symlink() or file.exists():
        text = f"{file} already exists and was not changed"
        raise BadInput(text, "choose another name, or remove it")
    write_file(file, _TEXT.format(name=yaml_of({"name": file.stem})), "FILE")
    print_line(f"{file} written; `gcs fly {file}` flies it")
