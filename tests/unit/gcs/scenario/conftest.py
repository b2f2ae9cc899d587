"""Scenario 1 as plain data."""

from pathlib import Path
from typing import Any

import pytest
import yaml

PAPER = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"


@pytest.fixture
def tree() -> Any:
    tree = yaml.safe_load(PAPER.read_text())
    tree["links"] = {}
    tree["uncertainty"] = {}
    return tree
