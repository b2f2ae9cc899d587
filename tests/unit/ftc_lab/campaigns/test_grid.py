"""Grids: what their points are, and which mistakes are refused before any flight."""

from pathlib import Path

import pytest
from sweeping import swept

from ftc_lab.campaigns.again import check_same, scenario_of_row
from ftc_lab.campaigns.folder import default_folder
from ftc_lab.campaigns.grid import SweepGrid, plan_grid
from ftc_lab.campaigns.plan import row_of, rows_of
from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import summarise
from gcs.scenario.model import load_scenario, scenario_of, scenario_tree
from gcs.scenario.settings import Axis, parse_axes
from mavlink_defs.config.inherit import with_values
from mavlink_defs.config.models import ConfigError

PAPER = Path(__file__).parents[4] / "scenarios" / "paper"
SCENARIO_1 = PAPER / "scenario1.yaml"


def grid_of(files: list[Path], *settings: str) -> SweepGrid:
    return plan_grid(files, parse_axes(settings))


def test_grid_is_the_product_in_the_given_order(short: Path) -> None:
    axes = ("trigger.b2_deg=1,2", "trigger.mode=joint,per_channel")
    grid = grid_of([short, SCENARIO_1, short], *axes)
    columns = ("draw", "variant", "factor.trigger.b2_deg", "factor.trigger.mode")
    assert [tuple(row[name] for name in columns) for row in rows_of(grid.plan.draws)] == [
        (k, name, b2, mode)
        for k, (b2, mode) in enumerate(
            (b2, mode) for b2 in (1.0, 2.0) for mode in ("joint", "per_channel")
        )
        for name in ("short", "scenario1")
    ]
    for scenario, row in zip(grid.scenarios, rows_of(grid.plan.draws), strict=True):
        assert scenario is not None
        assert scenario.trigger.mode == row["factor.trigger.mode"]
        assert scenario.duration_s == (0.05 if row["variant"] == "short" else 24.0)


def test_a_point_is_its_file_with_its_values_whatever_the_other_files() -> None:
    """Nothing of another file, and no default of one trigger, is left in a point."""
    files = [PAPER / f"scenario2_{law}.yaml" for law in ("periodic", "pid", "proposed")]
    grid = grid_of(files, "trigger.mode=joint,periodic", "faults=[],null")
    for scenario, row in zip(grid.scenarios, rows_of(grid.plan.draws), strict=True):
        tree = scenario_tree(PAPER / f"{row['variant']}.yaml")
        values = grid.plan.flights.values(row)
        assert values["trigger.mode"] == row["factor.trigger.mode"]
        assert scenario == scenario_of("it", with_values(tree, values))


def test_values_may_be_anything(short: Path) -> None:
    settings = (
        "links.formation.trigger=null,{},{attitude_deg: 0.2}",
        "uncertainty={coefficients: {cn0: 1.2}}",
        "seed=1,2",
    )
    grid = grid_of([short], *settings)
    found = []
    for scenario in grid.scenarios:
        assert scenario is not None
        trigger = scenario.links.formation.trigger
        found.append((trigger and trigger.attitude_deg, scenario.seed))
    assert len(set(found)) == 6
    assert found[-1] == (0.2, 2)
    cells = row_of(grid.plan.draws, 5)
    assert cells["factor.links.formation.trigger"] == '{"attitude_deg": 0.2}'
    assert cells["factor.uncertainty"] == '{"coefficients": {"cn0": 1.2}}'
    assert cells["factor.seed"] == 2.0


def test_one_entry_of_a_default_list_may_be_swept(short: Path) -> None:
    short.write_text(short.read_text() + "controller: {kind: pid}\n")
    default = load_scenario(short).model_dump()["controller"]["rate_p"]
    grid = grid_of([short], "controller.rate_p[1]=0.1,0.2", "trigger.mode=joint,periodic")
    for scenario, first in zip(grid.scenarios, (0.1, 0.1, 0.2, 0.2), strict=True):
        assert scenario is not None
        rate_p = scenario.model_dump()["controller"]["rate_p"]
        assert rate_p == (default[0], first, default[2])


def test_every_uav_of_every_point_has_columns(short: Path) -> None:
    tree = scenario_tree(short)
    uavs = [{**uav, "id": number} for uav, number in zip(tree["uavs"], (1, 2, 9), strict=True)]
    access = "network={edges: [], leader_access: {1: 1.0, 2: 1.0, 3: null, 9: 1.0}}"
    grid = plan_grid([short], [Axis("uavs", (uavs,)), *parse_axes([access, "faults=[]"])])
    assert grid.scenarios[0] is not None
    assert "uav9.iae_roll" in grid.plan.flights.schema.names


def test_files_of_the_same_name_are_distinguished(short: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / "short.yaml"
    other.parent.mkdir()
    other.write_text(short.read_text())
    assert list(grid_of([short, other]).plan.flights.trees) == [str(short), str(other)]


def test_values_that_do_not_fit_stay_in_the_grid(short: Path, tmp_path: Path) -> None:
    good, bad, lost = swept([short], ["trigger.b2_deg=1,-1", "faults=[],null"], tmp_path / "s")[:3]
    assert (good.outcome, good.reason) == ("completed", "")
    assert lost.outcome == "invalid"
    assert bad.scenario is not None
    assert lost.scenario is None
    assert "trigger.b2_deg" in lost.reason
    assert "-1" in lost.reason


def test_a_value_that_reads_like_an_unknown_key_is_one_more_bad_value(short: Path) -> None:
    grid = plan_grid([short], [Axis("trigger.mode", ("mode: unknown key", "joint"))])
    assert [scenario is None for scenario in grid.scenarios] == [True, False]


@pytest.mark.parametrize(
    ("settings", "lines"),
    [
        (["trigger.b2_deg=x,-1"], ["--set trigger.b2_deg=x,-1: no value is valid: trigger.b2_deg"]),
        (["trigger.b2_deg=1,x", "duration_s=-1"], ["--set duration_s=-1: no value is valid"]),
        (["controller.kind=pid", "controller.c_v=5"], ["--set controller.c_v", "unknown key"]),
        (
            ["trigger.b2_deg=x", "seed=y,z"],
            ["--set trigger.b2_deg=x: no value", "--set seed=y,z: no value"],
        ),
    ],
)
def test_an_axis_without_a_valid_value_is_refused(
    short: Path, settings: list[str], lines: list[str]
) -> None:
    with pytest.raises(BadInput) as caught:
        grid_of([short], *settings)
    for line in lines:
        assert line in str(caught.value)
    assert "1,x" not in str(caught.value)  # one value of that axis is valid


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("trigger.b2_deq=1,2", "did you mean 'b2_deg'"),
        ("triger.b2_deg=1", "did you mean 'trigger'"),
        ("faults[7].uav=1,2", "faults"),
        ("a b=1", "a b"),
    ],
)
def test_a_key_that_is_wrong_everywhere_is_refused(short: Path, text: str, reason: str) -> None:
    with pytest.raises(BadInput, match="--set") as caught:
        grid_of([short, SCENARIO_1], text, "trigger.b1=0.1,-1")
    assert reason in str(caught.value)


def test_a_key_that_fits_some_points_is_not_refused(short: Path) -> None:
    grid = grid_of([short], "controller.kind=proposed,pid", "controller.c_v=5")
    assert [scenario is None for scenario in grid.scenarios] == [False, True]


def test_a_file_that_no_value_mends_is_refused(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text(f"extends: {SCENARIO_1}\nduration_s: -1\n")
    for files in ([bad], [SCENARIO_1, bad]):
        with pytest.raises(ConfigError, match=r"bad\.yaml:2: duration_s"):
            grid_of(files, "trigger.b2_deg=1")
    mended = grid_of([bad], "duration_s=1,-2")
    assert [scenario is None for scenario in mended.scenarios] == [False, True]
    assert mended.plan.example is mended.scenarios[0]


def test_a_campaign_is_no_scenario() -> None:
    with pytest.raises(ConfigError, match=r"faults\.yaml: a campaign, not a scenario"):
        grid_of([SCENARIO_1, SCENARIO_1.parents[1] / "campaigns" / "faults.yaml"])


def test_a_point_flies_again_to_the_last_bit(short: Path, tmp_path: Path) -> None:
    """Also one of a file whose own values are not valid."""
    bad = tmp_path / "bad.yaml"
    bad.write_text(f"extends: {SCENARIO_1}\nduration_s: -1\n")
    swept([short, bad], ["duration_s=0.02,0.03", "trigger.b2_deg=1,2"], tmp_path / "s")
    for row in (1, 6):
        scenario = scenario_of_row(tmp_path / "s", row)
        assert scenario.duration_s == (0.02 if row == 1 else 0.03)
        check_same(tmp_path / "s", row, summarise(fly_in_process(scenario), scenario))


def test_folder_is_named_by_the_request(short: Path, tmp_path: Path) -> None:
    def folder(*settings: str) -> Path:
        return default_folder(grid_of([short], *settings).plan.mark, "sweep")

    same = [folder(text) for text in ("duration_s=1,2", "duration_s=1, 2")]
    others = [folder(text) for text in ("duration_s=1,3", "trigger.b2_deg=1,2")]
    short.write_text(short.read_text() + "seed: 5\n")
    others.append(folder("duration_s=1,2"))
    assert same[0] == same[1]
    assert len({*same, *others}) == 4
    assert same[0].parent == Path("runs")
    assert same[0].name.startswith("sweep-short-")
