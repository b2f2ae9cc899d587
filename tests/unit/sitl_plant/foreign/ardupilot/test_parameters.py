"""ArduPlane's parameters as they follow from an aircraft."""

import math

import pytest

from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.foreign.ardupilot.config import ArduPilot, SurfaceOutput
from sitl_plant.foreign.ardupilot.parameters import parameter_text, parameters_of

AEROSONDE = load_aircraft("aerosonde")


def values(outputs: ArduPilot | None = None, step_us: int = 1000, **changes: float) -> dict:
    aircraft = AEROSONDE.model_copy(update=changes)
    found = parameters_of(aircraft, outputs or ArduPilot(), step_us)
    names = [one.name for one in found]
    assert len(set(names)) == len(names)
    assert max(map(len, names)) <= 16, "as long as a parameter's name may be"
    return {one.name: one.value for one in found}


def test_outputs_are_those_of_the_scenario() -> None:
    own = values(ArduPilot(aileron=SurfaceOutput(channel=7, min_us=900, reversed=True)))
    assert (own["SERVO7_FUNCTION"], own["SERVO7_MIN"], own["SERVO7_REVERSED"]) == (4, 900, 1)
    assert (own["SERVO2_FUNCTION"], own["SERVO3_FUNCTION"], own["SERVO4_FUNCTION"]) == (19, 70, 21)


@pytest.mark.parametrize(
    ("step_us", "rate_hz"), [(1000, 500), (2500, 400), (4000, 250), (300, 416)]
)
def test_frames_are_whole_control_periods(step_us: int, rate_hz: float) -> None:
    found = values(step_us=step_us)["SIM_RATE_HZ"]
    periods = 1e6 / (found * step_us)
    assert periods == pytest.approx(round(periods))
    assert found == pytest.approx(rate_hz, abs=1.0)


def test_the_trim_is_that_of_level_flight() -> None:
    from sitl_plant.airframe.level_flight import level_flight

    flight = level_flight(AEROSONDE, AEROSONDE.design_airspeed)
    assert flight is not None
    own = values()
    assert own["PTCH_TRIM_DEG"] == pytest.approx(flight.alpha_deg, abs=0.5)
    share = flight.thrust_n / AEROSONDE.thrust_limit_n
    assert own["TRIM_THROTTLE"] == pytest.approx(100.0 * share, abs=3.0)


def test_the_feed_forward_is_what_a_steady_roll_takes() -> None:
    """cl_p p b/2V + cl_da δ = 0; ArduPlane calls the full travel 45 degrees."""
    C, V = AEROSONDE.coefficients, AEROSONDE.design_airspeed
    delta = -C.cl_p * AEROSONDE.wing_span_m / (2.0 * V) / C.cl_da
    travel = math.radians(min(map(abs, AEROSONDE.stops_deg[0])))
    own = values()
    assert own["RLL_RATE_FF"] == pytest.approx(abs(delta) / travel * math.radians(45.0), abs=1e-4)


def test_the_file_has_a_line_for_each() -> None:
    text = parameter_text(parameters_of(AEROSONDE, ArduPilot(), 1000))
    read = {line.split()[0]: float(line.split()[1]) for line in text.splitlines()}
    assert read == {name: pytest.approx(float(v), rel=1e-5) for name, v in values().items()}
