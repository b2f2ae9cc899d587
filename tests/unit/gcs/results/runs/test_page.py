"""The page of all runs: one file that fetches nothing and believes no name."""

import base64
import io
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from run_folders import make_run
from typer.testing import CliRunner

from gcs.commands.cli import app
from gcs.results.runs.details import curves_of, own_keys, scenario_keys, thumbnail
from gcs.results.runs.index import list_runs
from gcs.results.runs.page import save_page
from gcs.scenario.model import Scenario

NASTY = "</script><script>alert(1)</script>'\"&<!-- rows --><!-- data -->"


class Page(HTMLParser):
    """What a browser would make of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.cells: list[str] = []
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside = tag
        if tag in {"script", "td"}:
            (self.scripts if tag == "script" else self.cells).append("")

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.scripts[-1] += data
        elif self.cells:
            self.cells[-1] += data

    @property
    def data(self) -> Any:
        return json.loads(self.scripts[0])


def page_of(root: Path, **options: Any) -> Page:
    listing = list_runs(root)
    path = root / "index.html"
    options = {"compared": [], "figures": 100, **options}
    save_page(path, root, listing.runs, listing.foreign, **options)
    return Page(path.read_text())


@pytest.fixture
def root(cache: Path, tmp_path: Path) -> Path:
    root = tmp_path / "runs"
    for name, note in (("first", "plain"), ("second", NASTY)):
        folder = make_run(cache, root / name, scenario=NASTY)
        (folder / "note.txt").write_text(note)
        Image.new("RGB", (1200, 600), "red").save(folder / "flight.png")
    (root / "<u>odd").mkdir()
    return root


def test_every_run_has_a_row_and_names_are_texts(root: Path) -> None:
    page = page_of(root, compared=["second"])
    rows = [
        attributes for tag, attributes in page.tags if tag == "tr" and "data-name" in attributes
    ]
    assert {row["data-name"] for row in rows} == {"first", "second"}
    assert NASTY in [cell.strip() for cell in page.cells]
    assert [tag for tag, _ in page.tags].count("script") == 2
    assert "u" not in {tag for tag, _ in page.tags}
    assert set(page.data["runs"]) == {"first", "second"}
    assert page.data["compared"] == ["second"]


def test_how_a_flight_ended_and_how_good_it_was_comes_before_texts_of_any_length(
    root: Path,
) -> None:
    page = page_of(root)
    columns = [attributes["data-column"] or "" for _, attributes in page.tags
               if "data-column" in attributes]  # fmt: skip
    assert columns[:2] == ["run", "outcome"]
    assert all(name.startswith("IAE ") for name in columns[2:6])


def test_nothing_is_fetched(root: Path) -> None:
    page = page_of(root)
    for tag, attributes in page.tags:
        assert tag not in {"link", "iframe", "object", "embed"}
        source = attributes.get("src") or ""
        assert source == "" or source.startswith("data:image/webp;base64,")
        link = attributes.get("href") or ""
        assert not re.match(r"[a-z]+:|//", link)
    script = page.scripts[1]
    assert not re.search(
        r"fetch\(|XMLHttpRequest|import\(|innerHTML|eval\(|document\.write", script
    )
    style = (root / "index.html").read_text().partition("</style>")[0]
    assert "url(" not in style
    assert "@import" not in style


def test_links_lead_to_the_folders_from_where_the_page_is(root: Path, tmp_path: Path) -> None:
    listing = list_runs(root)
    path = tmp_path / "talk" / "page.html"
    path.parent.mkdir()
    save_page(path, root, listing.runs, [], [], 5)
    links = [a["href"] for tag, a in Page(path.read_text()).tags if tag == "a"]
    assert len(links) == 4  # a folder and a figure of each
    assert all((path.parent / str(link)).exists() for link in links)


def test_only_so_many_runs_have_details(root: Path) -> None:
    page = page_of(root, figures=1)
    assert len(page.data["runs"]) == 1
    assert [tag for tag, _ in page.tags].count("img") == 1


def test_a_thumbnail_is_small_and_a_damaged_figure_has_none(root: Path) -> None:
    path = root / "first" / "flight.png"
    data = base64.b64decode(thumbnail(path).partition(",")[2])
    with Image.open(io.BytesIO(data)) as image:
        assert image.size == (240, 120)
    path.write_bytes(path.read_bytes()[:50])
    assert thumbnail(path) == ""


def test_curves_are_of_the_recording(root: Path) -> None:
    folder = root / "first"
    curves = curves_of(folder)
    assert curves is not None
    table = pa.ipc.open_stream((folder / "trajectory.arrows").read_bytes()).read_all()
    for name in ("airspeed", "roll"):
        error = np.abs(np.asarray(table.column(f"error_{name}")))
        error = error if name == "airspeed" else np.degrees(error)
        largest = np.nanmax(error)
        assert max(v for v in curves[name] if v is not None) == pytest.approx(largest, rel=1e-3)
    events = pa.ipc.open_stream((folder / "events.arrows").read_bytes()).read_all()
    assert curves["events"] == sorted(curves["events"])
    end_s = np.asarray(table.column("time_s"))[-1]
    assert curves["events"][-1] == (np.asarray(events.column("time_s")) <= end_s).sum()
    (folder / "trajectory.arrows").unlink()
    assert curves_of(folder) is None


def test_keys_of_a_scenario_are_those_of_set(root: Path, scenario1: Scenario) -> None:
    keys = scenario_keys(root / "first")
    assert keys["duration_s"] == "0.05"
    assert keys["faults[0].actuator"] == "rudder"
    assert keys["aircraft.mass_kg"] == str(scenario1.aircraft.mass_kg)
    (root / "first" / "scenario.yaml").write_text("[")
    assert scenario_keys(root / "first") == {}


@given(
    st.lists(
        st.dictionaries(st.sampled_from("abcd"), st.sampled_from(["", "1", "2"]), max_size=4),
        max_size=5,
    )
)
def test_what_differs_from_the_commonest_values_is_all_there_is(
    keys: list[dict[str, str]],
) -> None:
    common, own = own_keys(keys)
    assert len(own) == len(keys)
    for whole, part in zip(keys, own, strict=True):
        if whole:
            assert {**common, **part} == {name: whole.get(name, "") for name in common}
            assert all(common[name] != value for name, value in part.items())
        else:
            assert part == {}


def test_the_command_writes_it_and_notes(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root.parent)

    def run(*arguments: str) -> str:
        done = CliRunner().invoke(app, ["runs", *arguments])
        assert done.exit_code == 0, done.output
        return done.stdout

    run("note", "runs/first", "  the one in the talk ")
    listed = json.loads(run("--json", "--where", "note~talk"))
    assert [one["name"] for one in listed["runs"]] == ["first"]
    assert listed["foreign"] == [{"name": "<u>odd", "reason": "empty"}]
    assert "note: the one in the talk" in run()
    run("note", "runs/first", "")
    assert not (root / "first" / "note.txt").exists()
    run("html", "--compare", "runs/first", "--compare", "second")
    assert Page((root / "index.html").read_text()).data["compared"] == ["first", "second"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "cannot list the runs in nowhere"),
        (["note", "runs", "x"], "runs is no run"),
        (["note", "nowhere", "x"], "nowhere cannot be read"),
        (["html", "--compare", "runs/third"], "runs/third is no run in runs"),
        (["--sort", "colour"], "unknown key 'colour'"),
        (["--where", "law"], "expected KEY=VALUE"),
    ],
)
def test_a_mistake_gets_one_message(
    root: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(root.parent)
    done = CliRunner().invoke(app, ["runs", *arguments])
    assert done.exit_code != 0
    assert message in str(done.exception)
    assert not (root / "index.html").exists()


def test_figures_in_which_a_simpler_law_flew_the_same_better_are_known(
    cache: Path, tmp_path: Path
) -> None:
    root = tmp_path / "runs"
    laws = {"simple": "pid", "later": "tube", "other": "tube"}
    for name, law in laws.items():
        folder = make_run(cache, root / name, saving={"simple": 0.9}.get(name, 0.5))
        tree = yaml.safe_load((folder / "scenario.yaml").read_text())
        tree["controller"] = {"kind": law}
        tree["duration_s"] += name == "other"  # another flight: nothing to compare with
        (folder / "scenario.yaml").write_text(yaml.safe_dump(tree))
    beaten = page_of(root, figures=3).data["beaten"]
    assert set(beaten) == {"simple", "later"}
    assert {column for column, better in beaten["later"].items() if better} == {"saved [%]"}
    assert beaten["later"]["saved [%]"] == ["simple"]
    assert not any(beaten["simple"].values())
    make_run(cache, root / "fallen", completed=False, loss="it fell")
    folder = root / "fallen"
    shutil.copy(root / "later" / "scenario.yaml", folder / "scenario.yaml")
    beaten = page_of(root, figures=4).data["beaten"]["fallen"]
    assert all(better == ["simple"] for better in beaten.values())
