"""`gcs identify` and `gcs design` as a user runs them: from a plant to a flight over UDP."""

import json
from pathlib import Path

import pytest
from flying import assert_one_message, run

pytestmark = pytest.mark.sitl

REAL = ("--servo-lag", "0.02", "--servo-rate", "400", "--gyro-noise", "0.3")


def test_from_a_plant_to_a_formation_over_udp(tmp_path: Path) -> None:
    aircraft, scenario = tmp_path / "mine.yaml", tmp_path / "formation.yaml"
    done = run("gcs", "identify", "own:aerosonde", "--cruise", "24", "-o", aircraft)
    assert done.returncode == 0, done.stderr
    assert "nothing speaks against it" in done.stdout
    options = ("--law", "tube", *REAL, "--uavs", "3", "-o", scenario)
    done = run("gcs", "design", aircraft, *options)
    assert done.returncode == 0, done.stderr
    counts = []
    for where in ("--in-process", "--free-ports"):
        out = tmp_path / where
        done = run("gcs", "fly", scenario, where, "--json", "--record", "none", "--out", out)
        assert done.returncode == 0, done.stderr
        counts.append(
            [
                [channel["events"] for channel in uav["channels"].values()]
                for uav in json.loads(done.stdout)["uavs"]
            ]
        )
    assert counts[0] == counts[1]
    assert max(map(sum, counts[0])) < 300


def test_a_flight_is_recorded_and_identified(tmp_path: Path) -> None:
    out = tmp_path / "run"
    flight = ("airframes/aerosonde", "--in-process", "--with", "realistic", "--record", "full")
    assert run("gcs", "fly", *flight, "--out", out).returncode == 0
    done = run("gcs", "identify", "--from", out, "--aircraft", "aerosonde", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["aircraft"]["coefficients"]["cl_da"] == pytest.approx(-0.17, rel=0.02)
    assert any("stay at their nominal values" in line for line in found["verdict"])


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (("design", "aerosonde", "--law", "lqr"), "--law is 'lqr', expected one of proposed"),
        (("design", "aerosonde", "--airspeed", "3"), "--airspeed is 3, expected [18, 30] m/s"),
        (("design", "none.yaml"), "none.yaml"),
        (("design", "aerosonde", "--plant", "["), "--plant is '[', expected a section in YAML"),
        (("design", "aerosonde", "-o", "other.yaml"), "other.yaml already exists"),
        (("identify",), "expected either a PLANT, or --from FOLDER"),
        (("identify", "own:aerosonde"), "--cruise is missing"),
        (("identify", "x:y", "--cruise", "20"), "PLANT is 'x:y', expected"),
        (("identify", "own:aerosonde", "--cruise", "5"), "the elevator would have to pass"),
        (("identify", "own:aerosonde", "--cruise", "24", "-o", "other.yaml"), "already exists"),
        (
            ("design", "c172p", "--plant", "{kind: jsbsim, aircraft: zeppelin}", "-o", "new.yaml"),
            "zeppelin",
        ),
        (("identify", "--from", "none"), "--aircraft is missing"),
        (("identify", "--from", "none", "--aircraft", "aerosonde"), "none"),
        (("identify", "none.bin", "--aircraft", "aerosonde"), "none.bin"),
    ],
)
def test_bad_input_is_one_message(
    command: tuple[str, ...], reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("other.yaml").write_text("name: mine\n")
    done = run("gcs", *command)
    assert done.returncode == 2, done.stderr
    assert_one_message(done.stderr)
    assert reason in done.stderr.replace("\n", " ")
    assert [path.name for path in tmp_path.iterdir()] == ["other.yaml"]
    assert Path("other.yaml").read_text() == "name: mine\n"
