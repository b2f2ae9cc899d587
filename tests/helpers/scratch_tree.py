"""A copy of the project, changed as "Where to add" of the architecture page says."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "ftc_lab")

Edits = Mapping[str, Iterable[tuple[str, str]]]
"""By file: texts, each before its first occurrence of which another one is inserted; a file that is
not there is empty."""


def listed_files(what: str) -> set[str]:
    """Return the files that the architecture page lists for an addition; * is any of them."""
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
    [row] = re.findall(rf"^\| {what} \| (.*?) \|", page, re.MULTILINE)
    return set(re.findall(r"`([\w/*]+\.\w+)`", row))


class ScratchTree:
    """A changed copy of the packages, whose dialect is generated as `make` does."""

    def __init__(self, folder: Path, edits: Edits) -> None:
        self.folder = folder
        skipped = shutil.ignore_patterns("*.pyc.*")
        for package in PACKAGES:
            shutil.copytree(ROOT / package, folder / package, ignore=skipped)
        (folder / "scenarios").symlink_to(ROOT / "scenarios")
        for name, changes in edits.items():
            text = (folder / name).read_text() if (folder / name).exists() else ""
            for before, inserted in changes:
                assert before in text, (name, before)
                text = text.replace(before, inserted + before, 1)
            (folder / name).write_text(text)
        self.run(
            "-c",
            "import pathlib, runpy;"
            "made = runpy.run_path('mavlink_defs/mavgen.py')['generate']('Python3');"
            "pathlib.Path('mavlink_defs/dialect.py').write_text(made)",
        )

    def run(self, *arguments: str) -> str:
        """Run Python in the copy, without compiling; return its output."""
        path = os.pathsep.join(map(str, (self.folder, ROOT / "tests" / "helpers")))
        env = os.environ | {"PYTHONPATH": path, "NUMBA_DISABLE_JIT": "1"}
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=self.folder,
            env=env,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        return done.stdout
