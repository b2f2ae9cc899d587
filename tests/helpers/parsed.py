"""The sources of the packages as nodes of their trees, for checks of how they are written."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "ftc_lab")
TEMPLATE = ROOT / "gcs" / "project"


@cache
def nodes() -> list[tuple[str, ast.AST]]:
    """Every class, function and call of the packages, and its file."""
    kinds = (ast.ClassDef, ast.FunctionDef, ast.Call)
    return [
        (str(path.relative_to(ROOT)), node)
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if path.name != "dialect.py" and not path.is_relative_to(TEMPLATE)
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, kinds)
    ]
