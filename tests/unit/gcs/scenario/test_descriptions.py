"""Every key of a configuration has a description: the reference is generated from them."""

from collections.abc import Iterator
from typing import Any, get_args

import pytest
from pydantic import BaseModel, RootModel

from ftc_autopilot.config import AutopilotConfig
from gcs.scenario.model import Scenario
from gcs.scenario.profile_file import ProfileFile
from sitl_plant.config import PlantConfig


def models_of(annotation: Any, found: set[type[BaseModel]]) -> Iterator[type[BaseModel]]:
    """Yield each model that an annotation leads to, once."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if annotation in found:
            return
        found.add(annotation)
        yield annotation
        for field in annotation.model_fields.values():
            yield from models_of(field.annotation, found)
    for argument in get_args(annotation):
        yield from models_of(argument, found)


@pytest.mark.parametrize("root", [Scenario, ProfileFile, PlantConfig, AutopilotConfig])
def test_every_key_has_a_description(root: type[BaseModel]) -> None:
    models = [m for m in models_of(root, set()) if not issubclass(m, RootModel)]
    bare = [
        f"{model.__name__}.{key}"
        for model in models
        for key, field in model.model_fields.items()
        if not (field.description or "").endswith(".")
    ]
    assert bare == []


def test_the_parts_of_a_scenario_are_found() -> None:
    names = {model.__name__.partition("[")[0] for model in models_of(Scenario, set())}
    assert {"Aircraft", "Rbf", "Pid", "TimedValue", "Edge", "Outage", "Sinusoid"} <= names
