"""The estimator over logs, of a flight whose motion is known."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from ftc_lab.commands.estimate import estimate
from ftc_lab.flight_estimation.estimated import FlightEstimate, estimate_flight
from ftc_lab.flight_signals import to_ned
from gcs.console.errors import BadInput
from gcs.results.logs.table import FlightTable, by_name, channel
from mavlink_defs.origin import Origin, degrees_at
from sitl_plant.sensing.geomagnetism import magnetic_field
from sitl_plant.sensing.standard_air import pressure_at

RATE_HZ, SECONDS, V, G = 50.0, 150.0, 20.0, 9.81
LATE_S = 0.3
WIND = np.array([3.0, -2.0, 0.0])
ORIGIN = Origin(latitude_deg=45.0, longitude_deg=-93.0, altitude_m=300.0)


def _means(values: np.ndarray) -> np.ndarray:
    return np.asarray(0.5 * (values[1:] + values[:-1]))


@pytest.fixture(scope="module")
def flight() -> FlightTable:
    """Coordinated turns in a steady wind; a receiver of 5 Hz, 0.3 s late; a compass with iron."""
    rng, t = np.random.default_rng(1), np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    yaw_rate = 0.25 * np.sin(2.0 * np.pi * t / 14.0) + 0.1
    yaw = np.concatenate([[0.0], np.cumsum(_means(yaw_rate)) / RATE_HZ])
    roll, pitch = np.arctan(V * yaw_rate / G), np.full(len(t), 0.05)
    roll_rate = np.gradient(roll, t)
    rates = np.stack(
        [
            roll_rate - yaw_rate * np.sin(pitch),
            yaw_rate * np.sin(roll) * np.cos(pitch),
            yaw_rate * np.cos(roll) * np.cos(pitch),
        ]
    )
    ned = V * np.stack([np.cos(yaw), np.sin(yaw), 0.0 * t]) + WIND[:, None]
    rotation = to_ned(np.stack([roll, pitch, yaw], axis=1))
    acceleration = np.gradient(ned, t, axis=1) - np.array([[0.0], [0.0], [G]])
    force = np.einsum("nij,in->jn", rotation, acceleration)
    place = np.concatenate(
        [np.zeros((3, 1)), np.cumsum(0.5 * (ned[:, 1:] + ned[:, :-1]), 1) / RATE_HZ], 1
    )
    field = np.einsum("nij,i->jn", rotation, magnetic_field(ORIGIN)) / 0.9
    field += np.array([[0.2], [-0.1], [0.15]])
    signals = dict(zip("pqr", rates + 3e-3 * rng.standard_normal(rates.shape), strict=True))
    noisy = force + 0.05 * rng.standard_normal(force.shape)
    signals |= {f"specific_force_{axis}": one for axis, one in zip("xyz", noisy, strict=True)}
    signals |= {f"magnetic_{axis}": one for axis, one in zip("xyz", field, strict=True)}
    signals |= {"roll": roll, "pitch": pitch, "yaw": yaw}
    signals |= {"wind_north": 0.0 * t + WIND[0], "wind_east": 0.0 * t + WIND[1]}
    pressure = 100.0 * pressure_at(ORIGIN.altitude_m) + rng.standard_normal(len(t))
    ahead = V * np.cos(pitch)
    signals |= {
        "static_pressure": pressure,
        "dynamic_pressure": 0.5 * 1.2682 * ahead**2 + rng.standard_normal(len(t)),
        "indicated_airspeed": np.sqrt(1.2682 / 1.225) * ahead,
    }
    fixes = t[::10]
    then = [np.interp(fixes - LATE_S, t, one) for one in (*place, *ned)]
    degrees = [
        degrees_at(n, e, ORIGIN.latitude_deg, ORIGIN.longitude_deg)
        for n, e in zip(*then[:2], strict=True)
    ]
    received = {
        "gnss_latitude": np.array([one for one, _ in degrees]),
        "gnss_longitude": np.array([one for _, one in degrees]),
        "gnss_altitude": ORIGIN.altitude_m - then[2] + 0.3 * rng.standard_normal(len(fixes)),
    }
    received |= {
        f"gnss_v_{name}": one + 0.05 * rng.standard_normal(len(fixes))
        for name, one in zip(("north", "east", "down"), then[3:], strict=True)
    }
    made = [channel(name, t, np.asarray(one)) for name, one in signals.items()]
    made += [channel(name, fixes, one) for name, one in received.items()]
    return FlightTable("turns", "csv", by_name(made))


@pytest.fixture(scope="module")
def found(flight: FlightTable) -> FlightEstimate:
    return estimate_flight(flight)


def test_iron_is_found_and_the_angles_are_right(found: FlightEstimate) -> None:
    judged = found.judged
    for name, most in (("roll", 1.0), ("pitch", 1.0), ("yaw", 1.5), ("wind_north", 1.0)):
        assert judged.errors[name].most_95 < most
    assert judged.agrees
    assert not judged.exclusions
    assert any("0.200, -0.100, 0.150 gauss" in one for one in found.remarks)
    assert 0.01 < judged.nis["GNSS velocity"].mean < 2.1


@pytest.mark.parametrize("taken_s", [0.0, LATE_S, 0.6])
def test_a_latency_is_learnt_and_costs_no_angle(flight: FlightTable, taken_s: float) -> None:
    found = estimate_flight(flight, latency_s=taken_s)
    assert found.latency_s == taken_s
    assert found.learnt_s == pytest.approx(LATE_S, abs=0.02)
    assert 0.0 < found.learnt_std_s < 0.02
    for name in ("roll", "pitch", "yaw"):
        assert found.judged.errors[name].most_95 < 1.5
    assert not found.judged.resets


def test_a_tube_that_is_blocked_is_excluded_from_then_on(flight: FlightTable) -> None:
    tube = flight["dynamic_pressure"]
    blocked = replace(
        tube, values=np.where(tube.time_s > 100.0, 20.0 + 1e-3 * tube.values, tube.values)
    )
    found = estimate_flight(
        replace(flight, channels={**flight.channels, "dynamic_pressure": blocked})
    )
    out = next(one for one in found.judged.exclusions if one.sensor == "pitot tube")
    assert 100.0 < out.from_s < 103.0
    assert out.reason == "inconsistent"
    assert found.judged.errors["roll"].most_95 < 1.5


def test_a_solution_that_the_sensors_do_not_make_is_said(flight: FlightTable) -> None:
    wrong = replace(flight["roll"], values=flight["roll"].values + 0.2)
    found = estimate_flight(replace(flight, channels={**flight.channels, "roll": wrong}))
    assert found.judged.errors["roll"].median == pytest.approx(np.degrees(0.2), abs=1.0)
    assert not found.judged.agrees


@pytest.mark.parametrize(
    ("without", "text"),
    [
        (("gnss_v_north",), "has no gnss_v_north: an estimate needs the IMU and GNSS"),
        (("p", "q", "r"), "has no p, q, r"),
    ],
)
def test_what_is_missing_is_named(flight: FlightTable, without: tuple[str, ...], text: str) -> None:
    kept = {name: one for name, one in flight.channels.items() if name not in without}
    with pytest.raises(BadInput, match=text):
        estimate_flight(replace(flight, channels=kept))


def test_without_what_can_be_done_without(flight: FlightTable) -> None:
    gone = {"magnetic_x", "static_pressure", "dynamic_pressure", "indicated_airspeed"}
    gone |= {"roll", "pitch", "yaw", "wind_north", "wind_east", "gnss_v_down"}
    kept = {name: one for name, one in flight.channels.items() if name not in gone}
    found = estimate_flight(replace(flight, channels=kept))
    for text in ("no barometer", "no airspeed", "no magnetometer", "no vertical velocity"):
        assert any(text in one for one in found.remarks)
    assert not found.judged.errors
    assert found.judged.agrees


def test_the_command_says_it_as_json_and_by_its_status(flight: FlightTable, tmp_path: Path) -> None:
    path, picture = tmp_path / "flight.csv", tmp_path / "errors.png"
    t = flight["p"].time_s
    columns = {"time_s": t}
    for name, one in flight.channels.items():  # a table repeats a fix until the next one
        columns[name] = one.values[np.searchsorted(one.time_s, t + 1e-6) - 1]
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, "%.9g", ",", header=",".join(columns), comments="")
    app = typer.Typer()
    app.command()(estimate)
    done = CliRunner().invoke(app, [str(path), "--json", "--compass", "raw", "--out", str(picture)])
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert said["errors"]["pitch"]["most_95"] < 1.5
    assert picture.stat().st_size > 10_000
