"""Flights from Python: the command line's, with names, units and its errors."""

import json
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from typer.testing import CliRunner

import gcs
from ftc_lab.campaigns.flights import figures_of
from gcs import BadInput, Flight, FlightLost, fly, open_run
from gcs.commands.cli import app
from gcs.commands.common import changed_scenario
from gcs.fleet.in_process import fly_in_process
from gcs.results.columns import COLUMNS, LIGHT
from gcs.results.quantities import PAPER_ORDER
from mavlink_defs.config.models import ConfigError

SHORT = {"duration_s": 2.0}
LOST = {"duration_s": 20.0, "uncertainty.mass": 5.0}  # too heavy to stay in the air


def without_wall_time(tree: dict[str, Any]) -> dict[str, Any]:
    return {key: tree[key] for key in tree if key not in {"wall_s", "real_time_factor"}}


@pytest.fixture(scope="module")
def full() -> Flight:
    return fly("paper/scenario1", SHORT, record="full")


@pytest.fixture(scope="module")
def lost() -> Flight:
    return fly("paper/scenario1", LOST)


def test_the_figures_are_those_of_the_command_bit_for_bit(tmp_path: Path) -> None:
    arguments = ["fly", "paper/scenario1", "--in-process", "--json", "--no-figures", "--quiet"]
    keys = ["--set", "duration_s=2.0", "--set", "controller.kind=surviving", "--with", "realistic"]
    done = CliRunner().invoke(app, [*arguments, *keys, "--out", str(tmp_path / "run")])
    assert done.exit_code == 0, done.output
    changes = {**SHORT, "controller.kind": "surviving"}
    flight = fly("paper/scenario1", changes, overlays=["realistic"])
    assert without_wall_time(json.loads(json.dumps(flight.summary.to_json()))) == (
        without_wall_time(json.loads(done.stdout))
    )
    assert flight.summary.scenario.endswith("duration_s = 2.0, controller.kind = surviving")


@pytest.mark.parametrize("record", ["light", "full"])
def test_a_run_folder_is_the_flight(record: Any, tmp_path: Path) -> None:
    run = tmp_path / "run"
    flown = fly("paper/scenario1", SHORT, record=record, out=run)
    opened, in_memory = open_run(run), fly("paper/scenario1", SHORT, record=record)
    for flight in (flown, opened):
        assert flight.table.schema.equals(in_memory.table.schema, check_metadata=True)
        assert flight.frame().equals(in_memory.frame())
        assert flight.events.equals(in_memory.events)
        assert flight.scenario == in_memory.scenario
        assert flight.folder == run
    assert opened.summary == flown.summary
    assert {path.name for path in run.iterdir()} == {
        *("flight.yaml", "scenario.yaml", "summary.json", "trajectory.arrows", "events.arrows")
    }


def test_frames_have_names_and_units(full: Flight) -> None:
    frame = full.frame()
    assert frame.index.names == ["time_s", "uav"]
    assert list(frame.columns) == [column.name for column in COLUMNS]
    units = {column.name: column.unit for column in COLUMNS if column.unit}
    assert frame.attrs["units"] == {"time_s": "s"} | units
    assert frame.attrs["scenario"] == full.summary.scenario
    assert len(frame) == 2000 * 3
    light = fly("paper/scenario1", SHORT).frame()
    assert list(light.columns) == [column.name for column in LIGHT]
    assert light.equals(frame.loc[light.index, light.columns])


def test_frames_hold_what_was_flown(full: Flight) -> None:
    """The arrays of `fly_in_process` are another way to the same numbers."""
    recording = fly_in_process(full.scenario)
    states = full.states
    assert np.array_equal(states.to_numpy().reshape(recording.states.shape), recording.states)
    roll = full.frame(["roll"], uav=2)
    assert np.array_equal(roll["roll"].to_numpy(), recording.states[:, 1, 6])
    assert np.array_equal(roll.index.get_level_values("time_s"), recording.time_s)
    assert set(roll.index.get_level_values("uav")) == {2}


def test_degrees_are_named(full: Flight) -> None:
    columns = ["roll", "p", "u", "held_rudder", "held_throttle", "V_dot", "omega_d_dot_p"]
    rad, deg = full.frame(columns), full.frame(columns, degrees=True)
    for name, unit in {
        "roll": "deg",
        "p": "deg/s",
        "held_rudder": "deg",
        "omega_d_dot_p": "deg/s²",
        "u": "m/s",
        "held_throttle": "N",
        "V_dot": "m/s²",
    }.items():
        assert deg.attrs["units"][name] == unit
        factor = 180.0 / np.pi if unit.startswith("deg") else 1.0
        assert np.allclose(deg[name], rad[name] * factor, rtol=1e-14, equal_nan=True)
    assert rad.attrs["units"]["roll"] == "rad"


def test_events_are_those_of_the_summary(full: Flight) -> None:
    events = full.events
    assert list(events.columns) == ["time_s", "step", "uav", "actuator", "value"]
    counts = events.groupby(["uav", "actuator"], observed=False).size()
    for uav in full.summary.uavs:
        assert uav.events == counts[uav.id].sum()
        for name in PAPER_ORDER:
            assert counts[uav.id, name] == uav.channels[name].events > 0
    assert events["time_s"].is_monotonic_increasing
    assert np.array_equal(events["time_s"], events["step"] * full.scenario.step_us / 1e6)
    held = full.frame(["held_rudder"], uav=1)["held_rudder"].droplevel("uav")
    rudder = events[(events["uav"] == 1) & (events["actuator"] == "rudder")]
    assert np.array_equal(held[rudder["time_s"]], rudder["value"])


def test_figures_are_those_of_campaigns(full: Flight) -> None:
    figures, expected = full.figures, figures_of(full.summary)
    assert figures.index.name == "uav"
    for uav, row in figures.iterrows():
        for name, value in row.items():
            known = expected[f"uav{uav}.{name}"]
            assert np.isnan(value) if known is None else value == known
    assert figures.attrs["units"]["iae_roll"] == "deg s"


def test_other_libraries_take_it_by_arrow(full: Flight) -> None:
    reader = pa.RecordBatchReader.from_stream(full)
    assert reader.read_all().to_pandas().equals(full.table.to_pandas())
    assert full.table.schema.field("roll").metadata == {b"unit": b"rad"}


def test_datasets_have_names_and_units(full: Flight) -> None:
    pytest.importorskip("xarray")
    dataset = full.dataset(degrees=True)
    assert dict(dataset.sizes) == {"time_s": 2000, "uav": 3}
    assert dataset["roll"].dims == ("time_s", "uav")
    assert dataset["roll"].attrs["units"] == "deg"
    assert dataset["time_s"].attrs["units"] == "s"
    assert list(dataset["name"].values) == ["leader", "follower 1", "follower 2"]
    rolls = full.frame(["roll"], degrees=True)["roll"].to_numpy().reshape(-1, 3)
    assert np.array_equal(dataset["roll"].values, rolls)
    assert np.array_equal(dataset.sel(uav=2)["roll"], rolls[:, 1])
    assert dataset.attrs["scenario"] == full.summary.scenario


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch, full: Flight) -> None:
    monkeypatch.setattr("gcs.console.extras.find_spec", lambda _: None)
    for ask, package in ((full.frame, "pandas"), (full.dataset, "xarray")):
        with pytest.raises(BadInput, match=f"needs {package}, not installed") as refused:
            ask()
        (note,) = refused.value.__notes__
        assert note == "hint: pip install 'pandas>=2.2' 'xarray>=2024.7' (the extra `python`)"


def test_pictures(full: Flight, lost: Flight) -> None:
    for flight in (full, lost):
        figure: Any = flight.plot()
        labels = {axis.get_ylabel() for axis in figure.axes}
        assert {"airspeed [m/s]", "rudder [deg]", "throttle interval [ms]"} <= labels
        assert figure._repr_png_().startswith(b"\x89PNG")
    throttle: Any = full.plot().axes[8]
    points = sum(len(line.get_xdata()) for line in throttle.lines)
    channels = [uav.channels["throttle"].events for uav in full.summary.uavs]
    assert points == sum(count - 1 for count in channels)  # every interval between two events
    mission = fly("missions/hexagon", {"duration_s": 20.0})
    assert len(mission.plot("mission").axes) == 8
    with pytest.raises(BadInput, match="no mission"):
        full.plot("mission")
    with pytest.raises(BadInput, match="'overview' or 'mission'"):
        full.plot("fig6")  # type: ignore[arg-type]  # the mistake


def test_texts_are_the_tables_of_the_command(full: Flight) -> None:
    assert repr(full).startswith("<flight of 'Paper, scenario 1, duration_s = 2.0': 2 s, completed")
    text, html = str(full), full._repr_html_()
    for part in ("Transmissions in 2000 control periods", "follower 2", "IAE vs commands"):
        assert part in text
        assert part in html
    assert html.startswith("<pre")
    assert "script" not in html


# lost flights


def test_a_lost_flight_has_its_data(lost: Flight) -> None:
    assert not lost.completed
    assert lost.loss is not None
    assert re.match(r"UAV \d was lost at \d+\.\d+ s: it hit the ground", lost.loss)
    end_s = lost.frame().index.get_level_values("time_s").max()
    assert 1.0 < lost.summary.duration_s - 0.02 <= end_s + 1e-9
    assert "was lost at" in repr(lost)


def test_check_raises_what_ends_the_command(lost: Flight, full: Flight, tmp_path: Path) -> None:
    assert full.check() is full
    with pytest.raises(FlightLost) as raised:
        lost.check()
    keys = [f"{key}={json.dumps(value)}" for key, value in LOST.items()]
    options = [part for key in keys for part in ("--set", key)]
    command = ["fly", "paper/scenario1", "--in-process", "--no-figures", *options]
    ended = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "run")])
    assert isinstance(ended.exception, FlightLost)
    assert str(ended.exception) == str(raised.value)


# recordings that broke off


def test_a_torn_recording_is_read_up_to_the_tear(tmp_path: Path) -> None:
    changes = {"duration_s": 8.0}
    fly("paper/scenario1", changes, record="full", out=tmp_path / "run")
    assert not open_run(tmp_path / "run").torn
    for name in ("trajectory.arrows", "events.arrows"):
        path = tmp_path / "run" / name
        path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    (tmp_path / "run" / "summary.json").unlink()
    torn = open_run(tmp_path / "run")
    assert torn.torn
    frame, expected = torn.frame(), fly("paper/scenario1", changes, record="full").frame()
    assert 0 < len(frame) < len(expected)
    assert frame.equals(expected.iloc[: len(frame)])
    assert "broke off" in repr(torn)
    with pytest.raises(BadInput, match=r"summary\.json"):
        _ = torn.summary
    assert torn.plot().axes
    (tmp_path / "run" / "trajectory.arrows").write_bytes(b"")
    with pytest.raises(BadInput, match="is no recording"):
        open_run(tmp_path / "run").frame()


def test_what_is_no_run_folder(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="is no run folder") as refused:
        open_run(tmp_path)
    assert "gcs fly writes" in refused.value.__notes__[0]


def test_a_flight_that_was_not_recorded_has_figures(tmp_path: Path) -> None:
    for out in (None, tmp_path / "run"):
        flight = fly("paper/scenario1", SHORT, record="none", out=out)
        assert flight.summary.uavs == fly("paper/scenario1", SHORT).summary.uavs
        for ask in (flight.frame, lambda flight=flight: flight.events, flight.plot):
            with pytest.raises(BadInput, match="was not recorded"):
                ask()


# scenarios and changes


@pytest.mark.parametrize(
    ("changes", "settings"),
    [
        ({"trigger.b2_deg": 1}, ["trigger.b2_deg=1"]),
        ({"controller": {"kind": "pid"}}, ["controller={kind: pid}"]),
        ({"uavs[0].name": "boss", "faults": []}, ["uavs[0].name=boss", "faults=[]"]),
        ({"links.formation.trigger": {}}, ["links.formation.trigger={}"]),
        ({"controller.K1": np.array([41.0, 42.0, 43.0])}, ["controller.K1=[41.0, 42.0, 43.0]"]),
        ({"duration_s": np.float64(3.0)}, ["duration_s=3.0"]),
        ({"profile": None, "name": "x"}, ["profile=null", "name=x"]),
    ],
)
def test_changes_are_those_of_set(changes: dict[str, Any], settings: list[str]) -> None:
    """They give the same scenario, or the same error but for the place where they are written."""

    def read(make: Any) -> Any:
        try:
            return make()
        except (BadInput, ConfigError) as problem:
            return str(problem).replace("--set", "changes")

    expected = read(lambda: changed_scenario(Path("paper/scenario1"), None, settings))
    for scenario in ("paper/scenario1", Path("paper/scenario1")):
        short = {"duration_s": 0.01, **changes}
        found = read(partial(lambda *given: fly(*given, record="none").scenario, scenario, short))
        if isinstance(expected, str):
            assert found == expected
        else:
            same = {"duration_s": expected.duration_s, "name": expected.name}
            assert found.model_copy(update=same) == expected


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"trigger.b2": 1}, "changes: trigger.b2: unknown key; did you mean 'b2_deg'?"),
        ({"faults[7].uav": 1}, "changes faults[7].uav: expected a list of more than 7 at faults"),
        ({"duration_s": -1}, "changes: duration_s: expected (0, 86400] s, got -1"),
        ({"a b": 1}, "changes a b: expected keys and indices as in trigger.b2_deg"),
        ({"name": {1, 2}}, "changes: expected plain data"),
        ([("duration_s", 1)], "changes: expected a mapping, got list"),
    ],
)
def test_a_wrong_change_is_the_commands_error(changes: Any, text: str) -> None:
    with pytest.raises(BadInput) as refused:
        fly("paper/scenario1", changes)
    assert text in str(refused.value)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"scenario": "paper/scenario9"}, "no such file, and no bundled scenario of that name"),
        ({"scenario": {"name": "x"}}, "scenario: expected a name, a path or a Scenario, got dict"),
        ({"overlays": "realistic"}, "overlays: expected a list, as in ['realistic']"),
        ({"overlays": ["unreal"]}, "no bundled scenario of that name"),
        ({"record": "npz"}, "record: expected 'full', 'light', 'none', got 'npz'"),
        ({"speed": 1.0}, "speed is of processes"),
        ({"changes": {"links.impairments": {}}}, "links.impairments apply to the wire"),
        ({"signing_key": "/nowhere/key"}, "/nowhere/key"),
    ],
)
def test_a_wrong_argument_is_one_clear_error(arguments: dict[str, Any], text: str) -> None:
    with pytest.raises(BadInput, match=re.escape(text)):
        fly(**{"scenario": "paper/scenario1", **arguments})


def test_a_folder_that_is_not_empty_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(BadInput, match="not empty"):
        fly("paper/scenario1", SHORT, out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


# the package


def test_the_package_is_light() -> None:
    code = "import gcs, sys; print(sorted(m for m in sys.modules if m.split('.')[0] == 'gcs'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['gcs']"


def test_every_name_of_the_package_is_there() -> None:
    for name in gcs.__all__:
        assert getattr(gcs, name).__doc__
        assert name in dir(gcs)
    with pytest.raises(AttributeError, match="no attribute 'fligt'"):
        getattr(gcs, "fligt")  # noqa: B009 - a type checker sees the mistake otherwise


USER = """
from gcs import Flight, Uav, connect, fly, fly_many, open_run
from gcs.api.station import Subscription
from gcs.testing.flying import TestFleet

flight = fly("paper/scenario1", {"controller.kind": "surviving", "faults": []})
reveal_type(flight)
reveal_type(flight.summary.uavs[0].saving)
reveal_type(fly_many(["paper/scenario1"]))
reveal_type(open_run("runs/x").loss)
fly("paper/scenario1", record="all")
flight.frme()

async def main() -> None:
    async with connect() as fleet:
        reveal_type(fleet[1])
        async for message in fleet[1].messages("ATTITUDE"):
            reveal_type(message)

def test_flown(ftc_fleet: TestFleet) -> None:
    uav = ftc_fleet.uav(2)
    uav.set_fault("rudder", effectiveness=0.5)
    reveal_type(uav.get_param("TRIG_B2_DEG"))
    uav.disarm(force="yes")
"""


@pytest.mark.slow
def test_a_strict_type_checker_sees_the_types(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    (tmp_path / "user.py").write_text(USER)
    (tmp_path / "mypy.ini").write_text("[mypy]\nfollow_imports_for_stubs = True\n")
    checks = ["--strict", "--no-error-summary", "--cache-dir", str(tmp_path / "cache")]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file=mypy.ini", *checks, "user.py"],
        cwd=tmp_path,
        env={"MYPYPATH": str(Path(gcs.__file__).parents[1]), "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    ours = [line for line in done.stdout.splitlines() if line.startswith("user.py")]
    found = [line.split(": ", 2)[2] for line in ours]
    assert found == [
        'Revealed type is "gcs.api.flight.Flight"',
        'Revealed type is "float | None"',
        'Revealed type is "list[gcs.api.flight.Flight]"',
        'Revealed type is "str | None"',
        'Argument "record" to "fly" has incompatible type "Literal[\'all\']"; '
        "expected \"Literal['full', 'light', 'none']\"  [arg-type]",
        '"Flight" has no attribute "frme"; maybe "frame"?  [attr-defined]',
        'Revealed type is "gcs.station.vehicle.Vehicle"',
        'Revealed type is "mavlink_defs.dialect.MAVLink_message"',
        'Revealed type is "mavlink_defs.services.param.Param"',
        'Argument "force" has incompatible type "str"; expected "bool"  [arg-type]',
    ], done.stdout + done.stderr


def test_one_scenario_is_no_list_of_them() -> None:
    with pytest.raises(gcs.BadInput, match=r"flights: expected a list .*\['paper/scenario1'\]"):
        gcs.fly_many("paper/scenario1")


def test_a_law_given_as_a_class_is_refused_with_the_way_to_name_it() -> None:
    class Mine: ...

    for law in (Mine, lambda: None):
        with pytest.raises(gcs.BadInput, match="expected plain data") as refused:
            gcs.fly("paper/scenario1", {"controller.kind": law})
        assert "FILE.py:" in refused.value.hint
