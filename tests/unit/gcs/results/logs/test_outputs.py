"""Pulses of outputs as shares of surfaces, by what the autopilot's parameters say."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from dataflash_writer import DataflashWriter

from gcs.console.errors import BadInput
from gcs.results.logs.outputs import with_shares
from gcs.results.logs.read import read_flight
from gcs.results.logs.table import FlightTable, by_name, channel

TIME_S = np.arange(50) / 25.0
DEMANDS = {
    "aileron": 0.6 * np.sin(TIME_S),
    "elevator": 0.3 * np.cos(2.0 * TIME_S),
    "rudder": -0.2 * np.sin(3.0 * TIME_S),
    "throttle": 0.5 + 0.4 * np.sin(TIME_S),
}
ENDS = {"MIN": 1000.0, "TRIM": 1520.0, "MAX": 1900.0}


def servos(functions: list[int], turned: set[int]) -> dict[str, float]:
    """Parameters of ArduPilot."""
    said = {f"SERVO{k}_{name}": at for k in range(1, 9) for name, at in ENDS.items()}
    said |= {f"SERVO{k}_FUNCTION": float(one) for k, one in enumerate(functions, start=1)}
    return said | {f"SERVO{k}_REVERSED": float(k in turned) for k in range(1, 9)}


def pulse(share: np.ndarray, *, turned: bool, is_range: bool = False) -> np.ndarray:
    """As ArduPilot's SRV_Channel makes it."""
    low, trim, high = ENDS.values()
    if is_range:
        return low + (1.0 - share if turned else share) * (high - low)
    share = -share if turned else share
    return np.where(share > 0.0, trim + share * (high - trim), trim + share * (trim - low))


def log_of(values: Mapping[str, np.ndarray], parameters: Mapping[str, float]) -> FlightTable:
    channels = by_name(channel(name, TIME_S, of) for name, of in values.items())
    return FlightTable("a log", "bin", channels, parameters=parameters)


def test_each_surface_of_ardupilot_is_by_its_function() -> None:
    a, e, r, t = DEMANDS.values()
    outputs = {
        "output_1": pulse(a, turned=True),
        "output_2": pulse(e, turned=False),
        "output_3": pulse(t, turned=True, is_range=True),
        "output_4": pulse(r, turned=False),
        "output_5": pulse(a, turned=False),
    }
    found = with_shares(log_of(outputs, servos([4, 19, 70, 21, 4], {1, 3})))
    for name, demand in DEMANDS.items():
        assert found[f"share_{name}"].values == pytest.approx(demand), name
    assert any(
        one == "share_aileron is of output_1 (SERVO1_FUNCTION 4) and output_5 (SERVO5_FUNCTION 4)"
        for one in found.remarks
    )


@pytest.mark.parametrize("functions", [[77, 78, 21, 70], [4, 79, 80, 70]])
def test_elevons_and_v_tails_are_taken_apart(functions: list[int]) -> None:
    a, e, r, t = DEMANDS.values()
    halves = {77: e - a, 78: e + a, 79: e + r, 80: e - r}
    made = {4: a, 21: r, **{one: 0.5 * both for one, both in halves.items()}}
    outputs = {
        f"output_{k}": pulse(t if one == 70 else made[one], turned=k == 2, is_range=one == 70)
        for k, one in enumerate(functions, start=1)
    }
    found = with_shares(log_of(outputs, servos(functions, {2})))
    for name, demand in DEMANDS.items():
        assert found[f"share_{name}"].values == pytest.approx(demand), name
    alone = with_shares(log_of(outputs, servos([0, *functions[1:]], {2})))
    assert "share_elevator" not in alone or 79 in functions  # of one half only


@pytest.mark.parametrize("by_pulses", [True, False])
def test_surfaces_of_px4_are_by_control_allocation(by_pulses: bool) -> None:
    a, e, r, t = DEMANDS.values()
    torques = [(-0.5, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    said = {
        f"CA_SV_CS{k}_TRQ_{n}": x
        for k, of in enumerate(torques)
        for n, x in zip("RPY", of, strict=True)
    }
    said |= {"CA_SV_CS2_TRIM": 0.1, "CA_ROTOR_COUNT": 1.0, "PWM_MAIN_REV": 0b10}
    said |= {f"PWM_MAIN_FUNC{k}": at for k, at in enumerate((201, 202, 101, 203, 204), start=1)}
    said |= {f"PWM_MAIN_MIN{k}": 1100.0 for k in range(1, 6)}
    values = {"servo_1": -a, "servo_2": a, "servo_3": e + 0.1, "servo_4": r, "motor_1": t}
    if by_pulses:
        turned = {2: -1.0}
        outputs = {1: -a, 2: a, 3: 2.0 * t - 1.0, 4: e + 0.1, 5: r}
        values = {
            f"output_{k}": 1550.0 + 450.0 * turned.get(k, 1.0) * of for k, of in outputs.items()
        }
    found = with_shares(log_of(values, said))
    for name, demand in DEMANDS.items():
        assert found[f"share_{name}"].values == pytest.approx(demand), name


def test_what_no_parameter_says_is_told_and_what_the_log_has_is_kept() -> None:
    values = {"output_1": 1500.0 + TIME_S, "output_2": 1500.0 + TIME_S, "share_aileron": TIME_S}
    found = with_shares(log_of(values, servos([4, 33], set())))
    assert found["share_aileron"].values == pytest.approx(TIME_S)
    assert [one for one in found.channels if one.startswith("share_")] == ["share_aileron"]
    assert found.remarks == (
        "no parameter of the log says which output moves what of share_elevator, share_rudder, "
        "share_throttle (left: output_2): a column map can (--columns)",
    )


def test_a_column_map_says_it_where_the_log_does_not(tmp_path: Path) -> None:
    log = DataflashWriter()
    log.define("RCOU", "QHH", "TimeUS,C1,C2")
    for k in range(20):
        log.add("RCOU", 5_000_000 + 40_000 * k, 1500 + k, 1700)
    path, own = log.save(tmp_path / "a.bin"), tmp_path / "own.yaml"
    own.write_text(
        "time: {column: time_s}\n"
        "channels: {share_elevator: {column: output_1, scale: 0.0025, sign: -1, offset: 3.75}}\n"
    )
    found = read_flight(path, columns=own)
    assert found["share_elevator"].values == pytest.approx(-0.0025 * np.arange(20))
    assert any("share_throttle (left: output_2)" in one for one in found.remarks)
    own.write_text("time: {column: time_s}\nchannels: {share_elevator: {column: output_9}}\n")
    with pytest.raises(BadInput, match="has no output_9"):
        read_flight(path, columns=own)
