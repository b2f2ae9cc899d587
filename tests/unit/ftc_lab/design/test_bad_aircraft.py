"""Aircraft and options that cannot be right: one message, before any flight, and no file."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gcs.commands.cli import app
from gcs.console.errors import BadInput
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.yaml_text import parse_yaml, yaml_of
from sitl_plant.airframe.config import Aircraft

AEROSONDE = Path(__file__).parents[4] / "aircraft" / "aerosonde.yaml"
Tree = dict[str, Any]


def of(section: str, **values: Any) -> Callable[[Tree], None]:
    """Return a change of a section of an aircraft's file."""
    return lambda tree: tree[section].update(values)


def without_aileron(tree: Tree) -> None:
    stop = tree.pop("surface_limit_deg")
    tree["surface_limits_deg"] = {"aileron": "none", "elevator": stop, "rudder": stop}


def run(*command: str) -> None:
    result = CliRunner().invoke(app, [*command, "-o", "out.yaml"])
    if result.exception is not None:
        raise result.exception


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], None]:
    monkeypatch.chdir(tmp_path)

    def written(change: Callable[[Tree], None]) -> None:
        tree = parse_yaml(AEROSONDE.read_text())
        change(tree)
        Path("mine.yaml").write_text(yaml_of(tree))

    return written


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda tree: tree.update(wing_area_m2=5.5), "wing area by span times chord: 10"),
        (lambda tree: tree.update(wing_area_m2=5.5), "; and largest thrust by what level flight"),
        (of("inertia_kg_m2", Jxz=5.0), r"not positive definite: expected \|Jxz\| <"),
        (of("coefficients", cm0=0.8), "elevator in level flight: 1.* of its stop"),
        (of("coefficients", cL_alpha=0.0, cL0=0.0), "no straight, level flight at 28 m/s"),
        (lambda tree: tree["coefficients"].pop("cm_de"), "coefficients.cm_de: missing; expected"),
        (of("coefficients", cm_de=math.nan), "coefficients.cm_de: expected a finite number"),
        (lambda tree: tree.update(mass_kg=math.inf), "mass_kg: expected a finite number in kg"),
        (of("coefficients", cl_da=0.0), "moment by aileron: 0: it does nothing"),
        (without_aileron, "moment by aileron: 0: it does nothing"),
        (of("coefficients", cm_de=0.0), "moment by elevator: 0: it does nothing"),
        (of("coefficients", cn_dr=0.0), "the rudder does nothing: check cn_dr"),
        (
            lambda tree: tree.update(thrust_limit_n=8.0),
            "its thrust at this airspeed does not hold level flight",
        ),
    ],
)
def test_design_refuses(
    change: Callable[[Tree], None], text: str, write: Callable[[Any], None]
) -> None:
    write(change)
    with pytest.raises((BadInput, ConfigError), match=text):
        run("design", "mine.yaml", "--airspeed", "28")
    assert not Path("out.yaml").exists()


def test_one_cause_is_one_problem(write: Callable[[Any], None]) -> None:
    write(without_aileron)
    with pytest.raises(BadInput) as refused:
        run("design", "mine.yaml", "--airspeed", "28")
    assert "relative gain" not in str(refused.value)


def test_unstable_sideslip_is_a_warning_or_refused_by_the_law(write: Callable[[Any], None]) -> None:
    write(of("coefficients", cY_beta=-0.01, cY_dr=0.3))
    run("design", "mine.yaml", "--airspeed", "28", "--law", "surviving")
    assert "sideslip would grow until the rudder is at its stop" in Path("out.yaml").read_text()
    Path("out.yaml").unlink()
    with pytest.raises(BadInput, match="sideslip would grow until the rudder is at its stop"):
        run("design", "mine.yaml", "--airspeed", "28", "--law", "pid")
    assert not Path("out.yaml").exists()


@pytest.mark.parametrize(
    ("change", "cruise", "text"),
    [
        (of("coefficients", cm0=0.8), "28", "the elevator would have to pass the stop"),
        (lambda tree: tree.update(stall_deg=3.0), "28", "the lift does not carry it (left over"),
        (lambda _: None, "0.2", "an angle of attack of 30 deg would not carry it"),
    ],
)
def test_identify_refuses(
    change: Callable[[Tree], None], cruise: str, text: str, write: Callable[[Any], None]
) -> None:
    write(change)
    with pytest.raises(BadInput) as refused:
        run("identify", "own:mine.yaml", "--cruise", cruise)
    assert text in str(refused.value)
    assert not Path("out.yaml").exists()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--cruise", "nan"), "--cruise: expected a finite number of at least 0.1"),
        (("--cruise", "1e9"), "Input should be less than or equal to 300"),
        (("--airspeed-min", "30"), "--airspeed-min is 30, expected at most --cruise, 28 m/s"),
        (("--airspeed-max", "20"), "--airspeed-max is 20, expected at least --cruise, 28 m/s"),
        (("-o", "mine.yaml/out.yaml"), "--out is mine.yaml/out.yaml, but mine.yaml is a file"),
        (("-o", "."), "--out is ., a folder, expected a file"),
    ],
)
def test_options_are_refused_before_the_experiment(
    options: tuple[str, ...], text: str, write: Callable[[Any], None]
) -> None:
    write(lambda _: None)
    command = ["identify", "own:mine.yaml", "--cruise", "28", "-q", *options]
    result = CliRunner().invoke(app, command)
    assert result.exit_code != 0
    assert text in f"{result.output}{result.exception}"


def test_an_aircraft_without_a_rudder_is_identified(write: Callable[[Any], None]) -> None:
    write(lambda _: None)
    run("identify", "own:skywalker_x8", "--cruise", "18", "-q")
    found = Aircraft.model_validate(parse_yaml(Path("out.yaml").read_text()))
    assert not found.has("rudder")
    assert found.coefficients.cl_da == pytest.approx(-0.1202, rel=0.01)
