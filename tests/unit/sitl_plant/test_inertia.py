"""An inertia is that of a rigid body, unless its file says that it need not be."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario
from mavlink_defs.config.files import dump, load
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.yaml_text import parse_yaml, yaml_of
from sitl_plant.airframe.config import Inertia, Uncertainty, true_aircraft
from sitl_plant.config import PlantConfig

ROOT = Path(__file__).parents[3]
BUNDLED = sorted((ROOT / "aircraft").glob("*.yaml"))

coordinate = st.floats(-5.0, 5.0).map(lambda value: round(value, 3))
point = st.tuples(st.floats(0.1, 10.0), coordinate, coordinate, coordinate)


def inertia_of(points: list[tuple[float, float, float, float]]) -> Inertia:
    """The inertia of point masses, each with its mirror image beyond the plane x-z."""
    J = np.zeros((3, 3))
    for mass, x, y, z in points:
        for side in (1.0, -1.0):
            r = np.array([x, side * y, z])
            J += mass * (r @ r * np.eye(3) - np.outer(r, r))
    return Inertia(Jxx=J[0, 0], Jyy=J[1, 1], Jzz=J[2, 2], Jxz=-J[0, 2])


def with_inertia(tmp_path: Path, **change: Any) -> Path:
    tree = parse_yaml((ROOT / "aircraft" / "aerosonde.yaml").read_text())
    any_inertia = change.pop("any_inertia", None)
    tree["inertia_kg_m2"].update(change)
    if any_inertia is not None:
        tree["any_inertia"] = any_inertia
    path = tmp_path / "mine.yaml"
    path.write_text(yaml_of(tree))
    return path


@given(st.lists(point, min_size=1, max_size=6), st.floats(0.01, 1.0))
def test_whatever_is_made_of_masses_is_accepted(
    points: list[tuple[float, float, float, float]], size: float
) -> None:
    # a small cross keeps a body of one line from being none
    cross = [(1.0, size, 0.0, 0.0), (1.0, 0.0, size, 0.0), (1.0, 0.0, 0.0, size)]
    inertia = inertia_of([*points, *cross])
    assert inertia.of_rigid_body
    J = np.diag([inertia.Jxx, inertia.Jyy, inertia.Jzz])
    J[0, 2] = J[2, 0] = -inertia.Jxz
    assert inertia.principal == pytest.approx(np.linalg.eigvalsh(J), rel=1e-6, abs=1e-9)


@given(st.floats(0.01, 1e4), st.floats(0.01, 1e4), st.floats(-1.5, 1.5), st.floats(1.01, 10.0))
def test_more_than_a_flat_body_has_is_refused(a: float, b: float, turn: float, by: float) -> None:
    c, s = math.cos(turn), math.sin(turn)
    largest = by * (a + b)
    turned = {
        "Jxx": a * c**2 + largest * s**2,
        "Jyy": b,
        "Jzz": a * s**2 + largest * c**2,
        "Jxz": (largest - a) * s * c,
    }
    assert not Inertia(**turned).of_rigid_body
    assert Inertia(Jxx=a, Jyy=b, Jzz=float(f"{a + b:.4g}"), Jxz=0.0).of_rigid_body  # flat, rounded


def test_the_message_names_key_values_and_a_way_out(tmp_path: Path) -> None:
    path = with_inertia(tmp_path, Jyy=0.1135)
    text = (
        "inertia_kg_m2: no rigid body has it: expected the largest principal moment to be at most "
        "the sum of the others, 0.9226 kg m^2, got 1.774 kg m^2; check numbers and unit, or add "
        "'any_inertia: true' to the aircraft to fly it as it is"
    )
    with pytest.raises(ConfigError, match=re.escape(text)) as refused:
        load_aircraft(str(path))
    assert len(refused.value.problems) == 1
    assert load_aircraft(str(with_inertia(tmp_path, Jyy=0.1135, any_inertia=True))).any_inertia


def test_an_inertia_that_is_not_positive_definite_is_never_flown(tmp_path: Path) -> None:
    path = with_inertia(tmp_path, Jxz=1.3, any_inertia=True)
    with pytest.raises(ConfigError, match="not positive definite"):
        load_aircraft(str(path))


@pytest.mark.parametrize("path", BUNDLED, ids=lambda path: path.stem)
def test_bundled_aircraft_load_and_say_if_they_are_no_rigid_bodies(path: Path) -> None:
    aircraft = load_aircraft(str(path))
    assert aircraft.any_inertia != aircraft.inertia_kg_m2.of_rigid_body


def test_uncertain_moments_may_be_those_of_no_body(scenario1: Scenario, tmp_path: Path) -> None:
    true = true_aircraft(scenario1.aircraft, Uncertainty(inertia={"Jzz": 3.0}))
    assert not true.inertia_kg_m2.of_rigid_body
    uncertain = {**scenario1.model_dump(), "uncertainty": {"inertia": {"Jzz": 3.0}}}
    config = Scenario.model_validate(uncertain).plant_config()
    dump(config, tmp_path / "plant.yaml")  # what the process of the plant reads
    assert load(tmp_path / "plant.yaml", PlantConfig) == config
