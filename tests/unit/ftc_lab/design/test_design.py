"""Designs: of the paper's aircraft the defaults, of a similar one the same flight."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.laws import KINDS, LAWS
from ftc_autopilot.control.laws.tube import Tube
from ftc_autopilot.control.triggers import TRIGGERS
from ftc_autopilot.guidance.aircraft_limits import HOME
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_lab.design.airframe import Airframe, airframe_of
from ftc_lab.design.parameters import parameters_of
from ftc_lab.design.rules import Conditions, Rules
from ftc_lab.design.scenario import design_of, plain, sections_of, steps_deg, text_of, tree_of
from ftc_lab.design.similarity import dimensions, similarity
from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import summarise
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import load_scenario, scenario_of
from sitl_plant.airframe.config import Aircraft

REAL = Conditions(servo_lag_s=0.02, servo_rate_deg_s=400.0, gyro_noise_deg_s=0.3)
TIME, VELOCITY, MASS = 2.0, 1.5, 5.0


def paper() -> Airframe:
    return airframe_of("paper", load_aircraft("paper"))


def similar_to(aircraft: Aircraft) -> Aircraft:
    """Return the same aircraft in other units of time, velocity and mass."""
    length = TIME * VELOCITY
    inertia = {
        name: J * MASS * length**2 for name, J in aircraft.inertia_kg_m2.model_dump().items()
    }
    changed: dict[str, Any] = {
        "mass_kg": aircraft.mass_kg * MASS,
        "wing_area_m2": aircraft.wing_area_m2 * length**2,
        "wing_span_m": aircraft.wing_span_m * length,
        "mean_chord_m": aircraft.mean_chord_m * length,
        "air_density_kg_m3": aircraft.air_density_kg_m3 * MASS / length**3,
        "gravity_m_s2": aircraft.gravity_m_s2 * VELOCITY / TIME,
        "inertia_kg_m2": inertia,
        "thrust_limit_n": aircraft.thrust_limit_n * MASS * VELOCITY / TIME,
        "airspeed_min_m_s": aircraft.airspeed_min_m_s * VELOCITY,
        "airspeed_max_m_s": aircraft.airspeed_max_m_s * VELOCITY,
        "cruise_m_s": 45.0 * VELOCITY,
        "gear": None,  # nothing here touches the ground
    }
    return Aircraft.model_validate(aircraft.model_dump() | changed)


@pytest.mark.parametrize("law", KINDS)
def test_the_paper_s_aircraft_gets_the_defaults(law: str) -> None:
    sections = sections_of(design_of(paper(), law, Conditions()))
    assert LAWS[law].model_validate(plain(sections.controller)) == LAWS[law](kind=law)
    trigger = plain(sections.trigger)
    mode = TRIGGERS[trigger["mode"]]
    assert mode.model_validate(trigger) == mode(mode=trigger["mode"])
    assert plain(sections.guidance) == PathFollowing(**HOME._asdict()).model_dump()


@pytest.mark.parametrize("mode", TRIGGERS)
def test_every_trigger_has_its_defaults_there(mode: str) -> None:
    model = TRIGGERS[mode]
    rules = Rules(paper(), similarity(paper()), Conditions())
    default = model(mode=mode)
    made = plain(parameters_of(default, rules.similar, rules.rule_of))
    assert model.model_validate(made) == default


@pytest.mark.parametrize("law", KINDS)
def test_every_number_of_a_similar_aircraft_is_the_default_in_its_units(law: str) -> None:
    """Independent of the rules: what they do must be what the declared unit says, or a hidden one.

    Of a similar aircraft stops, authority, damping and thrust are all in proportion, so that rules
    and units agree, but for limits and for what belongs to the place.
    """
    airframe = airframe_of("similar", similar_to(load_aircraft("paper")))
    similar = similarity(airframe)
    assert similar.time == TIME
    assert (similar.velocity, similar.mass) == pytest.approx((VELOCITY, MASS))
    assert similar.axes == pytest.approx((TIME, TIME, TIME))
    made = plain(sections_of(design_of(airframe, law, Conditions())).controller)
    home = plain(sections_of(design_of(paper(), law, Conditions())).controller)
    powers = {"K1": -1, "K2": -1, "c_v": -1, "rate_limit_deg_s": -1, "tau_omega_d_s": 1}
    powers |= {"rate_p": 1, "rate_i": 0, "rate_ff": 1, "check_s": 1, "adaptation_prior": -3}
    for name in powers.keys() & made.keys():
        pairs = zip(numbers_of(made[name]), numbers_of(home[name]), strict=True)
        for new, old in pairs:
            assert new / old == pytest.approx(TIME ** powers[name], rel=1e-3), name


def numbers_of(value: Any) -> list[float]:
    if isinstance(value, list):
        return [x for part in value for x in numbers_of(part)]
    return numbers_of(value["value"]) if isinstance(value, dict) else [float(value)]


@pytest.mark.parametrize(
    ("law", "stuck"),
    [
        *(("backstepping", None), ("pid", None), ("proposed", None)),
        *(("surviving", None), ("surviving", "aileron"), ("surviving", "elevator")),
        *(("tube", None), ("tube", "rudder")),
    ],
)
def test_a_similar_aircraft_flies_the_same_flight(law: str, stuck: str | None) -> None:
    """In its own units: as many events, the same errors, losses found at the same time.

    Whatever number in the code has no key, or a wrong unit, makes a difference.
    """
    flights = []
    for airframe, time in (
        (paper(), 1.0),
        (airframe_of("similar", similar_to(load_aircraft("paper"))), TIME),
    ):
        design = design_of(airframe, law, Conditions(step_us=round(1000 * time)))
        tree = plain(tree_of(design))
        tree["aircraft"] = airframe.aircraft.model_dump(exclude_none=True)
        if stuck is not None:
            # with a rudder at 0° it turns round and round, and the last digit decides
            stuck_deg = 14.0 if stuck == "rudder" else 0.0
            fault = {"uav": 1, "actuator": stuck, "stuck_deg": stuck_deg, "start_s": 10.0 * time}
            tree["faults"] = [fault]
        scenario = scenario_of("x", tree)
        recording = fly_in_process(scenario)
        largest = np.abs(recording.error("reference")[1000:, 0]).max(axis=0)
        uav = summarise(recording, scenario).uavs[0]
        lost = [(one.actuator, one.phase, round(one.time_s / time, 3)) for one in uav.diagnosis]
        flights.append((uav.events, largest, lost))
    (events, error, lost), (found, other, lost_there) = flights
    assert found == pytest.approx(events, rel=0.03)
    units = np.array([VELOCITY, 1.0, 1.0, 1.0])
    assert other == pytest.approx(error * units, rel=0.04, abs=5e-3)
    assert lost_there == lost
    assert bool(lost) == (stuck is not None)


@pytest.mark.parametrize("law", ["surviving", "tube"])
def test_the_text_is_a_scenario_each_line_of_which_says_why(law: str, tmp_path: Path) -> None:
    airframe = airframe_of("aerosonde", load_aircraft("aerosonde"))
    design = design_of(airframe, law, REAL, uavs=3)
    text = text_of(design, "gcs design aerosonde")
    assert text == text_of(design, "gcs design aerosonde")
    (tmp_path / "a.yaml").write_text(text)
    scenario = load_scenario(tmp_path / "a.yaml")
    assert scenario == scenario_of("x", plain(tree_of(design)))
    assert len(scenario.uavs) == 3
    begin, end = text.index("controller:"), text.index("uavs:")
    bare = [line for line in text[begin:end].splitlines() if ": " in line and "#" not in line]
    assert [line for line in bare if "value:" not in line] == []


def test_what_is_given_limits_the_gains() -> None:
    airframe = airframe_of("aerosonde", load_aircraft("aerosonde"))

    def gains(**given: float) -> dict[str, Any]:
        return plain(sections_of(design_of(airframe, "surviving", Conditions(**given))).controller)  # type: ignore[arg-type]  # names of numbers only

    free, slow = gains(), gains(servo_lag_s=0.1)
    assert slow["K2"] == pytest.approx([5.0, 5.0, 5.0])
    for k in range(3):
        assert slow["K1"][k] / free["K1"][k] == pytest.approx(
            slow["K2"][k] / free["K2"][k], rel=1e-3
        )
    assert gains(engine_lag_s=1.1)["c_v"] == pytest.approx(0.3 / 1.1, rel=1e-3)
    assert gains(gyro_delay_s=0.012)["delay_s"] == 0.012


@given(st.floats(0.0, 5.0))
def test_a_filter_leaves_no_more_noise_than_the_trigger_overlooks(noise: float) -> None:
    airframe = airframe_of("aerosonde", load_aircraft("aerosonde"))
    design = design_of(airframe, "surviving", Conditions(gyro_noise_deg_s=noise))
    sections = sections_of(design)
    law, b2 = plain(sections.controller), plain(sections.trigger)["b2_deg"]
    tau = law["gyro_filter_s"]
    share = 1.0 if tau == 0.0 else min(math.sqrt(0.001 / (2.0 * tau)), 1.0)
    left = max(k * noise * share / M for k, M in zip(law["K2"], airframe.effect, strict=True))
    assert left <= 0.2 * b2 * 1.06 or tau == pytest.approx(0.25 / max(law["K2"]), rel=0.05)


@pytest.mark.parametrize("law", ["surviving", "tube"])
def test_a_noisy_gyro_is_filtered_for_the_diagnosis_too(law: str) -> None:
    """Where the trigger needs none, by 3 deg of the phase that the fastest rate loop has."""
    airframe = airframe_of("aerosonde", load_aircraft("aerosonde"), 28.0)
    made = plain(sections_of(design_of(airframe, law, REAL)).controller)
    assert made["gyro_filter_s"] * max(made["K2"]) == pytest.approx(0.05, rel=0.02)


def test_a_lead_is_in_the_time_of_its_axis() -> None:
    airframe = airframe_of("minisgs", load_aircraft("minisgs"))
    similar = similarity(airframe)
    assert similar.axes[2] > 1.4 * similar.time
    lead = plain(sections_of(design_of(airframe, "tube", REAL)).controller)["lead_s"]
    default = Tube().lead_s
    ratios = [new / old for new, old in zip(lead, default, strict=True)]
    assert ratios == pytest.approx([similar.time, *similar.axes], rel=1e-3)


def test_units_have_dimensions() -> None:
    assert dimensions("rad^2/s^3") == (0, 0, -3)
    assert dimensions("N s/m") == (0, 1, -1)
    assert dimensions("kg m^2") == (2, 1, 0)
    assert dimensions("m/s^2") == (1, 0, -2)
    assert dimensions("s^0.5") == (0, 0, 0.5)
    assert dimensions("") == (0, 0, 0)


def changed(**coefficients: float) -> Airframe:
    aircraft = load_aircraft("aerosonde")
    parts = aircraft.coefficients.model_copy(update=coefficients)
    return airframe_of("mine", aircraft.model_copy(update={"coefficients": parts}))


def test_what_cannot_be_flown_is_refused_with_the_reason() -> None:
    with pytest.raises(BadInput, match="the rudder does nothing"):
        design_of(changed(cn_dr=0.0, cl_dr=0.0, cY_dr=0.0), "surviving", Conditions())
    crossed = changed(cn_da=-0.069, cl_dr=0.15)
    for law in ("tube", "backstepping"):
        assert "each other's work" in design_of(crossed, law, Conditions()).warnings[0]
    with pytest.raises(BadInput, match="times slower"):
        design_of(replace(paper(), authority=(1.0, 1.0, 1.0)), "surviving", Conditions())
    with pytest.raises(BadInput, match="--airspeed is 100, expected"):
        airframe_of("aerosonde", load_aircraft("aerosonde"), 100.0)


def test_axes_and_thrust_have_their_own_scale() -> None:
    """Of an aircraft that is not similar: its pitch is slower than its roll, its engine weaker."""
    airframe = airframe_of("aerosonde", load_aircraft("aerosonde"))
    similar = similarity(airframe)
    law = plain(sections_of(design_of(airframe, "surviving", Conditions())).controller)
    home = (60.0, 40.0, 12.0)
    for limit, known, s in zip(law["rate_limit_deg_s"], home, similar.axes, strict=True):
        assert limit == pytest.approx(known / s, rel=1e-3)
    assert len({round(s, 2) for s in similar.axes}) > 1
    assert law["diagnosis"]["throttle"]["jump_n"] == pytest.approx(
        0.06 * airframe.aircraft.thrust_limit_n
    )
    assert law["diagnosis"]["jump_deg"] == pytest.approx(
        [x * 25.0 / 35.0 for x in (1.5, 2.0, 3.0)], rel=1e-3
    )
    assert law["alpha_limit_deg"] == pytest.approx(26.93 - 3.0, abs=0.05)


def test_a_flying_wing_is_designed_for_bank() -> None:
    """What it has not is left at the defaults, and no roll is commanded."""
    wing = airframe_of("skywalker_x8", load_aircraft("skywalker_x8"))
    for law in ("surviving", "tube"):
        design = design_of(wing, law, Conditions(gyro_noise_deg_s=0.3, servo_lag_s=0.02))
        scenario = scenario_of("x", plain(tree_of(design)))
        assert {segment.roll_deg for segment in scenario.profile} == {0.0}
        assert max(segment.yaw_deg for segment in scenario.profile) == 10.0
        assert plain(sections_of(design).controller)["diagnosis"]["dither_deg"][2] == 12.0
    with pytest.raises(BadInput, match="no rudder to hold the heading"):
        design_of(wing, "proposed", Conditions())


def test_coupled_surfaces_hold_the_sideslip_together() -> None:
    """As far as both balance rolling and yawing moment; the rudder alone would hold a fifth."""
    airframe = airframe_of("first", load_aircraft("aerosonde_first_edition"))
    design = design_of(airframe, "tube", REAL)
    c = airframe.aircraft.coefficients
    effect = np.array([[c.cl_da, c.cl_dr], [c.cn_da, c.cn_dr]])
    by_sideslip = np.linalg.solve(effect, [-c.cl_beta, -c.cn_beta])
    widest = 25.0 / np.abs(by_sideslip).max()
    steps = steps_deg(design)
    assert steps["yaw"][0] == pytest.approx(0.45 * widest)
    assert "by aileron and rudder" in steps["yaw"][1]
    assert steps["roll"][0] == 5.0


def test_sideslip_that_grows_under_the_rudder_is_a_warning_where_the_heading_is_by_bank() -> None:
    slipping = changed(cY_beta=0.1)
    design = design_of(slipping, "surviving", Conditions())
    assert any("hold the heading by bank" in warning for warning in design.warnings)
    with pytest.raises(BadInput, match="hold the heading by bank"):
        design_of(slipping, "backstepping", Conditions())
