"""Build hook: generate `mavlink_defs/dialect.py`, and bundle scenarios and aircraft.

It runs for wheels and for editable installs alike, so the dialect is never committed.
Wheels get copies of `scenarios/` and `aircraft/`; an editable install reads these folders.
"""

import py_compile
import runpy
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class DialectHook(BuildHookInterface):
    """Prepares the package before hatchling collects its files."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Prepare a wheel; `version` is 'standard' or 'editable'."""
        generate(Path(self.root) / "mavlink_defs")
        if version == "standard":
            build_data["force_include"]["scenarios"] = "gcs/bundled_scenarios"
            build_data["force_include"]["aircraft"] = "gcs/bundled_aircraft"


def generate(package: Path) -> None:
    """Generate `package/dialect.py` from `package/ftc.xml`.

    Raises:
        RuntimeError: pymavlink refused the definition.
    """
    text = runpy.run_path(str(package / "mavgen.py"))["generate"]("Python3")
    (package / "dialect.py").write_text(text, encoding="utf-8")
    # the module is large: every process of a fleet would parse it again if none may write bytecode
    py_compile.compile(str(package / "dialect.py"), doraise=True)


if __name__ == "__main__":
    generate(Path(__file__).parent / "mavlink_defs")
