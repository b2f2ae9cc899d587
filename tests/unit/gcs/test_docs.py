"""The documentation names what the code has, and its example flies."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel, RootModel

from gcs.closed_loop import fly_in_process
from gcs.recording import Recording
from gcs.run_folder import save_flight
from gcs.scenario import Scenario, load_scenario
from gcs.summary import summarise
from mavlink_defs.faults import fault_to_params
from sitl_plant.actuators import MAX_FAULTS

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
SCENARIO_MD = (DOCS / "scenario.md").read_text()
WIRE_MD = (DOCS / "wire.md").read_text()


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


def dialect_names() -> list[str]:
    tree = ET.parse(ROOT / "mavlink_defs" / "ftc.xml")
    messages = [message.attrib["name"] for message in tree.iter("message")]
    commands = [e.attrib["name"] for e in tree.iterfind(".//enum[@name='MAV_CMD']/entry")]
    return messages + commands


def dialect_fields() -> list[tuple[str, str]]:
    tree = ET.parse(ROOT / "mavlink_defs" / "ftc.xml")
    return [
        (message.attrib["name"], field.attrib["name"])
        for message in tree.iter("message")
        for field in message.iter("field")
    ]


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
    assert fault_to_params(fault)[:3] == (1.0, 0.8, 0.5)


def test_every_scenario_key_is_documented() -> None:
    keys = {key for model in models_in(Scenario) for key in model.model_fields}
    assert {"between", "until_s", "speed_scale", "rate_rad_s", "cl_da"} <= keys
    assert keys - names_in_code(SCENARIO_MD) == set()


def test_fault_capacity_is_documented() -> None:
    assert f"at most {MAX_FAULTS} faults" in SCENARIO_MD


def test_every_result_is_documented(example: Scenario, flight: Recording, tmp_path: Path) -> None:
    summary = summarise(flight, example)
    save_flight(flight, summary, tmp_path)
    uav = summary["uavs"][0]
    keys = {*summary, *uav, *uav["channels"], *uav["channels"]["rudder"], *uav["iae"]}
    arrays = {*(flight.signals.dtype.names or ()), *(p.name for p in tmp_path.iterdir())}
    arrays = {re.sub(r"^((?:Phi|g|beta)_\w+)_dot$", r"\1", name) for name in arrays}
    documented = names_in_code(SCENARIO_MD) | set(re.findall(r"`([\w.]+)`", SCENARIO_MD))
    assert keys - documented == set()
    assert arrays - documented == set()


@pytest.mark.parametrize("name", dialect_names())
def test_dialect_name_is_documented(name: str) -> None:
    assert re.search(rf"\b{name}\b", WIRE_MD)


@pytest.mark.parametrize(("message", "field"), dialect_fields())
def test_message_field_is_documented(message: str, field: str) -> None:
    row = next(line for line in WIRE_MD.splitlines() if re.match(rf"\| \d+ {message} \|", line))
    assert re.search(rf"\b{field}\b", row)


@pytest.mark.parametrize("document", sorted(path.stem for path in DOCS.glob("*.md")))
def test_links_lead_somewhere(document: str) -> None:
    text = (DOCS / f"{document}.md").read_text()
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        assert (DOCS / target).exists(), target


def test_functions_named_in_the_equation_table_exist() -> None:
    text = (DOCS / "method.md").read_text()
    rows = re.findall(r"`(\w+/\w+\.py)`: ((?:`\w+`(?:, )?)+)", text)
    assert len(rows) > 15
    for path, functions in rows:
        source = (ROOT / path).read_text()
        for function in re.findall(r"\w+", functions):
            assert f"def {function}(" in source, f"{path}: {function}"
