"""Stops of each surface: on the wire, in the plant, in a law's step, and in files."""

import math
from typing import Any

import numpy as np
import pytest
from courses import Pilot, motion_at
from hypothesis import given
from hypothesis import strategies as st
from plain_faults import actuator_fault, add_fault

from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.triggers.static import Consequence, PerChannel
from gcs.scenario.model import Scenario
from mavlink_defs.config.files import problems_of
from mavlink_defs.constants import ELEVATOR, N_CHANNELS, RUDDER, SURFACES, THROTTLE
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS, BIAS, STUCK
from mavlink_defs.faults.command import InvalidParam, fault_from_params
from mavlink_defs.faults.table import no_faults
from mavlink_defs.framing.codec import ACTUATORS
from sitl_plant.actuators.faults import apply_faults
from sitl_plant.airframe.aircraft import AIRCRAFT, aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.stops import position_of, range_of, share_of
from sitl_plant.loop.fleet import new_plant_state, receive_controls

angle = st.floats(1.0, 89.0)
stops = st.tuples(angle.map(lambda x: -x), angle)
three = st.tuples(stops, stops, stops)
NAN = math.nan
UNEVEN = {"aileron": [-20.0, 15.0], "elevator": [-25.0, 20.0], "rudder": 30.0}


def with_stops(scenario: Scenario, limits: Any) -> Aircraft:
    return Aircraft.model_validate(scenario.aircraft.model_dump() | {"surface_limits_deg": limits})


def record_with(one: tuple[tuple[float, float], ...]) -> np.void:
    record: np.void = np.zeros(1, AIRCRAFT)[0]
    record["stops"], record["thrust_limit"] = one, 100.0
    return record


@given(stops, st.floats(-2.0, 2.0))
def test_a_share_comes_back_as_the_position(stops: tuple[float, float], share: float) -> None:
    """Within the rounding of a float32; and what is beyond a stop is the stop."""
    low, high = stops
    position = share * (high if share > 0.0 else -low)
    sent = share_of(position, low, high)
    assert -1.0 <= sent <= 1.0
    within = min(max(position, low), high)
    assert position_of(float(sent), low, high) == pytest.approx(within, rel=2.0**-23)
    assert share_of(position_of(float(sent), low, high), low, high) == sent


@given(stops)
def test_the_stops_are_the_ends_of_the_wires_range(stops: tuple[float, float]) -> None:
    low, high = stops
    assert [share_of(x, low, high) for x in (low, 0.0, high)] == [-1.0, 0.0, 1.0]
    assert (position_of(-1.0, low, high), position_of(1.0, low, high)) == (low, high)


def test_a_surface_that_is_not_there_stays_at_zero() -> None:
    assert share_of(0.3, 0.0, 0.0) == 0.0
    assert position_of(1.0, 0.0, 0.0) == position_of(-1.0, 0.0, 0.0) == 0.0


command = st.floats(-1.0, 1.0, width=32)
bias = st.tuples(st.integers(0, 2), st.floats(0.0, 1.0), st.floats(-90.0, 90.0))


@given(three, st.tuples(command, command, command), bias)
def test_no_command_and_no_fault_moves_a_surface_beyond_its_stops(
    scenario1: Scenario,
    degrees: tuple[tuple[float, float], ...],
    controls: tuple[float, float, float],
    fault: tuple[int, float, float],
) -> None:
    limits = dict(zip(SURFACES, degrees, strict=True))
    aircraft = with_stops(scenario1, limits)
    fleet = new_plant_state(scenario1.model_copy(update={"aircraft": aircraft}).plant_config())
    message = np.zeros(1, ACTUATORS)[0]
    message["controls"][:THROTTLE] = controls
    assert receive_controls(fleet, 0, message) == 0
    radians = np.radians(degrees)
    held = fleet.uavs[0]["controls"][:THROTTLE]
    assert ((radians[:, 0] <= held) & (held <= radians[:, 1])).all()
    expected = [
        c * (high if c > 0.0 else -low) for c, (low, high) in zip(controls, radians, strict=True)
    ]
    assert held == pytest.approx(expected, rel=1e-7)
    row = no_faults(ACTUATOR_FAULTS, 1)[0]
    add_fault(row, actuator_fault(fault[0], fault[1], fault[2], 0.0, 0.0, NAN, BIAS.code), 0.0)
    applied = apply_faults((*held.tolist(), 0.0), 1.0, 1.0, row, fleet.uavs[0]["aircraft"])[
        :THROTTLE
    ]
    moved = held.copy()
    moved[fault[0]] = fault[1] * held[fault[0]] + math.radians(fault[2])
    assert applied == pytest.approx(np.clip(moved, *radians.T))


@pytest.mark.parametrize("name", LAWS)
def test_no_law_sends_beyond_uneven_stops(name: str, scenario1: Scenario) -> None:
    """A motion that no aircraft would fly drives every law to its stops; shares go both ways."""
    aircraft = with_stops(scenario1, {"aileron": [-2.0, 1.0], "elevator": [-1.0, 3.0], "rudder": 2})
    trigger = Consequence() if LAWS[name].SELECTS_CHANNELS else PerChannel()
    pilot = Pilot(LAWS[name](kind=name), trigger, aircraft, 0.004)
    low, high = np.radians(aircraft.stops_deg).T
    shares = set()
    for k in range(150):
        pilot.step(motion_at(k * pilot.dt, pilot.nominal), (43.0, 0.2, 0.05, 3.1))
        held = pilot.state["held"][:THROTTLE]
        assert ((low <= held) & (held <= high)).all()
        controls = pilot.actuators["controls"][:THROTTLE]
        for c in range(THROTTLE):
            assert held[c] == position_of(controls[c], *range_of(pilot.nominal, c))
            shares.add((c, float(controls[c])))
    assert len({c for c, share in shares if abs(share) == 1.0}) >= 2


def test_each_surface_has_the_stops_of_the_file(scenario1: Scenario) -> None:
    aircraft = with_stops(scenario1, UNEVEN)
    assert aircraft.stops_deg == ((-20.0, 15.0), (-25.0, 20.0), (-30.0, 30.0))
    expected = np.radians(aircraft.stops_deg)
    assert (aircraft_record(aircraft)["stops"] == expected).all()
    only_one = with_stops(scenario1, {"elevator": [-25.0, 20.0]})
    assert only_one.stops_deg == ((-35.0, 35.0), (-25.0, 20.0), (-35.0, 35.0))


def test_what_a_missing_surface_would_do_counts_as_nothing(scenario1: Scenario) -> None:
    """So that an aircraft that extends another one need not say so of each derivative."""
    aircraft = with_stops(scenario1, {"rudder": "none"})
    assert [aircraft.has(name) for name in SURFACES] == [True, True, False]
    record = aircraft_record(aircraft)
    assert [record[name] for name in ("cl_dr", "cn_dr", "cY_dr")] == [0.0, 0.0, 0.0]
    assert record["cl_da"] == scenario1.aircraft.coefficients.cl_da
    without = with_stops(scenario1, {"elevator": "none"})
    tree = without.model_dump()
    tree["coefficients"] |= {"cL_de": 1.0, "cD_de": 1.0, "cD_de2": 1.0}
    record = aircraft_record(Aircraft.model_validate(tree))
    assert not any(record[name] for name in ("cm_de", "cL_de", "cD_de", "cD_de2"))
    assert record["cD_beta2"] == without.coefficients.cD_beta2


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"rudder": [20, 30]}, "rudder: expected a negative and a positive angle [deg]"),
        ({"rudder": [-20]}, "rudder[1]: missing"),
        ({"rudder": [-95, 30]}, "rudder[0]: expected (-90, 90) deg, got -95"),
        ({"rudder": 0}, "rudder: expected (0, 90) deg, got 0"),
        ({"rudder": "no"}, "rudder: expected a number in deg or a list or 'none', got 'no'"),
        ({"rudders": 20}, "rudders: unknown key; did you mean 'rudder'?"),
    ],
)
def test_stops_that_cannot_be_are_named(scenario1: Scenario, limits: Any, said: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - pydantic's, its text is checked
        with_stops(scenario1, limits)
    (line,) = problems_of(Aircraft, caught.value)  # type: ignore[arg-type]  # it is pydantic's
    assert f"surface_limits_deg.{said}" in str(line)


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({}, "missing; expected the stop of all surfaces [deg]"),
        ({"aileron": 20, "elevator": [-25, 20]}, "or the stops of rudder in surface_limits_deg"),
    ],
)
def test_a_surface_without_stops_is_named(scenario1: Scenario, limits: Any, said: str) -> None:
    tree = scenario1.aircraft.model_dump() | {"surface_limits_deg": limits}
    del tree["surface_limit_deg"]
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - pydantic's, its text is checked
        Aircraft.model_validate(tree)
    (line,) = problems_of(Aircraft, caught.value)  # type: ignore[arg-type]  # it is pydantic's
    assert str(line).startswith("surface_limit_deg: ")
    assert said in str(line)


@pytest.mark.parametrize("cruise", [19.9, 80.1])
def test_cruise_is_among_the_airspeeds(scenario1: Scenario, cruise: float) -> None:
    with pytest.raises(ValueError, match=r"expected \[20, 80\] m/s, the aircraft's limits, got"):
        Aircraft.model_validate(scenario1.aircraft.model_dump() | {"cruise_m_s": cruise})


@given(three, st.sampled_from([STUCK, BIAS]), st.floats(-90.0, 90.0, width=32))
def test_a_fault_must_be_within_the_stops_of_its_surface(
    scenario1: Scenario, degrees: tuple[tuple[float, float], ...], kind: Any, value: float
) -> None:
    limits = with_stops(scenario1, dict(zip(SURFACES, degrees, strict=True))).fault_limits
    params = (ELEVATOR, 0.0 if kind is STUCK else 1.0, value, 0.0, NAN, NAN, kind.code)
    low, high = degrees[ELEVATOR]
    if low <= value <= high:
        assert fault_from_params(ACTUATOR_FAULTS, params, limits).value == pytest.approx(value)
    elif not low * (1.0 + 1e-5) <= value <= high * (1.0 + 1e-5):
        with pytest.raises(InvalidParam, match=f"must be {low:g} to {high:g} deg"):
            fault_from_params(ACTUATOR_FAULTS, params, limits)


def test_a_surface_that_is_not_there_cannot_fail(scenario1: Scenario) -> None:
    aircraft = with_stops(scenario1, {"rudder": "none"})
    params = (RUDDER, 0.5, 0.0, 0.0, NAN, NAN, 0.0)
    with pytest.raises(InvalidParam, match=r"^Fault: the aircraft has no rudder$"):
        fault_from_params(ACTUATOR_FAULTS, params, aircraft.fault_limits)
    assert (
        fault_from_params(
            ACTUATOR_FAULTS, (ELEVATOR, *params[1:]), aircraft.fault_limits
        ).effectiveness
        == 0.5
    )
    assert len(aircraft.fault_limits.surfaces_deg) + 1 == N_CHANNELS
