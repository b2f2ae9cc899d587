"""Identification from logs, of flights whose aircraft is known."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from ftc_lab.commands.identify import identify
from ftc_lab.flight_signals import to_ned
from ftc_lab.identification.from_log import identify_log
from ftc_lab.identification.identified import Identified, verdict
from ftc_lab.identification.log_fit import moment_problem
from ftc_lab.identification.log_signals import log_signals
from ftc_lab.identification.output_error import (
    MOMENT_TERMS,
    SHIFTS,
    MomentModel,
    rates_predicted,
)
from ftc_lab.identification.segments import windows_of_log
from ftc_lab.identification.trim import motion_at
from gcs import fly
from gcs.console.errors import BadInput
from gcs.results.logs.read import read_flight
from gcs.results.logs.table import FlightTable, by_name, channel
from gcs.scenario.aircraft_file import load_aircraft
from mavlink_defs.constants import ACTUATORS
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.level_flight import level_flight
from sitl_plant.simulators.own import OwnSimulator

V = 24.0
RATE_HZ, DELAY_S, SERVO_LAG_S, PROBE_LATE_S = 50, 0.02, 0.04, 0.02
SHOWN = ("cl_beta", "cl_p", "cl_da", "cm_alpha", "cm_q", "cm_de", "cn_beta", "cn_dr", "cL_alpha")


def manoeuvres(seconds: float) -> Iterator[dict[str, float]]:
    """Steps of bank, pitch and airspeed at random times."""
    rng, now = np.random.default_rng(3), 0.0
    while now < seconds:
        yield {
            "start_s": round(now, 3),
            "airspeed_m_s": 24.0 + rng.uniform(-1.5, 1.5),
            "roll_deg": rng.uniform(-25.0, 25.0) if now else 0.0,
            "pitch_deg": 3.0 + rng.uniform(-3.0, 4.0),
            "yaw_deg": rng.uniform(-6.0, 6.0),
        }
        now += rng.uniform(1.0, 3.0)


@pytest.fixture(scope="module")
def aircraft() -> Aircraft:
    return load_aircraft("aerosonde")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 s of manoeuvres in calm air, by servos with a lag."""
    folder = tmp_path_factory.mktemp("flight") / "run"
    changes = {
        "duration_s": 40.0,
        "faults": [],
        "disturbance": None,
        "profile": list(manoeuvres(40.0)),
        "servos.surfaces": {"lag_s": 0.02, "rate_limit_deg_s": 400.0},
    }
    fly("airframes/aerosonde", changes, record="full", out=folder)
    return folder


@pytest.fixture(scope="module")
def recorded(run: Path) -> FlightTable:
    return read_flight(run)


def flown(aircraft: Aircraft, seconds: float = 80.0, gusts_m_s: float = 0.7) -> np.ndarray:
    """Fly by an autopilot of 50 Hz, whose commands servos follow late, in short gusts.

    Returns:
        At each of its steps time, velocity, attitude, rates, specific force, commands of aileron,
        elevator, rudder, thrust, and wind to north, east, down; shape (n, 20).
    """
    rng, simulator, step_s = np.random.default_rng(3), OwnSimulator(aircraft), 0.005
    level = level_flight(aircraft, V)
    assert level is not None
    alpha, trim = np.radians(level.alpha_deg), np.radians(level.elevator_deg)
    command = np.array([0.0, trim, 0.0, level.thrust_n])
    at, queue = command[:3].copy(), [command] * (1 + round(DELAY_S / step_s))
    wind, rows, next_s = np.zeros(3), [], 0.0
    bank, pitch, rudder = 0.0, alpha, 0.0
    simulator.reset(motion_at(V, float(alpha), altitude=300.0))
    for k in range(round(seconds / step_s)):
        share = V * step_s / 8.0  # of gusts of 8 m that has passed
        wind += gusts_m_s * np.sqrt(2.0 * share) * rng.standard_normal(3) - share * wind
        if k % round(1.0 / RATE_HZ / step_s) == 0:
            now = simulator.read()
            if k * step_s >= next_s:
                next_s += rng.uniform(1.5, 4.0)
                bank, rudder = rng.uniform(-0.6, 0.6), rng.uniform(-0.06, 0.06)
                pitch = alpha + rng.uniform(-0.1, 0.1)
            (roll, theta, _), (p, q, r) = now.attitude, now.rates
            moved = [-0.6 * (bank - roll) + 0.08 * p, -0.8 * (pitch - theta) + 0.15 * q]
            thrust = level.thrust_n * (1.0 + 0.15 * (V - np.linalg.norm(now.velocity)))
            command = np.array([moved[0], trim + moved[1], rudder + 0.15 * r, max(thrust, 0.0)])
            motion = (*now.velocity, *now.attitude, *now.rates, *now.specific_force)
            rows.append((k * step_s, *motion, *command, *wind))
        queue.append(command)
        sent = queue.pop(0)
        at += (1.0 - np.exp(-step_s / SERVO_LAG_S)) * (sent[:3] - at)
        simulator.control((float(at[0]), float(at[1]), float(at[2])), float(sent[3]))
        simulator.set_wind((float(wind[0]), float(wind[1]), float(wind[2])))
        simulator.advance(step_s)
    return np.array(rows)


def log_of(
    flight: np.ndarray, *, every: int = 1, probe: float = 1.0, without: tuple[str, ...] = ()
) -> FlightTable:
    """Return what an autopilot would have logged, with noise, and probes that are late.

    Args:
        flight: As of `flown`.
        every: Of so many steps one is logged.
        probe: Factor of the angle of attack.
        without: Channels that are missing.
    """
    rng, time_s = np.random.default_rng(1), flight[:, 0]
    ground, attitude, rates, force, commands, wind = np.split(flight[:, 1:], [3, 6, 9, 12, 16], 1)
    rotation = to_ned(attitude)
    air = ground - np.einsum("nij,ni->nj", rotation, wind)
    V_air = np.linalg.norm(air, axis=1)
    ned = np.einsum("nij,nj->ni", rotation, ground)
    angles = {
        "angle_of_attack": probe * np.arctan2(air[:, 2], air[:, 0]),
        "sideslip": np.arcsin(air[:, 1] / V_air),
    }
    signals = {name: (attitude[:, k], 3e-3) for k, name in enumerate(("roll", "pitch", "yaw"))}
    signals |= {name: (rates[:, k], 5e-3) for k, name in enumerate("pqr")}
    signals |= {f"specific_force_{axis}": (force[:, k], 0.15) for k, axis in enumerate("xyz")}
    signals |= {f"v_{name}": (ned[:, k], 0.05) for k, name in enumerate(("north", "east", "down"))}
    signals |= {"V": (V_air, 0.15)}
    signals |= {
        name: (np.interp(time_s - PROBE_LATE_S, time_s, angle), 3e-3)
        for name, angle in angles.items()
    }
    signals |= {f"held_{name}": (commands[:, k], 0.0) for k, name in enumerate(ACTUATORS)}
    return FlightTable(
        "a log",
        "csv",
        by_name(
            channel(name, time_s[::every], (of + size * rng.standard_normal(len(of)))[::every])
            for name, (of, size) in signals.items()
            if name not in without
        ),
    )


def wrong(aircraft: Aircraft, factor: float = 1.3) -> Aircraft:
    values = aircraft.coefficients.model_dump()
    update = {name: factor * value for name, value in values.items()}
    return aircraft.model_copy(
        update={"coefficients": aircraft.coefficients.model_copy(update=update)}
    )


@pytest.fixture(scope="module")
def flight(aircraft: Aircraft) -> np.ndarray:
    return flown(aircraft)


@pytest.fixture(scope="module")
def calm(aircraft: Aircraft) -> np.ndarray:
    return flown(aircraft, gusts_m_s=0.0)


@pytest.fixture(scope="module")
def identified(flight: np.ndarray, aircraft: Aircraft) -> Identified:
    return identify_log(log_of(flight), wrong(aircraft))


def test_a_recording_of_ours_shows_its_coefficients(
    recorded: FlightTable, aircraft: Aircraft
) -> None:
    found, known = identify_log(recorded, wrong(aircraft)), aircraft.coefficients.model_dump()
    for name in SHOWN:
        one = found.fit.estimates[name]
        assert not one.is_nominal, name
        assert one.value == pytest.approx(known[name], rel=0.03), name
    assert found.evidence is not None
    assert not found.evidence.shifts_s
    assert min(one.coefficient for one in found.evidence.predictions.values()) > 0.95


def test_a_noisy_log_at_50_hz_shows_them_within_its_intervals(
    identified: Identified, aircraft: Aircraft
) -> None:
    known = aircraft.coefficients.model_dump()
    for name in set(SHOWN) - {"cm_q"}:
        one = identified.fit.estimates[name]
        assert not one.is_nominal, name
        assert one.value == pytest.approx(known[name], rel=0.15), name
    found = {n: one for n, one in identified.fit.estimates.items() if not one.is_nominal}
    inside = [abs(one.value - known[name]) <= one.half_width for name, one in found.items()]
    assert np.mean(inside) >= 0.8, [n for n, good in zip(found, inside, strict=True) if not good]


def test_the_moment_of_the_thrust_is_not_taken_for_the_airs(
    flight: np.ndarray, aircraft: Aircraft
) -> None:
    """An aircraft whose thrust would turn it flew the same by another moment of the air."""
    tree = aircraft.model_dump() | {"propulsion": {"pitch_arm_m": 0.3}}
    turned = Aircraft.model_validate(tree)
    signals, plain = (log_signals(log_of(flight), one) for one in (turned, aircraft))
    windows, times = windows_of_log(plain), dict.fromkeys(("delay", "de", "cm"), 0.0)
    of_air, of_both = (
        moment_problem(one, windows.steps, "cm", times)[1] for one in (signals, plain)
    )
    qS = 0.5 * aircraft.air_density_kg_m3 * V**2 * aircraft.wing_area_m2
    of_thrust = 0.3 * float(np.mean(flight[:, 16])) / (qS * aircraft.mean_chord_m)
    assert np.mean(of_both - of_air) == pytest.approx(of_thrust, rel=0.1)
    model = MomentModel(dict.fromkeys(MOMENT_TERMS, 0.0), dict.fromkeys(SHIFTS, 0.0), np.ones(3))
    with_thrust, without = (rates_predicted(one, windows, model)[0] for one in (signals, plain))
    assert np.mean((with_thrust - without)[..., 1]) > 0.0


def test_of_a_long_log_the_windows_count_in_which_surfaces_move_most(
    flight: np.ndarray, aircraft: Aircraft
) -> None:
    times = 20  # of which four are lively
    long = np.concatenate([flight] * times)
    long[:, 0] = flight[0, 0] + np.arange(len(long)) / RATE_HZ
    calm = np.arange(len(long)) >= 4 * len(flight)
    trim = np.mean(flight[:, 13:16], axis=0)
    long[calm, 13:16] = trim + 0.25 * (long[calm, 13:16] - trim)
    signals = log_signals(log_of(long), aircraft)
    windows = windows_of_log(signals)
    assert len(windows.steps) == 320
    assert (np.diff(windows.steps[:, 0]) > 0).all()
    lively = windows.steps[:, 0] < 4 * len(flight)
    assert np.count_nonzero(lively) > 0.9 * 4 * len(
        windows_of_log(log_signals(log_of(flight), aircraft)).steps
    )


def test_the_lag_of_servos_and_of_the_log_is_found(identified: Identified) -> None:
    assert identified.evidence is not None
    shifts_s = identified.evidence.shifts_s
    for name in ("da", "de", "dr"):
        late_s = shifts_s["delay"] + shifts_s[name]
        assert late_s == pytest.approx(DELAY_S + SERVO_LAG_S, abs=0.01), name
    for axis in ("cL", "cY", "cl", "cm", "cn"):
        assert shifts_s[axis] == pytest.approx(-PROBE_LATE_S, abs=0.01), axis


def test_one_half_predicts_the_other(identified: Identified) -> None:
    assert identified.evidence is not None
    predictions = identified.evidence.predictions
    assert min(one.coefficient for axis, one in predictions.items() if axis in "cL cY") > 0.9
    assert min(one.rate for one in predictions.values() if one.rate is not None) > 0.9


def test_what_does_not_move_stays_nominal(flight: np.ndarray, aircraft: Aircraft) -> None:
    log = log_of(flight)
    still = replace(log["held_rudder"], values=np.zeros(len(log["held_rudder"].values)))
    found = identify_log(
        replace(log, channels={**log.channels, "held_rudder": still}), wrong(aircraft)
    )
    assert found.fit.estimates["cn_dr"].is_nominal
    assert found.fit.estimates["cn_dr"].value == 1.3 * aircraft.coefficients.cn_dr
    assert any("cn_dr" in line and "nominal" in line for line in verdict(found))


def test_a_probe_that_shows_too_much_widens_its_intervals(
    calm: np.ndarray, identified: Identified, aircraft: Aircraft
) -> None:
    found = identify_log(log_of(calm, probe=1.4), wrong(aircraft))
    assert found.evidence is not None
    assert any("angle of attack of the log may be" in line for line in found.evidence.remarks)
    one, known = found.fit.estimates["cL_alpha"], aircraft.coefficients.cL_alpha
    assert one.value == pytest.approx(known / 1.4, rel=0.1)
    assert abs(one.value - known) <= one.half_width
    assert one.half_width > 3.0 * identified.fit.estimates["cL_alpha"].half_width


def test_angles_come_from_velocities_where_there_are_no_vanes(
    calm: np.ndarray, aircraft: Aircraft
) -> None:
    log = log_of(calm, without=("angle_of_attack", "sideslip"))
    found, known = identify_log(log, wrong(aircraft)), aircraft.coefficients.model_dump()
    for name in ("cl_da", "cm_de", "cm_alpha", "cL_alpha"):
        assert found.fit.estimates[name].value == pytest.approx(known[name], rel=0.2), name
    assert found.evidence is not None
    assert any(line.startswith("no vanes") for line in found.evidence.remarks)


def held_still(log: FlightTable) -> FlightTable:
    still = {
        name: replace(one, values=np.full(len(one.values), 0.01))
        for name, one in log.channels.items()
        if name.startswith("held_")
    }
    return replace(log, channels={**log.channels, **still})


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("no rates", "a log has no q: moments are known by rates alone"),
        ("1 Hz", "p, q, r of a log are renewed 1 times a second, expected 8 or more"),
        ("no airspeed", "a log has no airspeed, and no wind"),
        ("no surfaces", "a log has no elevator: expected held_elevator"),
        ("no excitation", "only 0 s of flight have a surface that moves"),
        ("on the ground", "the log has no flight"),
    ],
)
def test_what_cannot_be_identified_from_is_refused_with_the_reason(
    kind: str, reason: str, flight: np.ndarray, aircraft: Aircraft
) -> None:
    log = log_of(flight)
    match kind:
        case "no rates":
            log = log_of(flight, without=("q",))
        case "1 Hz":
            log = log_of(flight, every=RATE_HZ)
        case "no airspeed":
            log = log_of(flight, without=("V",))
        case "no surfaces":
            log = log_of(flight, without=("held_elevator",))
        case "no excitation":
            log = held_still(log)
        case _:
            slow = replace(log["V"], values=0.1 * log["V"].values)
            log = replace(log, channels={**log.channels, "V": slow})
    with pytest.raises(BadInput, match=reason):
        identify_log(log, aircraft)


def test_the_command_takes_a_flight_where_it_takes_a_plant(run: Path, tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(identify)
    out = tmp_path / "better.yaml"
    arguments = [str(run), "--aircraft", "aerosonde", "-o", str(out), "-q", "--json"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["evidence"]["segments"][0]["moved_deg"][0] > 0.1
    assert out.read_text().startswith("# Written by: gcs identify run --aircraft aerosonde")
