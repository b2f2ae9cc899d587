"""A list of runs says what is known of each, and no more."""

import contextlib
import fcntl
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from campaign_flights import planned
from pyarrow import ipc
from run_folders import make_run
from sweeping import swept
from typer.testing import CliRunner

from ftc_lab.campaigns.flights import fly_rows
from ftc_lab.campaigns.folder import open_folder
from ftc_lab.campaigns.mark import MARK
from ftc_lab.campaigns.plan import rows_of
from ftc_lab.campaigns.store import alone_in, append_results, read_results
from gcs.commands.cli import app
from gcs.console.errors import BadInput, FlightLost, Interrupted
from gcs.results.flight_mark import FLIGHT, FlightMark, is_under_way, marked, read_mark
from gcs.results.run_folder import read_summary, save_summary
from gcs.results.runs.index import list_runs
from gcs.results.runs.run import Run
from gcs.results.store import EVENTS, TRAJECTORY, EventStream, read_table
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.config.yaml_text import yaml_of
from mavlink_defs.constants import ACTUATORS

EVENT = ("time_s", "step", "uav", "channel", "value")


def only(root: Path) -> Run:
    listing = list_runs(root)
    assert listing.foreign == []
    (run,) = listing.runs
    return run


def test_a_flight_says_what_was_asked_for_and_what_came(cache: Path, tmp_path: Path) -> None:
    folder = make_run(cache, tmp_path / "runs" / "a")
    run, summary = only(tmp_path / "runs"), read_summary(folder)
    assert (run.kind, run.outcome, run.reason) == ("flight", "completed", "")
    assert (run.scenario, run.changes) == ("paper/scenario1", ("duration_s=0.05",))
    assert (run.law, run.trigger, run.uavs) == ("proposed", "per_channel", 3)
    assert run.faults == ("UAV 3: rudder at 90 % in (19, 22] s",)
    assert run.messages == sum(uav.actuator_messages for uav in summary.uavs) > 0
    assert run.events == sum(uav.events for uav in summary.uavs) >= run.messages
    assert run.saving == summary.saving
    assert run.iae["yaw"] == max(uav.iae["yaw"] or 0.0 for uav in summary.uavs)
    assert (run.flights, run.planned, run.completed) == (1, 1, 1)
    mark = read_mark(folder)
    assert mark is not None
    assert (run.version, run.digest, run.time) == (mark.version, mark.digest, mark.started)


def test_the_scenario_beside_a_flight_flies_it_again(
    cache: Path, tmp_path: Path, scenario1: Scenario
) -> None:
    folder = make_run(cache, tmp_path / "a")
    flown = scenario1.model_copy(update={"duration_s": 0.05, "name": "short"})
    assert load_scenario(folder / "scenario.yaml") == flown


def unfinished(cache: Path, folder: Path, ended: str) -> Path:
    """A flight that never came to its summary."""
    make_run(cache, folder)
    (folder / "summary.json").unlink()
    mark = read_mark(folder)
    assert mark is not None
    (folder / FLIGHT).write_text(yaml_of({"schema": 1, **vars(mark), "ended": ended}))
    return folder


@pytest.mark.parametrize(
    ("ended", "outcome", "reason"),
    [
        ("interrupted", "interrupted", "signal"),
        ("", "killed", "without a word"),
        ("UAV 2 did not answer", "lost", "UAV 2 did not answer"),
    ],
)
def test_a_flight_without_a_summary_says_how_it_ended(
    cache: Path, tmp_path: Path, ended: str, outcome: str, reason: str
) -> None:
    unfinished(cache, tmp_path / "a", ended)
    run = only(tmp_path)
    assert run.outcome == outcome
    assert reason in run.reason
    assert run.completed == 0
    assert run.iae == {}  # it has no summary, which sums them


def sent_until(folder: Path, last: int) -> list[tuple[int, int]]:
    """Step and UAV of every event up to a step."""
    rows = read_table(folder / EVENTS).to_pylist()
    return [(row["step"], row["uav"]) for row in rows if row["step"] <= last]


def test_a_flight_without_a_summary_has_the_figures_of_its_recording(
    cache: Path, tmp_path: Path
) -> None:
    folder = unfinished(cache, tmp_path / "a", "")
    run, sent = only(tmp_path), sent_until(folder, 40)  # a light recording has every 20th step
    assert run.duration_s == 0.04
    assert run.events == len(sent) > 0
    assert run.messages == len(set(sent)) < len(sent)
    assert run.saving == pytest.approx(1.0 - len(sent) / (41 * 3 * 4), abs=1e-12)


def test_a_torn_recording_counts_as_far_as_both_files_go(cache: Path, tmp_path: Path) -> None:
    folder = unfinished(cache, tmp_path / "a", "")
    rows = [row for row in read_table(folder / EVENTS).to_pylist() if row["step"] <= 25]
    last = max(row["step"] for row in rows)
    assert last < 40
    events = EventStream(folder / EVENTS, 1000)
    channels = [ACTUATORS.index(row["actuator"]) for row in rows]
    columns = {name: np.array([row[name] for row in rows]) for name in EVENT if name != "channel"}
    events.add({**columns, "channel": np.array(channels)})
    events.close()
    whole = (folder / EVENTS).read_bytes()
    assert only(tmp_path).saving == pytest.approx(1.0 - len(rows) / (41 * 3 * 4), abs=1e-12)
    (folder / EVENTS).write_bytes(whole[:-8])  # it was not closed: more may have been sent
    run = only(tmp_path)
    assert run.saving == pytest.approx(1.0 - len(rows) / ((last + 1) * 3 * 4), abs=1e-12)
    assert run.events == len(rows)


def test_steps_without_a_state_and_channels_that_are_not_there_count_for_nothing(
    cache: Path, tmp_path: Path, scenario1: Scenario
) -> None:
    folder = unfinished(cache, tmp_path / "a", "")
    table = read_table(folder / TRAJECTORY)
    limits = json.loads(table.schema.metadata[b"limits"])
    limits["1"]["surfaces_deg"][2] = [0.0, 0.0]  # UAV 1 has no rudder
    speeds = [float("nan")] * 3 + table["V"].to_pylist()[3:]  # no state reaches any in step 0
    changed = table.set_column(table.schema.get_field_index("V"), "V", [speeds])
    metadata = {**table.schema.metadata, b"limits": json.dumps(limits).encode()}
    with ipc.new_stream(folder / TRAJECTORY, changed.schema.with_metadata(metadata)) as writer:
        writer.write_table(changed.replace_schema_metadata(metadata))
    sent = sent_until(folder, 40)
    expected = 1.0 - len(sent) / round(41 * (2 / 3) * (3 + 4 + 4))
    assert only(tmp_path).saving == pytest.approx(expected, abs=1e-12)


def test_a_flight_that_is_under_way_is_so_until_its_lock_goes(cache: Path, tmp_path: Path) -> None:
    folder = unfinished(cache, tmp_path / "a", "")
    with (folder / FLIGHT).open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert only(tmp_path).outcome == "under_way"
        assert only(tmp_path).flights == 0
        shown = CliRunner().invoke(app, ["runs", str(tmp_path)]).stdout
        assert "flight of" not in shown  # it is one, though none has ended
    assert only(tmp_path).outcome == "killed"


@pytest.mark.parametrize(
    ("problem", "ended"),
    [
        (None, "done"),
        (KeyboardInterrupt(), "interrupted"),
        (Interrupted("x"), "interrupted"),
        (FlightLost("UAV 1 was lost"), "UAV 1 was lost"),
        (ZeroDivisionError(), "a defect: ZeroDivisionError"),
    ],
)
def test_a_mark_is_locked_while_it_is_flown_and_says_how_it_ended(
    tmp_path: Path, scenario1: Scenario, problem: BaseException | None, ended: str
) -> None:
    mark = FlightMark.of("fly", "x", scenario1, ["realistic"], {"trigger.b2_deg": 0.5})
    assert mark.changes == ["with realistic", "trigger.b2_deg=0.5"]
    expected = contextlib.nullcontext() if problem is None else pytest.raises(type(problem))
    with expected, marked(tmp_path, scenario1, mark):
        assert is_under_way(tmp_path)
        if problem is not None:
            raise problem
    assert not is_under_way(tmp_path)
    found = read_mark(tmp_path)
    assert found is not None
    assert found.ended == ended
    assert (list(found.additions), found.settings) == (["realistic"], {"trigger.b2_deg": 0.5})


def test_a_folder_that_is_gone_stays_gone(tmp_path: Path, scenario1: Scenario) -> None:
    folder = tmp_path / "a"
    folder.mkdir()
    with marked(folder, scenario1, FlightMark.of("ardupilot", "x", scenario1)):
        shutil.rmtree(folder)
    assert not folder.exists()


def test_a_flight_of_an_earlier_version_has_what_it_has(cache: Path, tmp_path: Path) -> None:
    folder = make_run(cache, tmp_path / "a")
    for name in (FLIGHT, "scenario.yaml"):
        (folder / name).unlink()
    run = only(tmp_path)
    assert (run.outcome, run.scenario, run.law, run.version) == ("completed", "short", "", "")
    (folder / "summary.json").unlink()
    assert only(tmp_path).outcome == "interrupted"


def test_a_lost_flight_and_one_that_lost_its_heading_say_so(cache: Path, tmp_path: Path) -> None:
    make_run(cache, tmp_path / "lost", loss="stopped at 0.02 s of 0.05 s", completed=False)
    folder = make_run(cache, tmp_path / "heading")
    tree = json.loads((folder / "summary.json").read_text())
    tree["uavs"][1]["heading_lost_at_s"] = 0.01
    (folder / "summary.json").write_text(json.dumps(tree))
    runs = {run.name: run for run in list_runs(tmp_path).runs}
    assert (runs["lost"].outcome, runs["lost"].reason) == ("lost", "stopped at 0.02 s of 0.05 s")
    assert runs["heading"].outcome == "heading_lost"
    assert "UAV 2" in runs["heading"].reason


def test_flights_of_others_are_told_apart(cache: Path, tmp_path: Path) -> None:
    folder = make_run(cache, tmp_path / "a")
    tree = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps({**tree, "ardupilot": []}))
    (folder / FLIGHT).unlink()
    assert only(tmp_path).kind == "ardupilot"


def test_the_mark_of_a_foreign_autopilot_has_no_law_of_ours(scenario1: Scenario) -> None:
    both = with_changes(scenario1, [], {"uavs[2].autopilot.kind": "ardupilot"}, "--set")
    alone = with_changes(scenario1, [], {"autopilot.kind": "ardupilot"}, "--set")
    marks = [FlightMark.of("fly", "x", flown) for flown in (scenario1, both, alone)]
    assert [mark.law for mark in marks] == ["proposed", "proposed, ardupilot", "ardupilot"]
    assert [mark.trigger for mark in marks] == ["per_channel", "per_channel", ""]


def test_a_sweep_is_a_run_with_medians(short: Path, tmp_path: Path) -> None:
    root = tmp_path / "runs"
    swept([short], ["trigger.b2_deg=0.5,1", "duration_s=0.02"], root / "sweep")
    run = only(root)
    assert (run.kind, run.outcome, run.flights, run.planned) == ("sweep", "completed", 2, 2)
    assert run.changes == ("trigger.b2_deg=0.5,1", "duration_s=0.02")
    assert (run.law, run.trigger) == ("proposed", "per_channel")
    results = read_results(root / "sweep")
    assert run.saving == np.median(results.column("saving").to_numpy())
    worst = max(max(results.column(f"uav{uav}.iae_roll").to_pylist()) for uav in (1, 2, 3))
    assert run.iae["roll"] == worst


def test_a_campaign_says_how_far_it_is(tmp_path: Path) -> None:
    root, plan = tmp_path / "runs", planned(draws=4)
    folder = root / "camp"
    open_folder(folder, plan)
    assert (only(root).outcome, only(root).flights, only(root).planned) == ("unfinished", 0, 4)
    rows = list(rows_of(plan.draws))
    append_results(folder, fly_rows(plan.flights, rows[:3]))
    run = only(root)
    assert (run.kind, run.outcome, run.flights) == ("campaign", "unfinished", 3)
    assert "3 of 3 flights completed, 1 to fly" in run.reason
    with alone_in(folder):
        assert only(root).outcome == "under_way"
    append_results(folder, fly_rows(plan.flights, rows[3:]))
    run = only(root)
    assert (run.outcome, run.flights, run.completed) == ("completed", 4, 4)
    assert list_runs(root).read == 0


def test_a_look_at_a_campaign_s_lock_does_not_stop_it(tmp_path: Path) -> None:
    (tmp_path / MARK).write_text("")
    with (tmp_path / MARK).open("rb") as look:
        fcntl.flock(look, fcntl.LOCK_SH)
        with (tmp_path / MARK).open("rb") as other:  # as if another one looked, too
            fcntl.flock(other, fcntl.LOCK_SH)
            with pytest.raises(BlockingIOError):
                fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.flock(look, fcntl.LOCK_UN)
        with alone_in(tmp_path):
            pass


def test_baselines_and_reproductions_are_listed(tmp_path: Path) -> None:
    folder = tmp_path / "baseline-x"
    folder.mkdir()
    tree = {"scenario": "x", "transmissions": 7, "saved": {"uniform": 0.4, "every_period": 0.9}}
    (folder / "baseline.json").write_text(json.dumps(tree))
    run = only(tmp_path)
    assert (run.kind, run.events, run.saving) == ("baseline", 7, 0.9)
    assert "40.00 %" in run.reason
    shutil.rmtree(folder)
    for name in ("data", "figures"):
        (tmp_path / "reproduce" / name).mkdir(parents=True)
    assert (only(tmp_path).kind, only(tmp_path).outcome) == ("reproduce", "unfinished")
    (tmp_path / "reproduce" / "report.html").write_text("")
    assert only(tmp_path).outcome == "completed"


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("summary.json", "{", "is no summary"),
        ("summary.json", "[1]", "is no summary"),
        ("summary.json", "{}", "is no summary"),
        ("flight.yaml", "schema: 2\n", "layout 2"),
        ("flight.yaml", "[", "not YAML"),
        ("flight.yaml", "schema: 1\n", "cannot be read"),
        ("flight.yaml", "\xff", "cannot be read"),
        ("request.yaml", "schema: 99\n", "layout 99"),
        ("request.yaml", "{", "not YAML"),
        ("baseline.json", "{}", "is no baseline"),
        ("holiday.jpg", "", "no run"),
    ],
)
def test_what_is_no_run_is_named_in_one_line(
    cache: Path, tmp_path: Path, name: str, content: str, reason: str
) -> None:
    make_run(cache, tmp_path / "good")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / name).write_bytes(content.encode("latin-1"))
    listing = list_runs(tmp_path)
    assert [run.name for run in listing.runs] == ["good"]
    (foreign,) = listing.foreign
    assert foreign.name == "bad"
    assert reason in foreign.reason
    assert "\n" not in foreign.reason


def test_runs_in_folders_of_folders_are_found(cache: Path, tmp_path: Path) -> None:
    make_run(cache, tmp_path / "talk" / "demo" / "a")
    (tmp_path / "talk" / "empty").mkdir()
    listing = list_runs(tmp_path)
    assert [run.name for run in listing.runs] == ["talk/demo/a"]
    assert [(one.name, one.reason) for one in listing.foreign] == [("talk/empty", "empty")]


def test_the_newest_comes_first(cache: Path, tmp_path: Path) -> None:
    for name, started in (
        ("first", "2026-01-01T10:00:00+00:00"),
        ("last", "2026-01-01T10:30:00+01:00"),
    ):
        folder = make_run(cache, tmp_path / name)
        mark = read_mark(folder)
        assert mark is not None
        (folder / FLIGHT).write_text(yaml_of({"schema": 1, **vars(mark), "started": started}))
    assert [run.name for run in list_runs(tmp_path).runs] == ["first", "last"]  # 10:00 and 9:30 UTC


def test_a_summary_is_read_as_it_was_written(cache: Path, tmp_path: Path) -> None:
    folder = make_run(cache, tmp_path / "a")
    summary = read_summary(folder)
    save_summary(summary, folder)
    assert read_summary(folder) == summary
    with pytest.raises(BadInput, match="cannot read"):
        read_summary(tmp_path)


def test_a_sweep_over_laws_names_them_and_has_no_medians_of_unlike_flights(
    short: Path, tmp_path: Path
) -> None:
    root = tmp_path / "runs"
    swept([short], ["controller.kind=pid,proposed", "duration_s=0.02"], root / "sweep")
    (run,) = list_runs(root).runs
    assert (run.law, run.trigger) == ("pid, proposed", "per_channel")
    assert (run.messages, run.events, run.saving, run.iae.get("roll")) == (None,) * 4
    assert run.completed == 2
    assert run.faults[0].startswith("uav=3: actuator=rudder")


def test_a_sweep_over_laws_names_the_triggers_that_they_bring(short: Path, tmp_path: Path) -> None:
    root, own = tmp_path / "runs", tmp_path / "own.yaml"
    own.write_text(f"extends: {short}\nduration_s: 0.02\ntrigger: null\n")
    swept([own], ["controller.kind=pid,surviving"], root / "sweep")
    run = only(root)
    assert (run.law, run.trigger) == ("pid, surviving", "per_channel, scaled")
