"""A flight by ArduPilots, without sockets: who waits for whom, launches, restarts, events."""

import numpy as np
import pytest
from jsbsim_aircraft import needs_jsbsim, write_aircraft
from json_peer import into_earth, read_by_text, servo_packet

from gcs.fleet.ardupilot.flight import ArduPilotFlight
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree

HOME = ("127.0.0.1", 5)
IDLE = [1500, 1500, 1000, 1500, *[1500] * 12]
CRUISE = [1500, 1500, 1400, 1500, *[1500] * 12]
FAULT = {"uav": 1, "actuator": "aileron", "stuck_deg": 5.0, "start_s": 0.05}


def scenario(count: int = 1, **changes) -> Scenario:
    tree = scenario_tree("paper/scenario1") | {"duration_s": 0.4, "faults": []} | changes
    tree["uavs"] = tree["uavs"][:count]
    tree["network"] = {"leader_access": {1: 1.0}}
    tree["network"]["edges"] = [{"between": [1, i], "weight": 1.0} for i in range(2, count + 1)]
    return scenario_of("scenario.yaml", tree)


class Rig:
    """A flight, what it says and records."""

    def __init__(self, flown: Scenario) -> None:
        self.said: list[str] = []
        self.steps: list[Steps] = []
        self.flight = ArduPilotFlight(flown, self._add, self.said.append, self._begin_again)

    def _begin_again(self) -> None:
        self.before, self.steps = self.steps, []

    def _add(self, steps: Steps) -> None:
        self.steps.append(Steps(steps.first, *(array.copy() for array in steps[1:])))

    def send(self, frame_count, pwm=CRUISE, i=0, rate_hz=1000, address=HOME, now=0.0):
        """Send a frame; return the answers by index of the UAV."""
        packet = servo_packet(frame_count, pwm, rate_hz)
        answers = self.flight.receive(i, packet, address, now)
        return {k: read_by_text(line) for k, line, _ in answers}

    def recorded(self) -> Steps:
        self.flight.keep()
        return Steps.joined(self.steps, len(self.flight.peers))


def test_a_frame_is_flown_once_and_answered_each_time():
    rig = Rig(scenario())
    first = rig.send(0)
    assert first[0]["timestamp"] == 0.001
    assert rig.send(0) == rig.send(0) == first
    assert rig.flight.step == 1
    assert rig.send(1)[0]["timestamp"] == 0.002


@pytest.mark.parametrize(
    ("rate_hz", "steps", "is_said"),
    [(1000, 1, False), (500, 2, False), (400, 2, True), (1200, 1, True), (50, 20, False),
     (8, 99, True)],
)  # fmt: skip
def test_the_physics_advances_by_whole_periods_near_the_frame_rate(rate_hz, steps, is_said):
    """ArduPilot's clock would not follow 100 ms at once."""
    rig = Rig(scenario())
    for n in range(2 + 2000 // steps):
        assert not [text for text in rig.said if "SIM_RATE_HZ" in text], "it may still be starting"
        answered = rig.send(n, IDLE, rate_hz=rate_hz)
        assert answered[0]["timestamp"] == pytest.approx(steps * (n + 1) / 1e3)
    for again in range(1, 3):
        rig.send(n + again, IDLE, rate_hz=rate_hz)
    said = [text for text in rig.said if "SIM_RATE_HZ" in text]
    assert len(said) == is_said


def test_a_rate_before_its_parameters_are_read_is_not_worth_a_word():
    rig = Rig(scenario())
    for n, rate_hz in enumerate([1200] * 100 + [1000] * 2500):
        rig.send(n, IDLE, rate_hz=rate_hz)
    assert not [text for text in rig.said if "SIM_RATE_HZ" in text]


def test_the_plant_waits_for_all_and_each_has_its_own_rate():
    rig = Rig(scenario(2))
    assert rig.send(0, i=0, rate_hz=500) == {}
    assert rig.send(0, i=0, rate_hz=500) == {}, "it is not answered before it is flown"
    answers = rig.send(0, i=1, rate_hz=1000)
    assert [*answers] == [1]
    assert answers[1]["timestamp"] == 0.001
    answers = rig.send(1, i=1, rate_hz=1000)
    assert sorted(answers) == [0, 1]
    assert {one["timestamp"] for one in answers.values()} == {0.002}
    assert answers[0]["position"] != answers[1]["position"]


def test_it_is_held_until_thrust_is_commanded_and_then_launched():
    rig = Rig(scenario(ardupilot={"launch_acceleration_m_s2": 1000.0}))
    held = [rig.send(n, IDLE)[0] for n in range(50)]
    assert {tuple(one["position"]) for one in held} == {tuple(held[0]["position"])}
    assert [one["timestamp"] for one in held] == pytest.approx(np.arange(1, 51) / 1e3)
    assert held[-1]["velocity"] == [0.0, 0.0, 0.0]
    assert rig.flight.step == 0
    n, flown = 50, []
    while not rig.flight.is_flying:
        flown.append(rig.send(n)[0])
        n += 1
    flown += [rig.send(n + k)[0] for k in range(5)]
    assert len(flown) == 45, "40 m/s at 1000 m/s²"
    assert rig.flight.step == 5
    states = rig.recorded().states[0, 0]
    speeds = np.array([one["velocity"] for one in flown])
    assert speeds[39] == pytest.approx(into_earth(states[3:6], states[6:9]), abs=1e-9)
    assert flown[39]["position"] == pytest.approx(states[:3], abs=1e-9)
    moved = np.diff([one["position"] for one in flown], axis=0) / 1e-3
    assert np.abs(moved - (speeds[1:] + speeds[:-1]) / 2).max() < 1e-3, "nowhere does it jump"


def test_without_hold_it_flies_from_the_first_frame_on():
    rig = Rig(scenario(ardupilot={"hold": False}))
    rig.send(0, IDLE)
    assert rig.flight.step == 1


def test_a_restarted_one_begins_a_new_flight_which_repeats_the_first():
    rig = Rig(scenario(faults=[FAULT]))
    first = [rig.send(n)[0] for n in range(100)]
    again = [rig.send(n, address=("127.0.0.1", 6), now=2.0)[0] for n in range(100)]
    assert again == first
    assert (rig.flight.restarts, rig.flight.peers[0].restarts) == (1, 1)
    assert (Steps.joined(rig.before, 1).length, rig.recorded().length) == (100, 100)


@needs_jsbsim
@pytest.mark.parametrize("rate_hz", [1000, 250])
def test_jsbsim_flies_and_repeats_like_any_plant(tmp_path, rate_hz):
    """At each rate, the same states as with single steps; a stuck aileron rolls it."""
    tree = scenario_tree("airframes/aerosonde")
    written = write_aircraft(tmp_path, load_scenario("airframes/aerosonde").aircraft)
    tree |= {
        "plant": {"kind": "jsbsim", "aircraft": str(written)},
        "uavs": tree["uavs"][:1],
        "network": {"leader_access": {1: 1.0}, "edges": []},
        "duration_s": 0.4,
        "faults": [FAULT],
        "ardupilot": {"hold": False},
    }
    for key in ("disturbance", "uncertainty"):
        tree.pop(key, None)
    flown = scenario_of("scenario.yaml", tree)
    rig = Rig(flown)
    each = 1000 // rate_hz
    first = [rig.send(n, rate_hz=rate_hz)[0] for n in range(200 // each)]
    states = rig.recorded().states[:, 0]
    assert states.shape == (200, 12)
    assert states[-1, 0] == pytest.approx(24.0 * 0.199, rel=0.01)
    assert states[:50, 6] == pytest.approx(np.zeros(50), abs=1e-3)
    assert states[-1, 6] < -0.05
    other = {"rate_hz": rate_hz, "address": ("127.0.0.1", 6), "now": 2.0}
    again = [rig.send(n, **other)[0] for n in range(200 // each)]
    assert again == first


def test_one_that_waits_is_served_when_another_one_is_started_again():
    rig = Rig(scenario(2))
    rig.send(0, i=0)
    rig.send(0, i=1)
    rig.send(1, i=0)
    rig.send(1, i=1)
    assert rig.send(2, i=0) == {}
    answers = rig.send(0, i=1, address=("127.0.0.1", 6), now=2.0)
    assert {k: one["timestamp"] for k, one in answers.items()} == {0: 0.001, 1: 0.001}
    assert rig.flight.step == 1


def test_changes_of_the_outputs_are_events_and_nothing_else_is():
    rig = Rig(scenario())
    turned = [1600, *CRUISE[1:]]
    other = [*turned[:6], 1100, *turned[7:]]
    for n, pwm in enumerate([CRUISE, CRUISE, turned, turned, other, other]):
        rig.send(n, pwm, rate_hz=500)
    steps = rig.recorded()
    masks = steps.signals["events"][:, 0]
    assert masks.tolist() == [0b1111, 0, 0, 0, 0b0001, *[0] * 7]
    held = steps.signals["held"][:, 0, 0]
    assert (held[:4] == 0.0).all()
    assert np.unique(held[4:]).size == 1
    assert (held[4:] != 0.0).all()
    assert (steps.applied[4:, 0, 0] == held[4:]).all()


def test_a_fault_of_the_scenario_acts_at_its_time():
    flown = {}
    for name, faults in (("healthy", []), ("stuck", [FAULT])):
        rig = Rig(scenario(faults=faults))
        flown[name] = np.array([rig.send(n)[0]["imu/gyro"] for n in range(200)])
    same = (flown["healthy"] == flown["stuck"]).all(axis=1)
    assert same[:50].all(), "the fault begins at 0.05 s"
    assert not same[51:].any()


def test_answers_have_the_sensors_errors_and_the_true_place():
    noisy = {"gyro_deg_s": {"noise_rms": 1.0}, "airspeed_m_s": {"bias": 2.0}}
    wind = {"steady": {"east_m_s": -5.0}}
    rigs = [Rig(scenario(sensors=sensors, wind=wind)) for sensors in ({}, noisy)]
    true, measured = ([rig.send(n)[0] for n in range(50)][-1] for rig in rigs)
    assert measured["airspeed"] == pytest.approx(true["airspeed"] + 2.0)
    assert measured["imu/gyro"] != true["imu/gyro"]
    assert measured["position"] == true["position"]
    assert measured["velocity"] == pytest.approx(true["velocity"])
    assert true["velocity_wind"] == pytest.approx([0.0, -5.0, 0.0], abs=1e-9)
    through = np.subtract(true["velocity"], true["velocity_wind"])
    assert true["airspeed"] == pytest.approx(np.linalg.norm(through))


def test_the_flight_ends_with_the_scenario():
    rig = Rig(scenario(duration_s=0.01))
    for n in range(10):
        assert rig.send(n)
    assert rig.flight.is_over
    assert rig.flight.loss is None
    assert rig.send(10) == {}
    assert rig.recorded().length == 10


def test_one_that_hits_the_ground_is_lost():
    rig = Rig(scenario(ardupilot={"hold": False}, duration_s=60.0))
    down = [1500, 1000, 1000, 1500, *[1500] * 12]
    n = 0
    while not rig.flight.is_over:
        rig.send(n, down, rate_hz=50)
        n += 1
    assert "UAV 1 was lost at" in str(rig.flight.loss)


def test_a_fault_is_within_the_stops_of_the_aircraft_that_has_it():
    tree = scenario_tree("paper/scenario1")
    wide = tree["aircraft"] | {"surface_limit_deg": 35.0}
    uavs = [tree["uavs"][0] | {"aircraft": wide}]
    fault = FAULT | {"stuck_deg": 20.0}
    narrow = scenario(aircraft=wide | {"surface_limit_deg": 10.0}, uavs=uavs, faults=[fault])
    flight = Rig(narrow).flight
    assert flight.fleet.uavs[0]["faults"]["value"][0] == pytest.approx(np.radians(20.0))
