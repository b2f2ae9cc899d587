"""Each list and mapping of a user's file has a bound, which is checked before its entries."""

import types
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ftc_lab.campaigns.model import Campaign, load_campaign
from gcs.scenario.model import Scenario, load_scenario
from gcs.scenario.profile_file import ProfileFile, load_profile
from mavlink_defs.config.models import AtMost, ConfigError
from mavlink_defs.config.yaml_text import yaml_of

Place = tuple[str, ...]
SCENARIO_1 = "extends: paper/scenario1\n"


def bounds(annotation: Any, place: Place, declared: tuple[Any, ...]) -> Iterator[tuple[Place, Any]]:
    """Yield each list and mapping below a type, with its bound; None if it has none."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        first, *metadata = inner
        fields = (data for m in metadata if isinstance(m, FieldInfo) for data in m.metadata)
        yield from bounds(first, place, (*declared, *metadata, *fields))
    elif origin in {Union, types.UnionType}:
        for member in inner:
            yield from bounds(member, place, declared)
    elif origin is tuple and ... not in inner:
        for part in inner:
            yield from bounds(part, (*place, "[]"), ())
    elif origin in {tuple, list, dict}:
        yield place, next((m.most for m in declared if isinstance(m, AtMost)), None)
        for part in inner:
            if part is not ...:
                yield from bounds(part, (*place, "[]"), ())
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        for name, field in annotation.model_fields.items():
            below = place if name == "root" else (*place, name)
            yield from bounds(field.annotation, below, tuple(field.metadata))


FREE = {("variants", "[]")}
"""What is merged into a scenario is bounded as that is."""


@pytest.mark.parametrize("model", [Scenario, ProfileFile, Campaign])
def test_every_list_and_mapping_has_a_bound(model: type[BaseModel]) -> None:
    found = dict(bounds(model, (), ()))
    assert found
    assert {place for place, most in found.items() if most is None} <= FREE


@pytest.mark.parametrize(
    ("text", "place", "most"),
    [
        (SCENARIO_1 + "uavs: {}", "uavs", 250),
        (SCENARIO_1 + "network: {{edges: {}}}", "network.edges", 31_125),
        (SCENARIO_1 + "profile: {}", "profile", 50),
        (SCENARIO_1 + "faults: {}", "faults", 1000),
        (SCENARIO_1 + "mission: {{items: {}}}", "mission.items", 1000),
        (SCENARIO_1 + "links: {{impairments: {{gcs: {{outages: {}}}}}}}",
         "links.impairments.gcs.outages", 1000),
    ],
)  # fmt: skip
@pytest.mark.parametrize("entry", ["3", "{between: [1, 2]}"])
def test_a_list_that_is_too_long_is_one_problem(
    tmp_path: Path, text: str, place: str, most: int, entry: str
) -> None:
    path = tmp_path / "long.yaml"
    path.write_text(text.format("[" + ",".join([entry] * (most + 1)) + "]"))
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    reported = f"{path}:2: {place}: expected at most {most} entries, got {most + 1}"
    assert reported in str(caught.value).splitlines()
    assert sum(place in str(problem) for problem in caught.value.problems) == 1


@pytest.mark.parametrize("key", ["factors", "faults", "variants"])
def test_a_campaign_with_too_many_parts_is_refused(tmp_path: Path, key: str) -> None:
    path = tmp_path / "long.yaml"
    tree = {"name": "c", "scenario": "x", "draws": 1, key: {f"n{i}": {} for i in range(3000)}}
    path.write_text(yaml_of(tree))
    with pytest.raises(ConfigError) as caught:
        load_campaign(path)
    reported = f"{path}:4: {key}: expected at most 1000 entries, got 3000"
    assert reported in str(caught.value).splitlines()
    assert len(caught.value.problems) < 3


def test_of_very_many_problems_the_first_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(SCENARIO_1 + "".join(f"key{i}: 1\n" for i in range(2000)))
    for load in (load_scenario, load_profile):
        with pytest.raises(ConfigError) as caught:
            load(path)
        lines = str(caught.value).splitlines()
        assert len(lines) == 101
        assert lines[-1] == f"{path}: and 1900 more problems"
