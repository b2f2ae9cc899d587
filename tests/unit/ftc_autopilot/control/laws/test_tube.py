"""Flights of the tube law: few messages, errors within the paper's, no aircraft lost."""

from typing import Any

import numpy as np
import pytest
from shared_flights import fly_sharing_the_start

from ftc_autopilot.control.diagnosis import LOST
from ftc_autopilot.control.laws.tube import Tube
from ftc_lab.baselines.senders import worst_ratio
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.scenario.bundled import SCENARIOS
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.config.models import ConfigError

FILES = sorted(path.stem for path in (SCENARIOS / "faults").glob("*.yaml"))
PROFILES = sorted(path.stem for path in (SCENARIOS / "profiles").glob("*.yaml"))
PAPER = {"airspeed": 17.8, "roll": 16.4, "pitch": 13.4, "yaw": 25.6}  # IAE, its scenario 1


def scenario_with(name: str = "paper/scenario1", *additions: str, **keys: Any) -> Scenario:
    """A bundled scenario under the tube law; keys are merged, `controller` into the law's."""
    tree = merged(scenario_tree(name), scenario_tree("tube"))
    for addition in additions:
        tree = merged(tree, scenario_tree(addition))
    law = {"kind": "tube"} | keys.pop("controller", {})
    return scenario_of(name, tree | {"controller": law} | keys)


NEVER_SUSPECT = {
    "check_s": [1e3] * 3,
    "jump_deg": [1e3] * 3,
    "smooth_jump_deg": [1e3] * 3,
    "throttle": {"check_s": 1e3, "jump_n": 1e6},
}
"""Of the diagnosis: nothing is moved but by the plans."""


def sent(flight: Recording, channel: int) -> np.ndarray:
    """Steps of one channel's events, of all UAVs behind each other; a mask (steps, n)."""
    mask: np.ndarray = flight.signals["events"] >> channel & 1 == 1
    return mask


@pytest.mark.parametrize("hardware", [(), ("realistic",)])
def test_a_hundred_messages_track_as_well_as_the_papers_thousands(
    hardware: tuple[str, ...],
) -> None:
    scenario = scenario_with("paper/scenario1", *hardware)
    for uav in summarise(fly_in_process(scenario), scenario).uavs:
        assert uav.events <= (150 if hardware else 120)
        for quantity, limit in PAPER.items():
            assert (uav.iae[quantity] or 0.0) <= limit, (uav.id, quantity)
        assert uav.diagnosis == ()


def test_a_narrower_tube_costs_messages_and_saves_error() -> None:
    found = []
    for scale in (0.2, 1.0, 4.0):
        scenario = scenario_with(controller={"tube_scale": scale})
        uav = summarise(fly_in_process(scenario), scenario).uavs[2]
        found.append((uav.events, *(uav.iae[quantity] or 0.0 for quantity in PAPER)))
    narrow, middle, wide = np.array(found)
    assert narrow[0] <= 350
    assert np.all(narrow[1:] <= (13.4, 13.2, 12.5, 16.0))
    assert narrow[0] > middle[0] > wide[0]
    assert np.all(narrow[1:] < middle[1:])
    assert np.all(middle[1:] < wide[1:])


@pytest.mark.parametrize(("dwell_s", "least"), [(0.05, 50), (0.12, 120)])
def test_no_channel_is_sent_within_its_dwell_time(dwell_s: float, least: int) -> None:
    """In turbulence, where a shorter dwell time would be used: see the last assertion."""
    controller = {"dwell_s": dwell_s, "survive": False, "diagnosis": NEVER_SUSPECT}
    keys: dict[str, Any] = {"controller": controller, "duration_s": 3.0}
    flight = fly_in_process(scenario_with("paper/scenario1", "turbulent", **keys))
    gaps = []
    for channel in range(4):
        for i in range(3):
            gaps += np.diff(np.flatnonzero(sent(flight, channel)[:, i])).tolist()
    assert min(gaps) >= least
    assert min(gaps) < least + 10


def test_nothing_is_sent_while_nothing_changes() -> None:
    """Undisturbed, with an exact model: of what was sent first, only the elevator is corrected.

    Pitch drifts with any error of the elevator, if slowly; roll, yaw and airspeed come to rest.
    """
    profile = scenario_tree("paper/scenario1")["profile"][:1]
    keys: dict[str, Any] = {"faults": [], "disturbance": {}, "profile": profile}
    keys["controller"] = {"diagnosis": NEVER_SUSPECT}
    flight = fly_in_process(scenario_with(duration_s=15.0, **keys))
    late = np.array([sent(flight, channel)[5000:].sum(axis=0) for channel in range(4)])
    assert not late[[0, 2, 3]].any()
    assert late[1].max() <= 7


def test_a_channel_is_sent_only_when_it_would_leave_its_tube() -> None:
    """At each event the exit predicted a check before was near, and the plan moved it away.

    Unless the error only grazes the tube where it turns: then it leaves at once, or not at all.
    """
    controller = {"diagnosis": NEVER_SUSPECT}
    flight = fly_in_process(scenario_with(duration_s=6.0, controller=controller))
    exits = flight.signals["predicted_exit"]
    for channel, lead_s in enumerate((0.06, 0.09, 0.15, 0.105)):
        for i in range(3):
            events = np.flatnonzero(sent(flight, channel)[:, i])[1:]
            before, after = exits[events - 1, i, channel], exits[events, i, channel]
            assert (before < lead_s + 0.03).mean() > 0.9
            assert np.all(after >= before)
            quiet = np.setdiff1d(np.arange(4, 6000, 4), events)
            assert (exits[quiet, i, channel] < lead_s - 0.015).mean() < 0.05


def test_by_the_clock_each_channel_is_planned_whenever_it_is_due() -> None:
    """Also in the check's pauses and within its dwell time: the clock alone decides."""
    periods = {"aileron": 0.011, "elevator": 0.123, "rudder": 0.2, "throttle": 0.35}
    trigger = {"mode": "periodic"} | {f"{name}_period_s": s for name, s in periods.items()}
    flight = fly_in_process(scenario_with(duration_s=3.0, trigger=trigger))
    for channel, period_s in enumerate(periods.values()):
        events = sent(flight, channel)
        due = np.arange(3000) % round(1e3 * period_s) == 0
        assert np.array_equal(events, np.repeat(due[:, None], 3, axis=1))
        commands = flight.signals["demand"][due, :, channel]
        assert np.all(np.diff(commands, axis=0) != 0.0)  # planned, not repeated


def test_a_third_of_a_second_by_the_clock_tracks_as_well_as_the_trigger() -> None:
    """The comparison that the law is judged by: its own plans, sent by a clock."""
    triggered = scenario_with()
    by_clock = scenario_with(
        controller={"tube_scale": 0.5, "diagnosis": NEVER_SUSPECT},
        trigger={"mode": "periodic", "period_s": 0.33},
    )
    flown, reference = (summarise(fly_in_process(one), one) for one in (by_clock, triggered))
    worst = worst_ratio(flown, reference, "commands")
    assert worst is not None
    assert worst <= 1.01
    assert sum(uav.events for uav in flown.uavs) == 3 * 4 * 73


@pytest.mark.slow
@pytest.mark.parametrize("hardware", [(), ("realistic",)])
@pytest.mark.parametrize("name", PROFILES)
def test_profiles_that_it_was_not_tuned_on_stay_in_the_tube(
    name: str, hardware: tuple[str, ...]
) -> None:
    """Recomputed from the recording: outside for 1 % of the time, by half the width at most."""
    scenario = scenario_with(f"profiles/{name}", *hardware)
    flight = fly_in_process(scenario)
    signals, law = flight.signals, Tube()
    neighbours = np.array([2, 1, 1])
    weight_v, weight = 0.46 + 0.17 * neighbours, 5.0 + 0.2 * neighbours
    error = signals["sync_error"] / np.stack([weight_v, weight, weight, weight], axis=-1)
    away = np.abs(signals["reference"] - signals["command"])
    away[..., 3] = np.minimum(away[..., 3], 2.0 * np.pi - away[..., 3])
    width = np.array([law.width_m_s, *np.radians(law.width_deg)]) + law.widening * away
    share = (np.abs(error) / width)[2000:]
    assert (share > 1.0).mean(axis=(0, 1)).max() < 0.01
    assert share.max() < 1.5
    assert np.isfinite(signals["predicted_exit"]).all()  # no other law has flown


@pytest.mark.parametrize("law", ["tube", "pid"])
def test_law_and_trigger_must_go_together(law: str) -> None:
    mode = "per_channel" if law == "tube" else "consequence"
    tree = scenario_tree("paper/scenario1") | {
        "controller": {"kind": law},
        "trigger": {"mode": mode},
    }
    with pytest.raises(ConfigError, match=rf"trigger.mode: .*{law}"):
        scenario_of("paper/scenario1", tree)


@pytest.mark.slow
@pytest.mark.parametrize("hardware", [(), ("realistic",)])
@pytest.mark.parametrize("name", FILES)
def test_every_fault_is_survived(name: str, hardware: tuple[str, ...]) -> None:
    scenario = scenario_with(f"faults/{name}", *hardware)
    flight = fly_sharing_the_start(scenario)
    without_engine = name == "thrust_loss_for_good"  # which ends on the ground, 9 s later
    assert (flight.loss is not None) == without_engine
    start = min(fault.start_s for fault in scenario.faults)
    errors = np.degrees(np.abs(flight.error("reference")[flight.time_s >= start][..., 1:3]))
    assert errors.max() < 45.0
    faulty = {fault.uav for fault in scenario.faults}
    healthy = [i for i, uav in enumerate(flight.uav_ids) if uav not in faulty]
    assert errors[:, healthy].max() < 1.5
    blamed = {(flight.uav_ids[i], c) for _, i, c in np.argwhere(flight.signals["phase"] == LOST)}
    channels = ("aileron", "elevator", "rudder", "throttle")
    assert blamed <= {
        (fault.uav, channels.index(fault.actuator)) for fault in scenario.actuator_faults
    }


def test_without_the_surviving_law_the_aircraft_is_lost() -> None:
    """It is what saves: the test above can fail."""
    flight = fly_in_process(
        scenario_with("faults/stuck_zero_aileron", controller={"survive": False})
    )
    errors = np.degrees(np.abs(flight.error("reference")[..., 1:3]))
    assert flight.loss is not None or errors.max() > 45.0
