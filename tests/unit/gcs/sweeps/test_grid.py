"""Grids and the identities of their runs."""

import copy
from pathlib import Path
from typing import Any

import pytest

from gcs.errors import BadInput
from gcs.scenario.model import scenario_of, scenario_tree
from gcs.sweeps import grid
from gcs.sweeps.axes import Axis, parse_axes
from gcs.sweeps.folder import result_of
from gcs.sweeps.grid import identity, plan
from mavlink_defs.config.models import ConfigError

SCENARIO_1 = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"


def test_grid_is_the_product_in_the_given_order(short: Path) -> None:
    axes = parse_axes(["trigger.b2_deg=1,2", "trigger.mode=joint,per_channel"])
    runs = plan([short, SCENARIO_1, short], axes)
    assert [(run.name, *run.values.values()) for run in runs] == [
        (name, b2, mode)
        for name in ("short", "scenario1")
        for b2 in (1, 2)
        for mode in ("joint", "per_channel")
    ]
    assert len({run.digest for run in runs}) == 8
    scenario = runs[3].scenario
    assert scenario is not None
    assert scenario.trigger.mode == "per_channel"


def test_files_of_the_same_name_are_told_apart(short: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / "short.yaml"
    other.parent.mkdir()
    other.write_text(short.read_text())
    assert [run.name for run in plan([short, other], [])] == [str(short), str(other)]


def test_values_that_do_not_fit_stay_in_the_grid(short: Path) -> None:
    good, bad = plan([short], parse_axes(["trigger.b2_deg=1,-1"]))
    assert (good.problems, good.scenario is None) == ((), False)
    assert bad.scenario is None
    result = result_of(bad, {})
    assert (result.outcome, result.summary) == ("invalid", None)
    assert "trigger.b2_deg" in result.reason
    assert "-1" in result.reason


def test_a_value_that_reads_like_an_unknown_key_is_one_more_bad_value(short: Path) -> None:
    (run,) = plan([short], [Axis("trigger.mode", ("mode: unknown key",))])
    assert run.scenario is None
    assert [problem.loc for problem in run.problems] == [("trigger", "mode")]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("trigger.b2_deq=1,2", "did you mean 'b2_deg'"),
        ("triger.b2_deg=1", "did you mean 'trigger'"),
        ("faults[7].uav=1,2", "faults"),
        ("a b=1", "a b"),
    ],
)
def test_a_key_that_is_wrong_everywhere_is_refused(short: Path, text: str, words: str) -> None:
    with pytest.raises(BadInput, match="--set") as caught:
        plan([short, SCENARIO_1], parse_axes([text, "trigger.b1=0.1,-1"]))
    assert words in str(caught.value)


def test_a_key_that_fits_some_runs_is_not_refused(short: Path) -> None:
    axes = parse_axes(["controller.kind=proposed,pid", "controller.c_v=5"])
    assert [run.scenario is None for run in plan([short], axes)] == [False, True]


def test_a_file_that_no_value_mends_is_refused(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text(f"extends: {SCENARIO_1}\nduration_s: -1\n")
    with pytest.raises(ConfigError, match="duration_s"):
        plan([bad], parse_axes(["trigger.b2_deg=1"]))
    (mended,) = plan([bad], parse_axes(["duration_s=1"]))
    assert mended.scenario is not None


def leaves(tree: Any, *way: Any) -> Any:
    if isinstance(tree, dict | list):
        items = tree.items() if isinstance(tree, dict) else enumerate(tree)
        for key, value in items:
            yield from leaves(value, *way, key)
    else:
        yield way, tree


def test_identity_changes_with_every_value() -> None:
    tree = scenario_tree(SCENARIO_1)
    known = {identity(scenario_of(SCENARIO_1, tree))}
    changed = 0
    for way, value in leaves(tree):
        other = copy.deepcopy(tree)
        here = other
        for key in way[:-1]:
            here = here[key]
        here[way[-1]] = f"{value} too" if isinstance(value, str) else value + type(value)(1.01)
        try:
            known.add(identity(scenario_of(SCENARIO_1, other)))
        except ConfigError:
            continue
        changed += 1
    assert changed > 50
    assert len(known) == changed + 1


def test_identity_knows_defaults_and_code(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    explicit, implicit = plan([short], parse_axes(["trigger.b1=0.01,null"]))  # 0.01 by default
    assert explicit.digest == implicit.digest
    monkeypatch.setattr(grid, "code_digest", lambda: "other code")
    (other,) = plan([short], parse_axes(["trigger.b1=0.01"]))
    assert other.digest != explicit.digest
