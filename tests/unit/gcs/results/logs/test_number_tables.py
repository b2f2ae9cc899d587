"""Tables of numbers, CSV, Parquet and MAT, by a column map."""

import gzip
import lzma
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from gcs.console.errors import BadInput
from gcs.results.logs.column_map import bundled_maps
from gcs.results.logs.read import read_flight
from mavlink_defs.config.models import ConfigError

MAP = """
time: {column: t, unit: ms}
channels:
  roll: {column: bank, unit: deg, sign: -1}
  static_pressure: {column: ps, unit: hPa, scale: 2, offset: 5}
  fault: {column: failed, optional: true}
"""


@pytest.fixture
def column_map(tmp_path: Path) -> Path:
    path = tmp_path / "map.yaml"
    path.write_text(MAP)
    return path


def rows(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_map_gives_names_units_signs_and_offsets(tmp_path: Path, column_map: Path) -> None:
    path = rows(tmp_path / "a.csv", "t;bank;ps;other\n1000;90;10;x\n2000;-90;;y\n3000;0;20;z\n")
    flight = read_flight(path, columns=column_map)
    assert flight.kind == "csv"
    assert flight["roll"].values == pytest.approx([-np.pi / 2, np.pi / 2, 0.0])
    assert flight["roll"].time_s.tolist() == [0.0, 1.0, 2.0]
    assert flight["roll"].source == "bank"
    assert flight["static_pressure"].values.tolist() == [2005.0, 4005.0]
    assert flight["static_pressure"].time_s.tolist() == [0.0, 2.0]
    assert "fault" not in flight
    assert "it has no column 'failed'" in flight.remarks


@pytest.mark.parametrize("suffix", [".csv.gz", ".csv.xz", ".CSV"])
def test_packed_tables(suffix: str, tmp_path: Path, column_map: Path) -> None:
    data = b"t,bank,ps\n" + b"".join(b"%d,%d,1\n" % (k, k) for k in range(50))
    packed = {".csv.gz": gzip.compress(data), ".csv.xz": lzma.compress(data)}
    path = tmp_path / f"a{suffix}"
    path.write_bytes(packed.get(suffix, data))
    assert len(read_flight(path, columns=column_map)["roll"].values) == 50


def test_cells_and_rows_that_are_no_numbers_are_left_out(tmp_path: Path, column_map: Path) -> None:
    text = "t,bank,ps\n1000,90,10\n2000,-,20\n3000,0\n4000,0,30\n50"
    flight = read_flight(rows(tmp_path / "a.csv", text), columns=column_map)
    assert flight["roll"].time_s.tolist() == [0.0, 3.0]
    assert flight["static_pressure"].time_s.tolist() == [0.0, 1.0, 3.0]
    assert "2 rows with more or fewer columns left out" in flight.remarks


def test_dates_are_times(tmp_path: Path) -> None:
    text = "when,bank\n2018-09-11 18:55:44.750,1\n2018-09-11 18:55:44.800,2\n"
    place = rows(
        tmp_path / "m.yaml", "time: {column: when}\nchannels: {roll: {column: bank, unit: deg}}"
    )
    flight = read_flight(rows(tmp_path / "a.csv", text), columns=place)
    assert flight["roll"].time_s == pytest.approx([0.0, 0.05])
    assert flight.started is not None
    assert flight.started.isoformat() == "2018-09-11T18:55:44.750000+00:00"


def test_our_own_names_need_no_map(tmp_path: Path) -> None:
    text = "time_s,uav,roll,V,x\n5,1,0.1,20,0\n5,2,0.2,30,0\n5.1,1,0.3,21,0\n5.1,2,0.4,31,0\n"
    flight = read_flight(rows(tmp_path / "a.csv", text))
    assert flight["V"].values.tolist() == [20.0, 21.0]
    assert flight["V"].time_s.tolist() == [5.0, 5.1]  # simulated time is kept
    assert "of UAV 1; it has 2, too (--uav)" in flight.remarks
    assert read_flight(tmp_path / "a.csv", uav=2)["V"].values.tolist() == [30.0, 31.0]
    with pytest.raises(BadInput, match="--uav is 3, expected one of 1, 2"):
        read_flight(tmp_path / "a.csv", uav=3)
    table = pa.table({"time_s": [0.0, 0.1], "roll": [0.1, 0.2]})
    parquet.write_table(table, tmp_path / "b.parquet")
    assert read_flight(tmp_path / "b.parquet")["roll"].values.tolist() == [0.1, 0.2]


def test_the_merged_alfa_tables_are_known(tmp_path: Path) -> None:
    [alfa] = [one for one in bundled_maps() if "ALFA" in one.title]
    columns = {one.column: k + 1.0 for k, one in enumerate(alfa.channels.values())}
    head = ["%time", *columns, "delta_roll_airspeed", "delta_roll_airspeed"]
    line = [str(one) for one in columns.values()] + ["15", "1"]
    times = [f"2018-07-18 20:37:39.{k:02d}0" for k in range(0, 30, 5)]
    text = "\n".join([",".join(head), *(",".join([at, *line]) for at in times)])
    flight = read_flight(rows(tmp_path / "alfa.csv", text))
    assert flight.title == "alfa.csv, ALFA, merged to 20 Hz"
    assert set(flight.channels) == set(alfa.channels)
    assert flight["q"].values[0] == -columns["field.angular_velocity.y"]  # left, up: right, down
    assert flight["v_north"].values[0] == columns["field.twist.linear.y"]
    assert flight["error_roll"].values[0] == pytest.approx(-np.radians(columns["delta_roll"]))
    assert flight["error_airspeed"].values[0] == -columns["field.aspd_error"] / 100.0
    assert any("no attitude" in one for one in flight.remarks)


def test_a_mat_file_of_structures(tmp_path: Path) -> None:
    [thor] = [one for one in bundled_maps() if "UMN" in one.title]
    time_s = np.arange(100) * 0.02
    data = {one.column.partition(".")[2]: np.cos(time_s) for one in thor.channels.values()}
    data |= {"time": time_s + 7.0, "motor_RPM": np.ones(9)}
    savemat(tmp_path / "a.mat", {"flight_data": data, "flight_info": {"aircraft": "thor"}})
    flight = read_flight(tmp_path / "a.mat")
    assert flight.kind == "mat"
    assert set(flight.channels) == set(thor.channels)
    assert flight["roll"].time_s == pytest.approx(time_s)
    assert flight["static_pressure"].values == pytest.approx(1000.0 * np.cos(time_s))
    assert flight["latitude"].values == pytest.approx(np.degrees(np.cos(time_s)))


def test_a_damaged_mat_file_that_crashes_its_reader_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"time_s": np.arange(9.0), "roll": np.full(9, 0.5)})
    data, of_doubles = bytearray(path.read_bytes()), (9).to_bytes(4, "little")
    place = data.rindex(of_doubles + (72).to_bytes(4, "little"))
    data[place] = 100  # a type that there is not
    path.write_bytes(data)
    with pytest.raises(BadInput, match="is no MAT file, or is cut off: its reader crashed"):
        read_flight(path)


def test_columns_of_other_lengths_are_left_out(tmp_path: Path) -> None:
    columns = {"time_s": np.arange(9.0), "roll": np.arange(9.0), "V": np.ones(4), "uav": np.ones(5)}
    savemat(tmp_path / "a.mat", columns)
    assert set(read_flight(tmp_path / "a.mat").channels) == {"roll"}


def test_dates_in_numbers_are_no_simulated_time(tmp_path: Path) -> None:
    text = "time_s,uav,roll\n" + "".join(f"{1.7e9 + k},1,0\n" for k in range(5))
    flight = read_flight(rows(tmp_path / "a.csv", text))
    assert (flight["roll"].clock, flight.begin_s, flight.end_s) == ("log", 0.0, 4.0)


def test_a_date_is_no_value_of_a_channel(tmp_path: Path) -> None:
    text = "t,when\n1,2018-09-11 18:55:44\n2,2018-09-11 18:55:45\n"
    place = rows(tmp_path / "m.yaml", "time: {column: t}\nchannels: {V: {column: when}}")
    with pytest.raises(BadInput, match="has no numbers in its columns"):
        read_flight(rows(tmp_path / "a.csv", text), columns=place)


def test_a_clock_that_jumps_is_told(tmp_path: Path, column_map: Path) -> None:
    at = [*range(0, 3000, 100), *range(0, 9000, 100)]
    text = "t,bank,ps\n" + "".join(f"{k},{k % 7},1\n" for k in at)
    flight = read_flight(rows(tmp_path / "a.csv", text), columns=column_map)
    assert len(flight["roll"].values) == 90
    assert any("the clock jumps by -2.9 s after 2.9 s" in one for one in flight.remarks)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.csv", b"", "is no table of numbers"),
        ("a.csv", b"t,bank,ps\n1,2\n1,2\n", "has no column of numbers"),
        ("a.csv", b"t;bank\n1,5;2,5\n2,5;3,5\n", "has no column of numbers"),
        ("a.csv", b"t,b\n1,2\n", "has no column of numbers 'bank', 'ps', which .*map.yaml"),
        ("a.csv", b"t,bank,ps\n,2,3\n,2,3\n", "no column of numbers 't'"),
        ("a.csv", b"t,bank,ps\n1,2,3\n,2,3\n,2,3\n", "column 't' is no time"),
        ("a.csv.xz", lzma.compress(b"t,bank,ps\n1,2,3\n" * 99)[:40], "is cut off"),
        ("a.csv.gz", b"t,bank,ps\n1,2,3\n", "not packed as its name says: .*[Nn]ot a gzip"),
        ("a.mat", b"MATLAB 5.0 MAT-file" + bytes(200), "is no MAT file, or is cut off"),
        ("a.mat", b"t,bank\n1,2\n", "is no MAT file, or is cut off"),
        ("a.parquet", b"t,bank\n1,2\n", "is no Parquet file"),
        ("a.parquet", b"PAR1" + bytes(99) + b"\x40\0\0\0PAR1", "is no Parquet file"),
    ],
)
def test_bad_tables_are_refused_in_a_line(
    name: str, content: bytes, problem: str, tmp_path: Path, column_map: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(BadInput, match=problem) as refused:
        read_flight(path, columns=column_map)
    assert "\n" not in str(refused.value)
    assert name in str(refused.value)


def test_a_table_without_a_map_says_how_to_write_one(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="it has t, bank") as refused:
        read_flight(rows(tmp_path / "a.csv", "t,bank\n1,2\n2,3\n"))
    assert "--columns" in refused.value.hint


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("channels: {roll: {column: a}}", "time"),
        ("time: {column: t}\nchannels: {}", "channels"),
        ("time: {column: t}\nchannels: {rol: {column: a}}", "did you mean 'roll'"),
        (
            "time: {column: t}\nchannels: {roll: {column: a, unit: m}}",
            "expected one of 'rad', 'deg'",
        ),
        ("time: {column: t}\nchannels: {roll: {column: a, sign: 2}}", "sign"),
        ("time: {column: t}\nchannels: {roll: {column: a, optional: true}}", "not optional"),
    ],
)
def test_a_bad_map_names_its_problem(text: str, problem: str, tmp_path: Path) -> None:
    path = rows(tmp_path / "map.yaml", text)
    with pytest.raises(ConfigError, match=problem):
        read_flight(rows(tmp_path / "a.csv", "t,a\n1,2\n2,3\n"), columns=path)


def test_a_map_is_of_logs_of_others(tmp_path: Path, column_map: Path) -> None:
    with pytest.raises(BadInput, match="--columns is of logs of others"):
        read_flight(rows(tmp_path / "trajectory.arrows", ""), columns=column_map)
