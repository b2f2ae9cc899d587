from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from gcs.scenario.model import Scenario
from mavlink_defs.config.files import dump, load
from mavlink_defs.config.models import ConfigError
from sitl_plant.airframe.config import Coefficients, Inertia, Uncertainty, true_aircraft

FACTORS = st.floats(0.01, 100.0)


@given(factor=FACTORS)
def test_one_factor_is_the_same_factor_for_every_name(scenario1: Scenario, factor: float) -> None:
    """An inertia that is scaled as a whole stays positive definite."""
    nominal = scenario1.aircraft
    each = Uncertainty(
        inertia=dict.fromkeys(Inertia.model_fields, factor),
        coefficients=dict.fromkeys(Coefficients.model_fields, factor),
    )
    true = true_aircraft(nominal, Uncertainty(inertia=factor, coefficients=factor))
    assert true == true_aircraft(nominal, each)
    assert true.inertia_kg_m2.Jxz == nominal.inertia_kg_m2.Jxz * factor
    assert true.coefficients.cm_alpha == nominal.coefficients.cm_alpha * factor
    assert true.mass_kg == nominal.mass_kg


@pytest.mark.parametrize(
    "uncertainty",
    [
        Uncertainty(inertia=2, coefficients=1.2),
        Uncertainty(mass=1.1, inertia={"Jxx": 1.2}, coefficients={"cL0": 0.9}),
        Uncertainty(),
    ],
)
def test_both_forms_survive_their_files(uncertainty: Uncertainty, tmp_path: Path) -> None:
    dump(uncertainty, tmp_path / "u.yaml")
    assert load(tmp_path / "u.yaml", Uncertainty) == uncertainty


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ({"inertia": 0}, "inertia: expected > 0, got 0"),
        ({"inertia": -1.5}, "inertia: expected > 0, got -1.5"),
        ({"inertia": "10 %"}, "inertia: expected a number or a mapping, got '10 %'"),
        ({"inertia": True}, "inertia: expected a number or a mapping, got true"),
        ({"inertia": None}, "inertia: expected a number or a mapping, got nothing"),
        ({"coefficients": [1]}, "coefficients: expected a number or a mapping, got a list of 1"),
        ({"coefficients": float("nan")}, "coefficients: expected a finite number, got nan"),
        ({"coefficients": {"cL0": "x"}}, "coefficients.cL0: expected a number, got 'x'"),
        ({"inertia": {"Jxx": float("inf")}}, "inertia.Jxx: expected a finite number, got inf"),
        ({"coefficients": {"cl0_": 1}}, "coefficients.cl0_: unknown key; did you mean 'cl0'?"),
        ({"inertia": {1: 1}}, "inertia.1: expected a text, got 1"),
        ({"mass": 0}, "mass: expected > 0, got 0"),
    ],
)
def test_a_bad_uncertainty_is_refused_in_one_line(
    content: dict[str, Any], problem: str, tmp_path: Path
) -> None:
    path = tmp_path / "u.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError) as caught:
        load(path, Uncertainty)
    assert list(map(str, caught.value.problems)) == [problem]
