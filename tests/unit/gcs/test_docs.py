"""The documentation names what the code has, and its example flies."""

import inspect
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, get_args

import pytest
from pydantic import BaseModel, RootModel

import ftc_autopilot.hot.link
import ftc_autopilot.hot.loop
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.guidance.path import MAX_COMMANDS, MAX_LEGS
from ftc_autopilot.guidance.targets import MAX_VISITS
from gcs.command_list import OWN, registered
from gcs.console.errors import BadInput, CommandRefused, FlightLost, Interrupted, NoAnswer
from gcs.fleet.in_process import fly_in_process
from gcs.results.export import save_arrays_of
from gcs.results.recording import Recording
from gcs.results.run_folder import save_summary
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.constants import MAX_MISSION_ITEMS
from mavlink_defs.faults.actuators import MAX_FAULTS
from scripts import docs_pages

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
SCENARIO_MD = (DOCS / "reference" / "scenario.md").read_text()


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Every model that an annotation contains, at any depth."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if not issubclass(annotation, RootModel):
            yield annotation
        for field in annotation.model_fields.values():
            yield from models_in(field.annotation)
    for part in get_args(annotation):
        yield from models_in(part)


def names_in_code(text: str) -> set[str]:
    """All identifiers that stand between backticks."""
    return {name for span in re.findall(r"`([^`\n]+)`", text) for name in re.findall(r"\w+", span)}


def nav_pages() -> set[str]:
    """Paths of all pages of the site but the home page, relative to `docs`."""
    return {path for pages in docs_pages.navigation().values() for path in pages.values()}


@cache
def generated(page: str) -> str:
    """A page of the reference as the site has it, with its generated tables."""
    return docs_pages.on_page_markdown((DOCS / "reference" / f"{page}.md").read_text())


def dialect_names() -> list[str]:
    tree = ET.parse(ROOT / "mavlink_defs" / "ftc.xml")
    messages = [message.attrib["name"] for message in tree.iter("message")]
    commands = [e.attrib["name"] for e in tree.iterfind(".//enum[@name='MAV_CMD']/entry")]
    return messages + commands


class Field(NamedTuple):
    """A field of a private message, as the dialect has it."""

    message: str
    name: str
    length: int | None  # of an array
    unit: str  # empty if the dialect names none


def dialect_fields() -> list[Field]:
    tree = ET.parse(ROOT / "mavlink_defs" / "ftc.xml")
    found = []
    for message in tree.iter("message"):
        for field in message.iter("field"):
            length = re.search(r"\[(\d+)\]", field.attrib["type"])
            unit = field.attrib.get("units", "")
            found.append(
                Field(
                    message.attrib["name"],
                    field.attrib["name"],
                    int(length[1]) if length else None,
                    unit,
                )
            )
    return found


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    blocks = re.findall(r"```yaml\n(.*?)```", SCENARIO_MD, re.DOTALL)
    assert len(blocks) == 1
    path = tmp_path_factory.mktemp("docs") / "my.yaml"
    path.write_text(blocks[0])
    return load_scenario(path)


@pytest.fixture(scope="module")
def flight(example: Scenario) -> Recording:
    return fly_in_process(example)


def test_example_flies_to_its_end(flight: Recording) -> None:
    assert flight.loss is None


def test_example_sets_its_fault(example: Scenario) -> None:
    [(uav, fault)] = example.fault_commands()
    assert uav == 2
    assert fault.params[:3] == (1.0, 0.8, 0.5)


def test_every_scenario_key_is_documented() -> None:
    keys = {key for model in models_in(Scenario) for key in model.model_fields}
    assert {"between", "until_s", "speed_scale", "rate_rad_s", "cl_da"} <= keys
    assert keys - names_in_code(generated("scenario")) == set()


def test_fault_capacity_is_documented() -> None:
    assert f"at most {MAX_FAULTS} faults" in SCENARIO_MD


def test_every_result_is_documented(example: Scenario, flight: Recording, tmp_path: Path) -> None:
    report = summarise(flight, example)
    save_summary(report, tmp_path)
    save_arrays_of(flight, tmp_path)
    summary = report.to_json()
    uav = summary["uavs"][0]
    keys = {*summary, *uav, *uav["channels"], *uav["channels"]["rudder"], *uav["iae"]}
    arrays = {*(flight.signals.dtype.names or ()), *(p.name for p in tmp_path.iterdir())}
    arrays = {re.sub(r"^((?:Phi|g|beta)_\w+)_dot$", r"\1", name) for name in arrays}
    documented = names_in_code(SCENARIO_MD) | set(re.findall(r"`([\w.]+)`", SCENARIO_MD))
    assert keys - documented == set()
    assert arrays - documented == set()


def test_every_name_and_field_of_the_dialect_is_documented(subtests: pytest.Subtests) -> None:
    page = generated("messages")
    assert not [name for name in dialect_names() if f"\n### {name}\n" not in page]
    for field in dialect_fields():
        with subtests.test(f"{field.message}.{field.name}"):
            section = page.partition(f"\n### {field.message}\n")[2].partition("\n#")[0]
            (row,) = re.findall(rf"^\| `{field.name}` \|.*$", section, re.MULTILINE)
            _, _, kind, unit, text, _ = row.split(" | ".strip())
            assert re.findall(r"\[(\d+)\]", kind) == ([str(field.length)] if field.length else [])
            assert unit.strip() == field.unit
            assert text.strip()


def test_every_parameter_is_documented() -> None:
    models: list[type[BaseModel]] = [*TRIGGERS.values(), *LAWS.values()]
    keys = {key for model in models for key in model.model_fields} - {
        "kind",
        "mode",
        "rbf",
        "diagnosis",
        "loops",
    }
    assert {"b2_deg", "lambda1", "K1", "rate_p"} <= keys
    assert keys - names_in_code(generated("parameters")) == set()
    assert {"RBF_NEURONS", "K1_ROLL", "TRIG_MODE"} <= names_in_code(generated("parameters"))


def test_every_command_of_gcs_is_documented() -> None:
    page = generated("commands")
    for name in (*OWN, *registered()):
        assert f"\n### `gcs {name}`\n" in page


def test_listed_commands_have_whole_sentences_and_links() -> None:
    page = generated("commands")
    listed = re.findall(r"^\* \[`(gcs [a-z -]+)`\]\(#([a-z-]+)\): (.*)$", page, re.MULTILINE)
    assert len(listed) == len(re.findall(r"^#{3,5} `gcs ", page, re.MULTILINE))
    assert all(anchor == name.replace(" ", "-") for name, anchor, _ in listed)
    assert not [sentence for _, _, sentence in listed if sentence.endswith("...")]
    assert "$ gcs" not in page  # it would be copied with the command


@pytest.mark.parametrize("page", ["scenario", "campaign"])
def test_a_key_that_holds_a_mapping_links_to_the_table_of_its_keys(page: str) -> None:
    links = re.findall(r"\[mapping\]\((\w+)\.md#([\w-]+)\)", generated(page))
    assert len(links) >= 3
    assert all(f'<a id="{anchor}"></a>' in generated(target) for target, anchor in links)


def test_the_home_page_lists_every_page_and_the_first_command() -> None:
    home = docs_pages.on_page_markdown((DOCS / "index.md").read_text())
    assert set(re.findall(r"^- \[[^]]+\]\(([^)]+)\)", home, re.MULTILINE)) == nav_pages()
    assert "\n    make fly " in home


def test_first_sentences_are_whole() -> None:
    sentences = [docs_pages.first_sentence(DOCS / page) for page in sorted(nav_pages())]
    whole = re.compile(r"(: [\w`\"*].{15,}\.)?")
    assert not [s for s in sentences if s.count("`") % 2 or not whole.fullmatch(s)]


@pytest.mark.parametrize("mark", ["keys wings", "pages Wings", "readme Wings", "wings"])
def test_a_page_cannot_ask_for_what_does_not_exist(mark: str) -> None:
    with pytest.raises(LookupError):
        docs_pages.on_page_markdown(f"<!-- generated: {mark} -->")


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_reads_offline(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs")
    build = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir"]
    done = subprocess.run(
        [*build, tmp_path / "site"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    page = (tmp_path / "site" / "reference" / "scenario.html").read_text()
    assert "<!-- generated" not in page
    assert "<code>rbf.speed_scale</code>" in page
    api = (tmp_path / "site" / "reference" / "api.html").read_text()
    assert 'id="gcs.station.client.Client"' in api
    index = (tmp_path / "site" / "search" / "search_index.js").read_text()
    assert index.startswith("var __index = {")  # a page in a folder can load a script, no JSON
    assert '<script src="../javascripts/iframe-worker.js"></script>' in page
    assert "IFrameWorker" in (tmp_path / "site" / "javascripts" / "iframe-worker.js").read_text()
    fetches = re.compile(r"<(?:script|img|link)[^>]*(?:src|href)=\"?(https?:[^\" >]*)")
    for html in (tmp_path / "site").rglob("*.html"):
        assert fetches.findall(html.read_text()) == [], html


@cache
def anchors_of(path: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub gives them, and those it names itself."""
    text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    text = docs_pages.on_page_markdown(text)
    named = set(re.findall(r"\{ #(\S+) \}", text))
    headings = re.findall(r"^#+ +(.+)$", text, re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return named | {heading.replace(" ", "-") for heading in plain}


def test_links_lead_somewhere() -> None:
    lost = []
    for page in PAGES:
        for target, anchor in re.findall(r"\]\(([^)#\s]*)#?([^)\s]*)\)", page.read_text()):
            path = page.parent / target if target else page
            if "://" in target or (path.exists() and (not anchor or anchor in anchors_of(path))):
                continue
            lost.append(f"{page.relative_to(ROOT)}: {target}#{anchor}")
    assert not lost, "\n".join(lost)


def test_what_is_missing_is_in_one_place() -> None:
    assert not [str(page) for page in PAGES if "not yet" in page.read_text()]


@pytest.mark.parametrize("page", [DOCS / "reference/scenario.md", DOCS / "how-to/station.md"])
def test_exit_statuses_match_the_errors(page: Path) -> None:
    table = page.read_text().partition("## Exit status\n")[2].partition("\n#")[0]
    meaning = dict(re.findall(r"^\| (\d+) \| (.*) \|$", table, re.MULTILINE))
    errors = (FlightLost, BadInput, CommandRefused, NoAnswer, Interrupted)
    assert {str(error.exit_status) for error in errors} <= meaning.keys()
    for error, word in ((CommandRefused, "refused"), (NoAnswer, "not answer")):
        assert [n for n, text in meaning.items() if word in text] == [str(error.exit_status)]


def assert_in_order(text: str, *parts: str) -> None:
    places = [text.rindex(part) for part in parts]
    assert places == sorted(places)


def test_the_order_of_a_step_matches_the_code() -> None:
    loop = inspect.getsource(ftc_autopilot.hot.loop)
    calls = "prepare_step(", "controller_step(", "save(", "send_step(", "report_done("
    assert_in_order(loop, *calls)
    step = inspect.getsource(ftc_autopilot.hot.link.send_step)
    assert_in_order(step, "MessageId.ACTUATORS", "send_own_state(")
    done = inspect.getsource(ftc_autopilot.hot.link.report_done)
    assert "MessageId.STEP_DONE" in done
    documented = (
        (DOCS / "explanation" / "method.md").read_text().partition("## Order of operations")[2]
    )
    parts = ("actuator message", "to the neighbours", "step done")
    places = [documented.index(part) for part in parts]
    assert places == sorted(places)


def test_functions_named_in_the_equation_table_exist() -> None:
    text = (DOCS / "explanation" / "method.md").read_text()
    rows = re.findall(r"`([\w/]+\.py)`: ((?:`\w+`(?:, )?)+)", text)
    assert len(rows) > 15
    for path, functions in rows:
        source = (ROOT / path).read_text()
        for function in re.findall(r"\w+", functions):
            assert f"def {function}(" in source, f"{path}: {function}"


def test_limits_of_missions_in_the_docs_match_the_code() -> None:
    missions = (DOCS / "reference" / "missions.md").read_text()
    limits = (f"{MAX_MISSION_ITEMS} items", f"{MAX_LEGS} legs", f"{MAX_VISITS} visits")
    for text in (*limits, f"{MAX_COMMANDS} of them"):
        assert f" {text}" in missions


def test_the_page_knows_the_bytes_of_a_message_that_relays() -> None:
    hexagon = load_scenario(Path("missions/hexagon")).model_copy(update={"duration_s": 0.1})
    signals = fly_in_process(hexagon).signals
    short, relaying = sorted(
        set(signals["report_size"][signals["neighbour_message"] == 1].tolist())
    )
    assert short == 0
    page = (DOCS / "explanation" / "neighbour-messages.md").read_text()
    assert f"\n{relaying} bytes more in one message of twenty" in page
