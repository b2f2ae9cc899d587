"""`gcs log`, `gcs export`, `gcs runs` and `open_run` of logs of others."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import gcs
from gcs.commands import log as log_command
from gcs.commands.cli import app
from gcs.console.errors import BadInput
from gcs.results.logs.read import read_flight
from gcs.results.logs.table import FlightTable, LogText, by_name, channel
from gcs.tui.flight_frames import frames_of
from gcs.tui.playback import Playback

TLOG = Path(__file__).parents[3] / "data" / "others" / "mavlink1.tlog"
TIMES = np.arange(0.0, 20.0, 0.05)


@pytest.fixture
def flight() -> FlightTable:
    """Attitude, place and airspeed of a circle of 100 m around 47° N, 8° E, at 20 Hz."""
    yaw = 0.2 * TIMES
    north, east = 100.0 * np.sin(yaw) / 6378137.0, 100.0 * (1.0 - np.cos(yaw)) / 6378137.0
    values = {
        "roll": np.full(len(TIMES), 0.4),
        "pitch": np.sin(TIMES) / 10.0,
        "yaw": yaw,
        "V": np.full(len(TIMES), 20.0),
        "latitude": 47.0 + np.degrees(north),
        "longitude": 8.0 + np.degrees(east / np.cos(np.radians(47.0))),
        "altitude": 500.0 + TIMES,
        "share_elevator": np.sign(np.sin(TIMES)),
    }
    return FlightTable(
        title="circle",
        kind="bin",
        channels=by_name(channel(name, TIMES, column) for name, column in values.items()),
        modes=((0.0, "AUTO"), (10.0, "FBWA")),
        texts=(LogText(12.0, 2, "Engine failure"),),
    )


def run(*arguments: str | Path) -> str:
    done = CliRunner(env={"COLUMNS": "300"}).invoke(app, list(map(str, arguments)))
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0
    return done.stdout


def table_of(flight: FlightTable, path: Path) -> Path:
    """A CSV file of a flight, by our names."""
    columns = flight.on(TIMES, flight.channels)
    rows = np.column_stack([TIMES, *columns.values()])
    np.savetxt(path, rows, "%.12g", ",", header=",".join(["time_s", *columns]), comments="")
    return path


def test_a_log_is_listed_without_a_terminal() -> None:
    shown = run("log", TLOG)
    assert shown == run("log", TLOG, "--list")
    assert "mavlink1.tlog, system 1: tlog, 9.9 s, began 2023-11-14 22:13:20 UTC" in shown
    assert "ATTITUDE.pitch" in shown
    assert "modes: AUTO from 0.0 s" in shown
    assert "no airspeed" in shown


def test_the_list_as_json() -> None:
    tree = json.loads(run("log", TLOG, "--json"))
    [roll] = [one for one in tree["channels"] if one["name"] == "roll"]
    assert roll["unit"] == "rad"
    assert roll["values"] == 100
    assert roll["rate_hz"] == pytest.approx(10.0)
    assert roll["gaps_s"] == []
    assert tree["modes"] == [{"time_s": 0.0, "mode": "AUTO"}]
    assert any("no accelerations" in one for one in tree["remarks"])


def replayed(frames: Sequence[tuple[int, bytes]]) -> Playback:
    player = Playback("log", frames, lambda: 0.0)
    player.seek(player.end_s)
    while not player.advance():
        pass
    return player


def test_the_replay_shows_what_the_log_has(flight: FlightTable) -> None:
    [vehicle] = replayed(frames_of(flight)).fleet.vehicles.values()
    assert vehicle.attitude_deg == pytest.approx(
        np.degrees([0.4, np.sin(19.9) / 10, 3.98 - 2 * np.pi]), abs=0.01
    )
    assert vehicle.airspeed_m_s == 20.0
    assert vehicle.position_m == pytest.approx(
        (100.0 * np.sin(3.98), 100.0 * (1 - np.cos(3.98)), -19.9), abs=0.5
    )
    assert vehicle.held is not None
    assert vehicle.held[1] == np.sign(np.sin(19.9))
    assert "Engine failure" in [one.text for one in vehicle.texts]
    assert "mode FBWA" in [one.text for one in vehicle.texts]
    assert vehicle.mode == "-"  # FBWA is none of ours
    assert not vehicle.tells_private  # no triggers
    rows = vehicle.history.rows()
    assert len(rows) == pytest.approx(200, abs=2)
    assert rows["actual"][:, 0] == pytest.approx(20.0)
    assert np.ptp(rows["time_s"]) == pytest.approx(19.9, abs=0.1)
    assert not np.isfinite(rows["reference"]).any()


def test_a_log_with_differences_only_shows_these(flight: FlightTable) -> None:
    named = {
        f"error_{one}": channel(f"error_{one}", TIMES, 0.1 * TIMES) for one in ("roll", "airspeed")
    }
    player = replayed(frames_of(FlightTable("x", "csv", by_name(named.values()))))
    [vehicle] = player.fleet.vehicles.values()
    assert vehicle.error is not None
    assert vehicle.error[:2] == pytest.approx((1.99, np.degrees(1.99)), abs=0.01)
    assert vehicle.attitude_deg is None


def test_a_log_of_others_is_replayed_from_its_table() -> None:
    player = log_command._playback(TLOG, None, None)
    assert player.title == "mavlink1.tlog, system 1"
    assert player.clock.name == "log"
    assert player.end_s == pytest.approx(9.9, abs=0.1)
    ours = TLOG.parents[1] / "dashboard" / "flight.tlog"
    assert log_command._playback(ours, None, None).clock.name == "simulated"
    assert log_command._playback(ours, 2, None).title == "flight.tlog, system 2"


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_what_is_exported_is_read_back(to: str, flight: FlightTable, tmp_path: Path) -> None:
    path = table_of(flight, tmp_path / "circle.csv")
    run("export", path, "--to", to, "--out", tmp_path / "out")
    again = read_flight(tmp_path / "out" / f"circle.{to}")
    for name, one in flight.channels.items():
        assert again[name].at(TIMES) == pytest.approx(one.values, abs=1e-9), name
    assert again["north"].values.max() == pytest.approx(100.0, abs=0.1)


def test_npz_and_kml_of_a_log(flight: FlightTable, tmp_path: Path) -> None:
    path = table_of(flight, tmp_path / "circle.csv")
    run("export", path, "--to", "npz")
    with np.load(tmp_path / "circle.npz") as arrays:
        assert arrays["pitch"] == pytest.approx(flight["pitch"].values)
        assert arrays["pitch.time_s"] == pytest.approx(TIMES)
    run("export", path, "--to", "kml")
    assert "<gx:coord>8.0 47.0 500.0</gx:coord>" in (tmp_path / "circle.kml").read_text()


@pytest.mark.parametrize(
    ("to", "problem"),
    [
        ("csv", "would be written over itself"),
        ("mcap", "--to mcap is of our own recordings"),
        ("ulg", "--to ulg is of our own recordings"),
    ],
)
def test_what_cannot_be_exported(
    to: str, problem: str, flight: FlightTable, tmp_path: Path
) -> None:
    path = table_of(flight, tmp_path / "circle.csv")
    with pytest.raises(BadInput, match=problem):
        run("export", path, "--to", to)
    with pytest.raises(BadInput, match="does not say where it was"):
        run("export", TLOG, "--to", "kml", "--out", tmp_path)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["circle.csv"]


@pytest.mark.parametrize("option", ["--uav", "--columns"])
def test_options_of_logs_are_of_no_run(option: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=f"{option} is of logs"):
        run("export", tmp_path, "--to", "csv", option, "1")


def test_values_that_no_message_has_are_left_out_of_the_replay(flight: FlightTable) -> None:
    huge = channel("V", TIMES, np.where(TIMES < 10.0, 20.0, 1e200))
    assert huge is not None
    frames = frames_of(replace(flight, channels={**flight.channels, "V": huge}))
    [vehicle] = replayed(frames).fleet.vehicles.values()
    assert vehicle.airspeed_m_s == 20.0


def test_a_log_is_opened_as_a_flight(flight: FlightTable, tmp_path: Path) -> None:
    opened = gcs.open_run(table_of(flight, tmp_path / "circle.csv"))
    frame = opened.frame(["roll", "north"], degrees=True)
    assert frame["roll"].iloc[7] == pytest.approx(np.degrees(0.4))
    assert len(frame) == len(TIMES)
    assert any("no rates" in one for one in opened.remarks)
    assert opened.dataset(["pitch"]).sizes["time_s"] == len(TIMES)
    assert "is a log: it has no figures" in repr(opened)
    with pytest.raises(BadInput, match="it has no figures and no scenario"):
        opened.plot()
    with pytest.raises(BadInput, match="no MAVLink frame"):
        gcs.open_run(__file__)


def test_a_folder_of_logs_is_no_run_and_says_what_lists_them(tmp_path: Path) -> None:
    (tmp_path / "field").mkdir()
    (tmp_path / "field" / "00000042.BIN").write_bytes(b"x")
    done = CliRunner(env={"COLUMNS": "200"}).invoke(app, ["runs", str(tmp_path)])
    assert "field: no run: 1 log, such as 00000042.BIN; gcs log lists what is in one" in done.stderr
