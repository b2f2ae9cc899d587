"""The notebook of the documentation runs, and shows what it holds."""

import json
from pathlib import Path
from typing import Any

import pytest

from scripts import docs_pages

NOTEBOOK = Path(__file__).parents[4] / "docs" / "notebooks" / "first_flight.ipynb"


def texts(cell: Any) -> list[str]:
    """What a cell prints or shows as text, but for what took which time."""
    found = []
    for output in cell["outputs"]:
        text = output.get("data", {}).get("text/plain", output.get("text"))
        found.append("".join(text))
    return found


@pytest.mark.slow
def test_the_notebook_runs_and_shows_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in ("xarray", "ipykernel"):
        pytest.importorskip(package)
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    stored, flown = (nbformat.read(NOTEBOOK, as_version=4) for _ in range(2))
    for cell in flown.cells:
        if cell.cell_type == "code":
            cell.outputs = []
    nbclient.NotebookClient(flown, timeout=300, kernel_name="python3").execute()
    code = [(a, b) for a, b in zip(stored.cells, flown.cells, strict=True) if "outputs" in a]
    assert len(code) == 6
    for expected, found in code:
        assert texts(found) == texts(expected) != []
    assert "Transmissions in 24000 control periods" in code[0][1].outputs[0].data["text/html"]
    assert code[1][1].outputs[0].data["image/png"]


def test_the_page_has_all_cells_and_outputs() -> None:
    page = docs_pages.notebook("first_flight")
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    assert page.count("```python\n") == sum(cell["cell_type"] == "code" for cell in cells)
    for cell in cells:
        assert "".join(cell["source"]) in page
    assert page.count('src="data:image/png;base64,') == 1
    assert page.count("<table") == 2
    assert "Transmissions in 24000 control periods" in page
    assert "<style" not in page
    assert "was lost at 13.898 s" in page
