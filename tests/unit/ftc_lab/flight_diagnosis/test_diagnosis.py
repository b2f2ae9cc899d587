"""What failed in a log: flights of a small aircraft made here, cut, thinned, short of signals."""

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner, Result

from ftc_lab.commands.diagnose import diagnose
from ftc_lab.flight_diagnosis.decisions import Diagnosis, diagnose_flight, learnt, watch
from ftc_lab.flight_diagnosis.examples import example_of
from ftc_lab.flight_diagnosis.learn import learnt_from
from ftc_lab.flight_diagnosis.relations import SURFACES, Relations, Surface, relations_of
from gcs.console.errors import BadInput
from gcs.results.logs.table import FlightTable, by_name, channel

DATA = Path(__file__).parents[3] / "data" / "alfa"
FAULT_S, LENGTH_S, STEP_S, CRUISE_M_S = 80.0, 110.0, 0.1, 18.0


def flown(failed: str | None, seed: int = 1, length_s: float = LENGTH_S) -> dict[str, np.ndarray]:
    """Signals of a flight with turns and changes of height, on which something fails at 80 s.

    An attitude loop turns errors into rates; without its surface, rates are what the air makes.
    """
    rng, n = np.random.default_rng(seed), round(length_s / STEP_S)
    t = np.arange(n) * STEP_S
    hold = np.repeat(np.arange(n // 50 + 1), 50)[:n]  # commands change each 5 s
    commanded = {
        "roll": rng.uniform(-0.5, 0.5, n // 50 + 1)[hold],
        "pitch": rng.uniform(-0.04, 0.04, n // 50 + 1)[hold],
    }
    angle, airspeed, air = {"roll": 0.0, "pitch": 0.0}, CRUISE_M_S, np.zeros(5)
    rows = []
    for k in range(n):
        air = 0.8 * air + rng.normal(0.0, (0.03, 0.02, 0.15, 0.15, 0.02))
        lost = failed if t[k] >= FAULT_S else None
        error = {name: angle[name] - commanded[name][k] for name in angle}
        r = 9.8 / airspeed * np.tan(angle["roll"])
        p = -(0.4 if lost == "aileron" else 0.9) * error["roll"] + air[0]
        q = -0.9 * error["pitch"] + air[1] + r * np.tan(angle["roll"])
        q_made = -0.25 + air[1] if lost == "elevator" else q
        climb = airspeed * np.sin(angle["pitch"])
        asked = 1.2 + 0.8 * (CRUISE_M_S - airspeed)
        thrust = 0.0 if lost == "engine" else float(np.clip(asked, 0.0, 5.0))
        excess = thrust - 1.2 + air[3]  # by mass; drag is a fixed share of the weight
        rows.append(
            (
                p,
                q_made,
                r + air[4],
                excess,
                0.3 + 0.4 * p + air[2] + (3.0 if lost == "rudder" else 0.0),
                -9.8 / np.cos(angle["roll"]),
                error["roll"],
                error["pitch"],
                airspeed - CRUISE_M_S,
                -climb,
                airspeed,
            )
        )
        angle["roll"] = float(np.clip(angle["roll"] + STEP_S * p, -1.0, 1.0))
        change = STEP_S * (q_made - r * np.tan(angle["roll"]))
        angle["pitch"] = float(np.clip(angle["pitch"] + change, -0.6, 0.6))
        airspeed += STEP_S * (excess - 9.8 * climb / airspeed)
        airspeed = float(np.clip(airspeed, 8.0, 40.0))
    names = "p q r specific_force_x specific_force_y specific_force_z error_roll error_pitch"
    names += " error_airspeed v_down V"
    return {"time_s": t} | dict(zip(names.split(), np.array(rows).T, strict=True))


def table(signals: Mapping[str, np.ndarray]) -> FlightTable:
    t = signals["time_s"]
    channels = (channel(name, t, one) for name, one in signals.items() if name != "time_s")
    return FlightTable("a flight", "csv", by_name(channels))


def judged(flight: FlightTable) -> Diagnosis:
    relations = relations_of(flight)
    return diagnose_flight(relations, watch(relations), learnt(relations))


def without(flight: FlightTable, *names: str) -> FlightTable:
    kept = {name: one for name, one in flight.channels.items() if name not in names}
    return replace(flight, channels=kept)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_is_found_in_a_healthy_flight(seed: int) -> None:
    diagnosis = judged(table(flown(None, seed)))
    assert diagnosis.finding is None
    assert diagnosis.probability < 0.3
    assert diagnosis.cannot == ()


@pytest.mark.parametrize("surface", SURFACES)
def test_what_fails_is_named_and_since_when(surface: str) -> None:
    finding = judged(table(flown(surface))).finding
    assert finding is not None
    assert finding.surface == surface
    assert FAULT_S <= finding.alarm_s < FAULT_S + 20.0
    begin, end = finding.between_s
    assert begin - 0.5 <= FAULT_S <= end + 0.5
    assert begin <= finding.onset_s <= end
    assert sum(finding.probabilities.values()) == pytest.approx(1.0)
    assert max(finding.probabilities, key=lambda name: finding.probabilities[name]) == surface


@pytest.mark.parametrize(
    ("usual", "most", "is_found"), [(0.1, 1.4, True), (0.7, 1.4, False), (0.7, 2.1, True)]
)
def test_a_flight_that_was_unusual_all_along_is_doubted(
    usual: float, most: float, is_found: bool
) -> None:
    relations = relations_of(table(flown(None)))
    watched, known = watch(relations), learnt(relations)
    one = watched["rudder"]
    late = (relations.time_s > 90.0) & (relations.time_s < 92.0)
    ratio = np.where(late, most, usual) * (one.residuals.weight > 0.0)
    evidence = ratio * known.threshold("rudder", one.judged_s)
    found = diagnose_flight(relations, {"rudder": one._replace(evidence=evidence)}, known)
    assert (found.finding is not None) == is_found


def test_repeated_values_of_a_merged_table_are_no_measurements() -> None:
    signals = flown("rudder")
    fine = np.arange(0.0, LENGTH_S - STEP_S, 0.02)
    rows = np.searchsorted(signals["time_s"], fine, side="right") - 1
    merged = {name: one[rows] for name, one in signals.items()} | {"time_s": fine}
    finding, plain = judged(table(merged)).finding, judged(table(signals)).finding
    assert finding is not None
    assert plain is not None
    assert finding.surface == "rudder"
    assert finding.alarm_s == pytest.approx(plain.alarm_s, abs=0.3)


@pytest.mark.parametrize(
    ("missing", "surface"),
    [
        ("specific_force_x", "engine"),
        ("error_airspeed", "engine"),
        ("error_roll", "aileron"),
        ("q", "elevator"),
        ("specific_force_y", "rudder"),
    ],
)
def test_what_the_log_lacks_is_said_and_the_rest_judged(missing: str, surface: str) -> None:
    diagnosis = judged(without(table(flown(None)), missing))
    assert [line for line in diagnosis.cannot if line.startswith(f"{surface} not judged")]
    assert set(diagnosis.ratios) == set(SURFACES) - {surface}
    assert diagnosis.finding is None


def test_a_sensor_that_is_dead_and_a_signal_that_comes_late_judge_nothing() -> None:
    signals = flown(None)
    signals["p"] = np.full_like(signals["p"], 0.1)
    signals["specific_force_y"] = np.where(signals["time_s"] < 100.0, np.nan, 0.1)
    diagnosis = judged(table(signals))
    assert set(diagnosis.ratios) == {"engine", "elevator"}
    assert [one.partition(":")[0] for one in diagnosis.cannot] == [
        "aileron not judged",
        "rudder not judged",
    ]


def test_a_signal_that_comes_once_a_second_is_not_judged_by() -> None:
    signals = flown(None)
    rows = np.arange(len(signals["p"])) // 10 * 10  # ten rows a second, nine of them old
    slow = {name: one if name == "time_s" else one[rows] for name, one in signals.items()}
    with pytest.raises(BadInput, match=r"nothing of a flight can be judged") as refused:
        relations_of(table(slow))
    assert "p is renewed 1.0 times a second, expected 1.5" in str(refused.value.hint)


@pytest.mark.parametrize("surface", ["aileron", "elevator"])
def test_a_command_that_is_held_for_seconds_is_one(surface: str) -> None:
    signals = flown(surface)
    held = np.random.default_rng(1).uniform(-0.3, 0.3, 22).repeat(50)
    for name in ("roll", "pitch"):
        error = signals.pop(f"error_{name}")
        signals |= {name: error + held, f"reference_{name}": held}
    diagnosis = judged(table(signals))
    assert diagnosis.cannot == ()
    assert diagnosis.finding is not None
    assert diagnosis.finding.surface == surface


@pytest.mark.parametrize(
    ("surface", "angle", "rate"), [("aileron", "roll", "p"), ("elevator", "pitch", "q")]
)
def test_a_rate_that_is_fed_forward_is_predicted(surface: Surface, angle: str, rate: str) -> None:
    signals = flown(None)
    commanded = 0.4 * np.sin(0.05 * signals["time_s"] ** 1.5)
    actual = commanded + 0.01 * np.random.default_rng(1).normal(size=len(commanded))
    signals |= {angle: actual, f"reference_{angle}": commanded}
    signals[rate] = np.gradient(commanded, signals["time_s"])
    del signals[f"error_{angle}"]
    one = watch(relations_of(table(signals)))[surface]
    judged_at = one.residuals.weight > 0.0
    left = np.std(one.residuals.residual[judged_at])
    assert left < 0.2 * np.std(one.relation.measured[judged_at])


def test_a_number_that_is_damaged_is_no_evidence() -> None:
    signals = flown(None)
    signals["p"][600], signals["specific_force_y"][700] = 1e200, -3e33
    assert judged(table(signals)).finding is None


def test_a_step_of_the_airspeed_that_is_commanded_is_no_acceleration() -> None:
    signals = flown(None)
    changed = signals["error_airspeed"] - 4.0 * (signals["time_s"] > FAULT_S)
    engines = [
        next(one for one in relations_of(table(each)).relations if one.surface == "engine")
        for each in (signals, signals | {"error_airspeed": changed})
    ]
    assert engines[0].measured == pytest.approx(engines[1].measured, nan_ok=True)
    assert engines[0].terms[-1, 1] - engines[1].terms[-1, 1] == pytest.approx(4.0)


def test_a_gap_is_left_out_and_not_bridged() -> None:
    signals = flown(None)
    kept = (signals["time_s"] < 50.0) | (signals["time_s"] > 57.0)
    diagnosis = judged(table({name: one[kept] for name, one in signals.items()}))
    assert diagnosis.finding is None
    aileron = next(one for one in _relations(signals, kept).relations if one.surface == "aileron")
    inside = (diagnosis.time_s > 50.5) & (diagnosis.time_s < 56.5)
    assert np.isnan(aileron.measured[inside]).all()


def _relations(signals: Mapping[str, np.ndarray], kept: np.ndarray) -> Relations:
    return relations_of(table({name: one[kept] for name, one in signals.items()}))


def test_before_take_off_and_after_landing_nothing_is_judged() -> None:
    signals = flown(None)
    for name, one in signals.items():
        if name != "time_s":
            one[:200] = one[-200:] = 0.0 if name != "specific_force_z" else -9.8
    relations = relations_of(table(signals))
    ground = (relations.time_s < 20.0) | (relations.time_s > LENGTH_S - 20.0)
    for relation in relations.relations:
        assert np.isnan(relation.measured[ground]).all()


def test_what_is_flown_by_hand_is_not_judged() -> None:
    flight = replace(table(flown("aileron")), modes=((0.0, "AUTO"), (79.0, "MANUAL")))
    assert judged(flight).finding is None


def test_a_log_without_a_flight_is_refused() -> None:
    parked = flown(None, length_s=30.0)
    parked["V"] = np.zeros_like(parked["V"]) + 0.1 * parked["p"]
    with pytest.raises(BadInput, match=r"a flight has no flight: its speed is 0\.\d m/s"):
        relations_of(table(parked))
    with pytest.raises(BadInput, match="nothing of a flight can be judged"):
        relations_of(without(table(flown(None, length_s=30.0)), *"pqr", "specific_force_x"))


def test_what_was_learnt_asks_for_more_than_a_healthy_flight_usually_reaches() -> None:
    known = learnt(relations_of(table(flown(None, length_s=30.0))))
    assert set(known.healthy) == set(SURFACES)
    for surface, usual in known.healthy.items():
        threshold = known.threshold(surface, known.judged_s)
        assert threshold > usual.location + 3.0 * usual.scale
        assert known.threshold(surface, 0.1 * known.judged_s) == threshold
        longer = threshold + usual.scale * np.log(10.0)  # as maxima of ten flights
        assert known.threshold(surface, 10.0 * known.judged_s) == pytest.approx(longer, rel=0.01)
    assert known.probability(0.3) < 0.06
    assert known.probability(2.0) > 0.9


def test_so_few_flights_make_nothing_certain() -> None:
    known = learnt(relations_of(table(flown(None, length_s=30.0))))
    assert known.probability(1e6) == pytest.approx((known.flights + 1) / (known.flights + 2))
    assert known.probability(0.0) >= 1 / (known.flights + 2)
    chances = known.chances({"engine": 0.1, "aileron": 900.0, "elevator": 0.2, "rudder": 899.0})
    assert sum(chances.values()) == pytest.approx(1.0)
    assert max(chances.values()) <= (known.faults + 1) / (known.faults + 4)
    assert min(chances.values()) >= 1 / (known.faults + 4)


def test_an_excerpt_of_the_set_has_its_rudder_named() -> None:
    one = example_of(DATA / "carbonZ_2018-09-11-15-06-34_3_rudder_left_failure.csv.xz")
    assert one.truth == "rudder"
    finding = diagnose_flight(one.relations, one.watched, learnt(one.relations)).finding
    assert finding is not None
    assert finding.surface == "rudder"
    assert one.onset_s <= finding.alarm_s < one.onset_s + 1.0
    known = learnt_from([one, one, one])
    assert known.healthy["rudder"].scale == pytest.approx(0.0)


def _run(*arguments: str) -> Result:
    app = typer.Typer()
    app.command()(diagnose)
    return CliRunner().invoke(app, list(arguments))


def _written(path: Path, signals: Mapping[str, np.ndarray]) -> Path:
    rows = np.column_stack(list(signals.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(signals), comments="")
    return path


def test_the_command_tells_by_its_exit_status(tmp_path: Path) -> None:
    broken = _written(tmp_path / "broken.csv", flown("engine"))
    picture = tmp_path / "made" / "evidence.png"
    done = _run(str(broken), "--out", str(picture))
    assert done.exit_code == 1, done.output
    assert "The engine failed at" in done.stdout
    assert "if every second flight has one" in done.stdout
    assert [one.name for one in picture.parent.iterdir()] == ["evidence.png"]
    assert picture.stat().st_size > 10_000
    done = _run(str(broken), "--json")
    found = json.loads(done.stdout)
    assert done.exit_code == 1
    assert found["finding"]["surface"] == "engine"
    assert found["probability"] < 0.97
    assert found["surfaces"]["rudder"]["judged_s"] > 60.0
    healthy = _written(tmp_path / "healthy.csv", flown(None))
    done = _run(str(healthy))
    assert done.exit_code == 0, done.output
    assert "Nothing failed that this log would show" in done.stdout


def test_what_is_not_judged_and_who_is_left_out_is_said(tmp_path: Path) -> None:
    signals = flown("rudder")
    one = {name: signals[name] for name in ("time_s", "p", "r", "specific_force_y", "V")}
    both = {name: np.tile(column, 2) for name, column in one.items()}
    both["uav"] = np.repeat([1.0, 2.0], len(one["p"]))
    done = _run(str(_written(tmp_path / "two.csv", both)))
    assert "The rudder, or what is not judged, failed at" in done.stdout
    assert "it is of the" not in done.stdout  # nothing to choose from
    assert "of UAV 1; it has 2, too (--uav)" in done.stderr


@pytest.mark.parametrize("length_s", [0.4, 15.0])
def test_of_a_short_flight_nothing_is_claimed(length_s: float, tmp_path: Path) -> None:
    done = _run(str(_written(tmp_path / "short.csv", flown(None, length_s=length_s))))
    assert isinstance(done.exception, BadInput)
    assert "short.csv is too short" in str(done.exception)


def test_a_picture_that_cannot_be_written_is_no_fault_that_was_found(tmp_path: Path) -> None:
    full = tmp_path / "full.png"
    full.symlink_to("/dev/full")
    flight = _written(tmp_path / "flight.csv", flown(None, length_s=40.0))
    done = _run(str(flight), "--out", str(full))
    assert isinstance(done.exception, BadInput)  # status 2; 1 is of a fault
    assert str(done.exception) == f"cannot write {full}: No space left on device"


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (("--out", "evidence.txt"), "--out is evidence.txt, expected a name that ends in .png or"),
        (("--uav", "3"), "--uav is 3, and .*flight.csv does not say whose it is"),
    ],
)
def test_options_that_mean_nothing_are_refused(
    options: tuple[str, ...], problem: str, tmp_path: Path
) -> None:
    done = _run(str(_written(tmp_path / "flight.csv", flown(None, length_s=40.0))), *options)
    assert isinstance(done.exception, BadInput)
    assert re.search(problem, str(done.exception))
