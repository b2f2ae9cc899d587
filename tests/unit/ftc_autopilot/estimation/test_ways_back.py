"""Whatever went wrong, the estimate comes back, and no sensor that is well stays blamed.

Flights in closed loop, watched every 20 ms: what was excluded and when, and how far the estimate
was from the truth.
"""

from typing import Any, NamedTuple

import numpy as np
import pytest

from ftc_autopilot.estimation.health import ABSENT, WELL
from gcs.fleet.in_process import InProcessFlight, begin, fly_on
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT

pytestmark = pytest.mark.slow

LOOK_S = 0.02


class Watched(NamedTuple):
    """A flight: of each look, by aircraft."""

    attitude_deg: np.ndarray  # (looks, n, 3): errors of roll, pitch, yaw
    place_m: np.ndarray  # (looks, n): error of the position
    airspeed_m_s: np.ndarray  # (looks, n)
    told_m: np.ndarray  # (looks, n, 3): standard deviation of the position
    out: np.ndarray  # (looks, n, sensors): whether it is excluded
    imus_out: np.ndarray  # (looks, n)
    resets: np.ndarray  # (looks, n)

    def after(self, time_s: float) -> "Watched":
        """Return what was seen from a time on [s]."""
        return Watched(*(array[round(time_s / LOOK_S) :] for array in self))


def by_sensors(name: str = "paper/scenario1", **changes: Any) -> Scenario:
    own = {"controller": {"kind": "surviving"}, "navigation": "estimated", "faults": []}
    tree = merged(scenario_tree(name), {**own, **changes})
    return scenario_of(name, tree)


def watched(scenario: Scenario, begins_again_s: float | None = None) -> Watched:
    """Fly; all estimators may begin again at some time, as after a restart."""
    steps = Steps.room(scenario.steps, len(scenario.uavs), estimated=True)
    flight, stride = begin(scenario), round(LOOK_S * 1e6 / scenario.step_us)
    seen = []
    again = None if begins_again_s is None else round(begins_again_s * 1e6 / scenario.step_us)
    first = 0
    while first < scenario.steps:
        last = min(first + stride, scenario.steps)
        if again is not None and first < again < last:
            last = again
        if first == again:
            flight.estimates.estimators["progress"]["step"] = -1
        part = scenario.model_copy(update={"duration_s": last * scenario.step_us / 1e6})
        assert fly_on(part, flight, steps.part, first=first).loss is None
        if last % stride == 0:
            seen.append(look(flight, steps, last - 1))
        first = last
    return Watched(*(np.array(column) for column in zip(*seen, strict=True)))


def look(flight: InProcessFlight, steps: Steps, step: int) -> tuple[np.ndarray, ...]:
    true, estimated = steps.states[step], steps.estimates[step]
    turned = (estimated[:, 6:9] - true[:, 6:9] + np.pi) % (2.0 * np.pi) - np.pi
    through = np.linalg.norm(true[:, 3:6] - steps.wind[step], axis=-1)
    shown = np.linalg.norm(estimated[:, 3:6] - estimated[:, 12:15], axis=-1)
    report = flight.estimates.estimators["report"]
    out = ~np.isin(report["reasons"], (WELL, ABSENT))
    return (
        np.degrees(np.abs(turned)),
        np.linalg.norm(estimated[:, :3] - true[:, :3], axis=-1),
        np.abs(shown - through),
        report["position_std"].copy(),
        out,
        report["bad_imus"] != 0,
        report["resets"].copy(),
    )


def fault(sensor: str, start_s: float, end_s: float, instance: int = 1, **value: Any) -> Any:
    window = {"start_s": start_s, "end_s": end_s}
    return {"uav": 1, "sensor": sensor, "instance": instance, **window, **value}


@pytest.mark.parametrize("phase_s", [0.0, 0.013, 0.05, 0.087])
def test_who_joins_in_flight_knows_his_place(phase_s: float) -> None:
    """The first sample is of before: it says where the aircraft was then, and is no other's."""
    flown = watched(by_sensors(duration_s=12.0), begins_again_s=8.0 + phase_s)
    assert not flown.out.any()
    assert (flown.after(10.1).place_m < 3.0).all()  # the receiver's own error is 0.8 m an axis
    assert (flown.after(10.1).attitude_deg < 2.0).all()


def test_who_joins_again_believes_what_another_filter_excluded() -> None:
    """Else a restart in a fault would have no place until the fault is over."""
    faults = [fault("gps", 8.0, 20.0, bias_m=50.0, axis="x")]
    flown = watched(by_sensors(faults=faults, duration_s=12.0), begins_again_s=10.0)
    assert flown.out[round(9.9 / LOOK_S), 0, GNSS]
    assert not flown.after(10.5).out.any()
    assert (flown.after(10.5).place_m[:, 0] < 60.0).all()  # not at the origin


@pytest.mark.parametrize(
    ("sensor", "value"), [("accelerometer", {"bias_m_s2": 1.0}), ("gyro", {"bias_deg_s": 3.0})]
)
def test_no_other_sensor_is_blamed_for_all_imus(sensor: str, value: dict[str, float]) -> None:
    faults = [fault(sensor, 10.0, 16.0, instance, **value) for instance in (1, 2)]
    flown = watched(by_sensors(faults=faults))
    assert not flown.out.any()
    assert (flown.place_m[250:] < 6.0).all()
    assert (flown.after(22.0).attitude_deg < 5.0).all()  # pitch, until a turn shows the bias
    assert (flown.resets[-1] > flown.resets[0]).any()  # it says so


def test_a_leaking_static_port_is_found_and_not_the_receiver() -> None:
    faults = [fault("barometer", 8.0, 16.0, drift_pa_s=5.0)]
    flown = watched(by_sensors(faults=faults, duration_s=26.0))
    assert flown.out[round(11.0 / LOOK_S), 0, BAROMETER]
    assert flown.place_m[250:].max() < 4.0
    assert not np.delete(flown.out, BAROMETER, axis=2).any()
    assert not flown.after(25.9).out.any()


@pytest.mark.parametrize("drift_m_s", [0.5, 5.0])
def test_a_receiver_that_drifts_is_found_by_its_velocity(drift_m_s: float) -> None:
    faults = [fault("gps", 6.0, 14.0, drift_m_s=drift_m_s, axis="x")]
    flown = watched(by_sensors(faults=faults, duration_s=26.0))
    assert flown.out[round(13.9 / LOOK_S), 0, GNSS]
    assert flown.place_m[250:].max() < 5.0
    assert not flown.after(25.9).out.any()  # it is well again, and taken back


def test_a_place_that_stays_away_is_believed_at_last() -> None:
    """Nothing says which of the two is wrong, and nobody flies by old places for ever."""
    faults = [fault("gps", 8.0, 200.0, bias_m=50.0, axis="x")]
    changes: dict[str, Any] = {"faults": faults, "estimator": {"receiver_believed_s": 10.0}}
    flown = watched(by_sensors(**changes))
    assert flown.out[round(17.0 / LOOK_S), 0, GNSS]
    assert not flown.out[-1].any()
    assert flown.place_m[-1, 0] == pytest.approx(50.0, abs=3.0)
    assert flown.resets[-1, 0] == 1


@pytest.mark.parametrize(("gust_m_s", "duration_s"), [(4.0, 12.0), (12.0, 3.0), (-8.0, 6.0)])
def test_a_gust_is_no_fault_of_the_pitot_tube(gust_m_s: float, duration_s: float) -> None:
    gust = {"start_s": 10.0, "duration_s": duration_s, "north_m_s": gust_m_s}
    flown = watched(by_sensors(wind={"gust": gust}))
    assert not flown.out.any()
    assert (flown.airspeed_m_s[250:] < 0.35 * abs(gust_m_s)).all()


def test_a_tube_that_is_wrong_stays_out_until_it_is_well() -> None:
    """Its own wind grows to fit it, and says nothing: the lift has to agree."""
    faults = [fault("airspeed", 12.0, 30.0, fade_s=10.0)]
    flown = watched(by_sensors("missions/race_track", faults=faults, duration_s=45.0))
    assert flown.out[round(20.0 / LOOK_S) : round(30.0 / LOOK_S), 0, PITOT].all()
    assert not np.delete(flown.out, PITOT, axis=2).any()
    assert not flown.out[-1].any()


@pytest.mark.parametrize("yaw_deg", [90.0, 120.0, 180.0])
def test_without_a_magnetometer_the_course_shows_the_heading(yaw_deg: float) -> None:
    tree = scenario_tree("paper/scenario1")
    for uav in tree["uavs"]:
        uav["initial"]["yaw_deg"] = yaw_deg
    sensors = {"navigation": {"magnetometer": {"fitted": False}}}
    flown = watched(by_sensors(uavs=tree["uavs"], sensors=sensors, duration_s=20.0))
    assert not flown.out.any()
    assert (flown.attitude_deg[-1, :, 2] < 5.0).all()


def test_a_magnetometer_that_is_wrong_from_the_start_costs_no_heading() -> None:
    """It is excluded, or its bias is learned: by the first turn its heading is the only odd one."""
    flown = watched(by_sensors(faults=[fault("magnetometer", 0.0, 30.0, bias_gauss=0.2)]))
    assert not np.delete(flown.out, MAGNETOMETER, axis=2).any()
    assert (flown.after(15.0).attitude_deg < 5.0).all()


@pytest.mark.parametrize("wind_m_s", [15.0, 38.0])
def test_a_flight_may_begin_in_any_wind(wind_m_s: float) -> None:
    steady = {"north_m_s": 0.7 * wind_m_s, "east_m_s": -0.7 * wind_m_s}
    flown = watched(by_sensors(wind={"steady": steady}, duration_s=8.0))
    assert not flown.out.any()
    assert not flown.imus_out.any()
    assert not flown.resets.any()
    assert (flown.after(5.0).place_m < 4.0).all()


def test_what_is_told_of_the_place_is_true_after_dead_reckoning() -> None:
    wind = {"steady": {"north_m_s": -4.0, "east_m_s": 6.9}, "turbulence": "light"}
    faults = [fault("gps", 8.0, 20.0, failure="off")]
    flown = watched(by_sensors(faults=faults, wind=wind))
    told = np.linalg.norm(flown.told_m, axis=-1)
    assert (flown.place_m[250:] < 4.0 * told[250:]).all()
    assert not flown.out[-1].any()


def test_a_receiver_that_is_late_from_the_start_costs_no_angle() -> None:
    """It is the first one to be believed, and its latency shows in the first turn."""
    late = fault("gps", 0.0, 60.0, delayed_s=0.3)
    flown = watched(by_sensors("airframes/aerosonde_mission", faults=[late], duration_s=60.0))
    assert not flown.out[:, :, [MAGNETOMETER, BAROMETER, PITOT]].any()
    assert (flown.after(40.0).attitude_deg < 3.0).all()
    assert (flown.after(40.0).place_m < 5.0).all()


def test_a_place_that_drifts_fast_is_left_out_though_the_filter_was_reset_to_it() -> None:
    """The filter follows until its velocity disagrees, and settles once more, at a wrong place."""
    drift = fault("gps", 20.0, 60.0, drift_m_s=5.0, axis="x")
    race = by_sensors("missions/race_track", faults=[drift], duration_s=45.0, seed=380963)
    flown = watched(race)
    assert flown.out[-1, 0, GNSS]
    assert (flown.after(25.0).place_m[:, 0] < 20.0).all()
