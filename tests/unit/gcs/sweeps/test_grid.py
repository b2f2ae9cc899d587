"""Grids, identities, and what is flown again."""

import copy
import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.reference import wrap
from gcs.errors import BadInput
from gcs.figures.sweep import draw_sweep
from gcs.fleet.in_process import fly_in_process
from gcs.reports.sweep import choose_uav, terminal_table, write_csv, write_markdown
from gcs.results.recording import _wrap_all as wrap_all
from gcs.results.summary import summarise
from gcs.scenario.model import load_scenario, scenario_of, scenario_tree
from gcs.sweeps import grid
from gcs.sweeps.grid import (
    Axis,
    Result,
    Run,
    default_folder,
    fly_runs,
    identity,
    known_results,
    open_folder,
    parse_axes,
    plan,
    result_of,
)
from mavlink_defs.config.models import ConfigError

SCENARIO_1 = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"

plain = st.recursive(
    st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc", min_size=1), inner),
    max_leaves=5,
)


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Scenario 1, for 50 ms."""
    path = tmp_path / "short.yaml"
    path.write_text(f"extends: {SCENARIO_1}\nduration_s: 0.05\n")
    return path


def flown(runs: list[Run], folder: Path, jobs: int = 2) -> list[Result]:
    """Fly what is missing; give only the results of those flights."""
    known = known_results(runs, folder)
    results: list[Result] = []
    fly_runs([run for run in runs if run.digest not in known], folder, jobs, results.append)
    return results


def test_values_are_yaml() -> None:
    text = "k=1, 0.5,1e-3,joint,[40, 40.0, 40],{until_s: 14, value: 1},'a,b',null,true"
    mapping = {"until_s": 14, "value": 1}
    values = (1, 0.5, 1e-3, "joint", [40, 40.0, 40], mapping, "a,b", None, True)
    assert parse_axes([text]) == [Axis("k", values)]
    assert [type(value) for value in parse_axes([text])[0].values] == [type(v) for v in values]


@given(st.lists(plain, min_size=1, unique_by=grid.label))
def test_any_plain_values_come_back(values: list[Any]) -> None:
    text = ", ".join(json.dumps(value).replace("Infinity", ".inf") for value in values)
    (axis,) = parse_axes([f"some.key = {text}"])
    assert axis == Axis("some.key", tuple(values))


@given(st.text())
def test_any_text_is_an_axis_or_one_clear_message(text: str) -> None:
    axes, words = [], ""
    try:
        axes = parse_axes([text])
    except BadInput as problem:
        words = f"{problem} {problem.hint}"
    assert bool(axes) != ("--set" in words and len(words.splitlines()) == 1)


@pytest.mark.parametrize(
    "text",
    ["k", "k=", "=1", "k=1,,2", "k=[1", "k=1], [2", "k=&a [*a]", "k=!!binary x", "k=1 # one", ""],
)
def test_what_is_no_axis(text: str) -> None:
    with pytest.raises(BadInput, match="expected KEY=VALUE"):
        parse_axes([text])


def test_nothing_is_given_twice() -> None:
    with pytest.raises(BadInput, match="k is given twice"):
        parse_axes(["k=1", "k=2"])
    with pytest.raises(BadInput, match="got '1' again"):
        parse_axes(["k=1,2,1"])


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
    monkeypatch.setattr(grid, "_code_digest", lambda: "other code")
    (other,) = plan([short], parse_axes(["trigger.b1=0.01"]))
    assert other.digest != explicit.digest


def test_folder_is_named_by_the_request(short: Path) -> None:
    axes = [parse_axes([text]) for text in ("k=1,2", "k=1, 2", "k=1,3", "l=1,2")]
    names = [default_folder([short], one) for one in axes]
    assert names[0] == names[1]
    assert len({*names, default_folder([short, short], axes[0])}) == 4
    assert names[0].parent == Path("runs")
    assert names[0].name.startswith("sweep-short-")


def test_folder_of_something_else_is_left_alone(tmp_path: Path, short: Path) -> None:
    (tmp_path / "precious").mkdir()
    with pytest.raises(BadInput, match="not a sweep"):
        open_folder(tmp_path, [short], [])
    assert not (tmp_path / "runs").exists()
    assert not (tmp_path / "sweep.json").exists()


def test_finished_runs_are_not_flown_again(short: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    axes = parse_axes(["trigger.b2_deg=0.5,1,2,4"])
    runs = plan([short], axes)
    open_folder(folder, [short], axes)
    first = flown(runs, folder)
    assert len(first) == 4
    files = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
    assert len(files) == 4

    damaged, lost = sorted(files)[:2]
    damaged.write_text(damaged.read_text()[:100])
    lost.unlink()
    open_folder(folder, [short], axes)
    again = flown(runs, folder)
    assert {result.run.digest for result in again} == {damaged.stem, lost.stem}
    for path in sorted(files)[2:]:
        assert path.stat().st_mtime_ns == files[path]

    more = plan([short], parse_axes(["trigger.b2_deg=1,8"]))
    assert [result.run.values for result in flown(more, folder)] == [{"trigger.b2_deg": 8}]


def test_results_do_not_depend_on_the_number_of_jobs(short: Path, tmp_path: Path) -> None:
    axes = parse_axes(["trigger.b2_deg=0.5,1,2,4"])
    seen = []
    for jobs in (1, 3):
        open_folder(tmp_path / str(jobs), [short], axes)
        runs = plan([short], axes)
        results = flown(runs, tmp_path / str(jobs), jobs)
        by_digest = {r.run.digest: r.summary.uavs for r in results if r.summary is not None}
        seen.append([by_digest[run.digest] for run in runs])
    assert seen[0] == seen[1]


def test_a_flight_that_cannot_be_computed_is_recorded_and_tried_again(
    short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any) -> None:
        raise ZeroDivisionError("by nothing")

    open_folder(tmp_path / "out", [short], [])
    runs = plan([short], [])
    with monkeypatch.context() as patch:
        patch.setattr(grid, "fly_in_process", broken)
        (failed,) = flown(runs, tmp_path / "out")
    assert (failed.outcome, failed.reason) == ("failed", "ZeroDivisionError: by nothing")
    (result,) = flown(runs, tmp_path / "out")
    assert result.outcome == "completed"


def test_leaving_early_stops_the_flights_in_the_air(short: Path, tmp_path: Path) -> None:
    def leave(_: Result) -> None:
        raise KeyboardInterrupt

    runs = plan([short], parse_axes(["duration_s=0.05,60,61,62,63"]))
    open_folder(tmp_path / "out", [short], [])
    with pytest.raises(KeyboardInterrupt):
        fly_runs(runs, tmp_path / "out", 2, leave)
    assert list(known_results(runs, tmp_path / "out")) == [runs[0].digest]


def test_the_uav_with_a_fault_is_shown_or_else_the_last(short: Path) -> None:
    axes = parse_axes(["faults=[{uav: 1, actuator: rudder, bias_deg: 1, start_s: 0}],[]"])
    faulted, healthy = plan([short], axes)
    assert choose_uav([healthy, faulted], None) == 1
    assert choose_uav([healthy], None) == 3
    assert choose_uav([healthy], 2) == 2
    with pytest.raises(BadInput, match="expected one of 1, 2, 3"):
        choose_uav([healthy], 9)


def test_report_has_every_run(short: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    stuck = "[{uav: 2, actuator: throttle, stuck_n: 2000, start_s: 0}]"
    axes = parse_axes(["trigger.b2_deg=0.5,1,-1", f"faults=[],{stuck}", "duration_s=0.05"])
    open_folder(folder, [short], axes)
    runs = plan([short], axes)
    by_digest = {result.run.digest: result for result in flown(runs[:4], folder)}
    results = [result_of(run, by_digest) for run in runs]
    write_csv(results, folder / "table.csv")
    with (folder / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * 3 + 2
    assert [row["outcome"] for row in rows[-2:]] == ["invalid"] * 2
    uavs = [uav for result in results[:4] if result.summary for uav in result.summary.uavs]
    for row, uav in zip(rows[:-2], uavs, strict=True):
        assert float(row["iae_yaw_deg_s"]) == uav.iae["yaw"]
        assert (row["uav"], row["scenario"]) == (str(uav.id), str(short))
        assert int(row["events_rudder"]) == uav.channels["rudder"].events
    write_markdown(results, 3, folder / "table.md")
    assert (folder / "table.md").read_text().count("\n| ") == 1 + 1 + 6
    assert terminal_table(results, 3).row_count == 6
    draw_sweep(results, 3, folder)
    assert (folder / "sweep.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "sweep.svg").read_text().startswith("<?xml")


def test_whole_rolls_are_no_error(short: Path) -> None:
    scenario = load_scenario(short)
    recording = fly_in_process(scenario)
    before = summarise(recording, scenario).uavs[0].iae
    recording.states[:, 0, 6] += 4.0 * np.pi
    assert summarise(recording, scenario).uavs[0].iae == pytest.approx(before)


def test_angles_are_wrapped_one_by_one() -> None:
    angles = np.random.default_rng(1).normal(0.0, 9.0, 1000)
    angles[:6] = np.pi, -np.pi, -0.0, np.nan, np.inf, 3.0 * np.pi
    one_by_one = np.array([wrap(angle) for angle in angles])
    wrap_all(angles[:, None])
    assert angles.tobytes() == one_by_one.tobytes()
    assert np.abs(angles[5:]).max() <= np.pi
