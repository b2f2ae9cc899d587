"""Build hook: generate `mavlink_defs/dialect.py`, and bundle the scenarios.

It runs for wheels and for editable installs alike, so the dialect is never committed.
pymavlink's generator wants the included definitions beside the including one, hence
the temporary folder. Wheels get a copy of `scenarios/`; an editable install reads that folder.
"""

import py_compile
import shutil
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

INCLUDED = ("common.xml", "standard.xml", "minimal.xml")


class DialectHook(BuildHookInterface):
    """Prepares the package before hatchling collects its files."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Prepare a wheel; `version` is 'standard' or 'editable'."""
        generate(Path(self.root) / "mavlink_defs")
        if version == "standard":
            build_data["force_include"]["scenarios"] = "gcs/bundled_scenarios"


def generate(package: Path) -> None:
    """Generate `package/dialect.py` from `package/ftc.xml`.

    Raises:
        RuntimeError: pymavlink refused the definition (its own output says why).
    """
    import pymavlink
    from pymavlink.generator import mavgen

    shipped = Path(pymavlink.__file__).parent / "dialects" / "v20"
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        for name in INCLUDED:
            shutil.copy(shipped / name, work / name)
        shutil.copy(package / "ftc.xml", work / "ftc.xml")
        options = mavgen.Opts(
            str(work / "dialect.py"), wire_protocol="2.0", language="Python3", validate=True
        )
        if not mavgen.mavgen(options, [str(work / "ftc.xml")]):
            raise RuntimeError("pymavlink's generator refused mavlink_defs/ftc.xml")
        shutil.copy(work / "dialect.py", package / "dialect.py")
    # the module is large: every process of a fleet would parse it anew if none may write bytecode
    py_compile.compile(str(package / "dialect.py"), doraise=True)


if __name__ == "__main__":
    generate(Path(__file__).parent / "mavlink_defs")
