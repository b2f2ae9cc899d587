"""The autopilot's hot path over real loopback sockets, one state at a time."""

import itertools
import math
import socket
import time
from collections.abc import Iterator

import numpy as np
import pytest

from ftc_autopilot import formation_link, link
from ftc_autopilot.control.controller import restart_law
from ftc_autopilot.control.controllers import new_controllers, reset_controllers
from ftc_autopilot.control.reference import profile_record
from ftc_autopilot.link import FORMATION, new_link, reset_link, run
from gcs.scenario.model import Scenario
from mavlink_defs.dialect import (
    FTC_SIM_FLAGS_ENDED,
    FTC_SIM_FLAGS_LOCKSTEP,
    FTC_SIM_FLAGS_RUNNING,
)
from mavlink_defs.endpoint import set_receive_timeout
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.hot_link import Outcome

UAV, NEIGHBOUR = 2, 1  # follower 1 has one neighbour, the leader
LOCKSTEP = FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
NOTHING_APPLIED = 2**64 - 1
TIMEOUT_STEPS = 250


class Rig:
    """One autopilot's link between a plant and a neighbour that the test plays."""

    def __init__(self, scenario: Scenario) -> None:
        self.plant, self.neighbour, self.own, self.formation = (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(4)
        )
        for sock in (self.plant, self.neighbour, self.own, self.formation):
            sock.bind(("127.0.0.1", 0))
        self.own.connect(self.plant.getsockname())
        set_receive_timeout(self.own, 0.05)
        set_receive_timeout(self.formation, 0.005)
        self.plant.setblocking(False)
        self.neighbour.setblocking(False)
        address = "{}:{}".format(*self.neighbour.getsockname())
        config = scenario.autopilot_config(UAV)
        others = tuple(n.model_copy(update={"address": address}) for n in config.neighbours)
        self.controllers = new_controllers([config])
        self.controllers.profiles[0] = profile_record(scenario.segments())
        for key, value in (("active", 1), ("auto", 1), ("start_step", 0)):
            self.controllers.guidance[0][key] = value
        self.link = new_link(UAV, others, 1000, TIMEOUT_STEPS / 1000, 0)

    def close(self) -> None:
        for sock in (self.plant, self.neighbour, self.own, self.formation):
            sock.close()

    def state(
        self, step: int, flags: int = LOCKSTEP, applied_usec: int | None = None, run: int = 7
    ) -> Outcome:
        """Send a state; by default the plant has applied all that it was sent."""
        flown = self.controllers.states[0]["steps"] > 0
        sent = int(self.controllers.actuators[0]["time_usec"]) if flown else -1
        state = np.zeros(1, codec.SIM_STATE)
        state["step"], state["time_usec"], state["flags"] = step, step * 1000, flags
        state["run"] = run
        state["velocity"], state["attitude"] = (40.0, 0.0, 0.5), (0.0, math.radians(1.0), 0.0)
        applied = sent if applied_usec is None else applied_usec
        state["actuator_time_usec"] = NOTHING_APPLIED if applied < 0 else applied
        datagram = codec.new_buffer()
        length = codec.pack(datagram, state, codec.MessageId.SIM_STATE, UAV, 25, step)
        self.plant.sendto(datagram[:length].tobytes(), self.own.getsockname())
        return self.run()

    def run(self) -> Outcome:
        fds = self.own.fileno(), self.formation.fileno()
        return run(*fds, self.link, self.controllers, time.monotonic(), 2**62)

    def no_more_events(self) -> None:
        thresholds = self.controllers.parameters["trigger"]
        thresholds["a2_n"] = thresholds["b2_rad"] = 1e9

    def send_neighbour_state(
        self,
        step: int,
        airspeed: float = 41.0,
        system: int = NEIGHBOUR,
        sock: socket.socket | None = None,
    ) -> None:
        payload = np.zeros(1, codec.NEIGHBOUR)
        payload["step"], payload["airspeed"] = step, airspeed
        datagram = codec.new_buffer()
        length = codec.pack(datagram, payload, codec.MessageId.NEIGHBOUR, system, 1, step)
        sock = sock or self.neighbour
        sock.sendto(datagram[:length].tobytes(), self.formation.getsockname())

    def heard(self, sock: socket.socket) -> list[int]:
        """Ids of the hot messages that have arrived."""
        ids: list[int] = []
        datagram = codec.new_buffer()
        while True:
            try:
                length = sock.recv_into(datagram.data)
            except BlockingIOError:
                return ids
            ids.append(codec.check(datagram, length))


@pytest.fixture
def rig(scenario1: Scenario) -> Iterator[Rig]:
    rig = Rig(scenario1)
    yield rig
    rig.close()


def test_a_lockstep_step_is_answered_with_actuators_then_step_done(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    assert rig.state(0) == Outcome.TICK
    assert rig.heard(rig.plant) == [codec.MessageId.ACTUATORS, codec.MessageId.STEP_DONE]
    assert set(rig.heard(rig.neighbour)) == {codec.MessageId.NEIGHBOUR}


def test_real_time_has_no_step_done(rig: Rig) -> None:
    rig.state(0, FTC_SIM_FLAGS_RUNNING)
    assert rig.heard(rig.plant) == [codec.MessageId.ACTUATORS]


def test_a_frozen_aircraft_sends_the_plant_nothing(rig: Rig) -> None:
    rig.state(0, FTC_SIM_FLAGS_LOCKSTEP)
    assert rig.heard(rig.plant) == []
    assert rig.heard(rig.neighbour) == [codec.MessageId.NEIGHBOUR]


def test_without_an_event_only_step_done_is_sent(rig: Rig) -> None:
    silent = 0
    for step in range(200):
        rig.send_neighbour_state(step)
        rig.state(step)
        silent += rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]
    assert silent > 0


def test_the_same_state_again_is_answered_but_not_worked_on_again(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    rig.heard(rig.plant)
    rig.state(0)
    assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]
    assert rig.controllers.states[0]["steps"] == 1


def test_disarmed_it_measures_holds_and_computes_nothing(rig: Rig) -> None:
    for step in range(20):
        rig.send_neighbour_state(step)
        rig.state(step)
    controller, signals = rig.controllers.states[0], rig.controllers.signals[0]
    before, held = controller.copy(), signals["held"].copy()
    rig.controllers.guidance[0]["active"] = 0
    for step in range(20, 40):
        rig.send_neighbour_state(step)
        rig.state(step)
    assert signals["V"] == pytest.approx(math.hypot(40.0, 0.5))
    assert signals["attitude"].tolist() == [0.0, math.radians(1.0), 0.0]
    assert signals["held"].tolist() == [*held[:3], 0.0]
    for name in ("command", "reference", "error", "sync_error", "demand", "beta_v"):
        assert np.isnan(signals[name]).all()
    assert controller["steps"] == before["steps"] == 20
    assert (controller["events"] - before["events"]).tolist() == [0, 0, 0, 1]
    assert controller["messages"] == before["messages"] + 1


def test_armed_again_the_law_starts_from_where_the_aircraft_is(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    assert (
        rig.controllers.signals[0]["reference"].tolist()
        == rig.controllers.signals[0]["command"].tolist()
    )
    controller = rig.controllers.states[0]
    controller["proposed"]["beta_v"] = 7.0
    restart_law(controller)
    rig.state(50)
    signals = rig.controllers.signals[0]
    assert signals["reference"].tolist() == [signals["V"], *signals["attitude"]]
    assert signals["beta_v"] == 1.0
    assert signals["events"] == 0b1111
    assert controller["min_interval"].tolist() == [50] * 4


def test_a_lost_actuator_message_is_sent_again_and_counted_apart(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    events = rig.controllers.states[0]["events"].copy()
    rig.no_more_events()
    rig.heard(rig.plant)
    rig.send_neighbour_state(1)
    rig.state(1, applied_usec=-1)
    assert rig.heard(rig.plant) == [codec.MessageId.ACTUATORS, codec.MessageId.STEP_DONE]
    assert list(rig.link.state[0]["repeated"]) == [1, 1, 1, 1]
    assert np.array_equal(rig.controllers.states[0]["events"], events)
    rig.send_neighbour_state(2)
    rig.state(2)
    assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]


def pending(rig: Rig) -> list[int]:
    return [int(usec) for usec in rig.link.state[0]["pending_usec"]]


def test_an_event_is_acknowledged_by_its_message_or_a_later_one(rig: Rig) -> None:
    rig.state(0, FTC_SIM_FLAGS_RUNNING, applied_usec=-1)
    assert pending(rig) == [0, 0, 0, 0]
    rig.no_more_events()
    rig.link.state[0]["pending_usec"] = [0, 0, 1000, 2000]  # the rudder's and throttle's came later
    rig.link.state[0]["pending_s"] = time.monotonic() + 1e6  # nobody is impatient
    rig.state(3, FTC_SIM_FLAGS_RUNNING, applied_usec=0)
    assert pending(rig) == [-1, -1, 1000, 2000]
    rig.state(4, FTC_SIM_FLAGS_RUNNING, applied_usec=5000)
    assert pending(rig) == [-1, -1, -1, -1]
    assert list(rig.link.state[0]["repeated"]) == [0, 0, 0, 0]


def test_a_lost_message_repeats_the_events_of_its_own_channels_only(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    rig.no_more_events()
    rig.link.state[0]["pending_usec"] = [-1, 500, 0, -1]  # elevator and, applied already, rudder
    rig.send_neighbour_state(1)
    rig.state(1, applied_usec=0)
    assert list(rig.link.state[0]["repeated"]) == [0, 1, 0, 0]


def test_in_real_time_an_acknowledgement_is_waited_for_in_wall_time(rig: Rig) -> None:
    rig.state(0, FTC_SIM_FLAGS_RUNNING)
    rig.no_more_events()
    rig.heard(rig.plant)
    rig.state(1, FTC_SIM_FLAGS_RUNNING, applied_usec=-1)
    rig.heard(rig.plant)
    rig.link.state[0]["repeated"] = 0
    for waited_s, sent in ((0.0199, []), (0.0201, [codec.MessageId.ACTUATORS])):
        rig.link.state[0]["heard_s"] = rig.link.state[0]["pending_s"][0] + waited_s
        link._send_actuators(rig.own.fileno(), rig.link, rig.controllers, 0, False)
        assert rig.heard(rig.plant) == sent
    assert list(rig.link.state[0]["repeated"]) == [1, 1, 1, 1]
    assert pending(rig) == [0, 0, 0, 0]  # the first message would acknowledge them still


def test_a_step_that_was_not_flown_is_not_reported_done(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(5)
    rig.heard(rig.plant)
    rig.state(3)
    assert rig.heard(rig.plant) == []


@pytest.mark.parametrize(
    "flags",
    [
        LOCKSTEP,
        FTC_SIM_FLAGS_RUNNING,
        FTC_SIM_FLAGS_LOCKSTEP,
        FTC_SIM_FLAGS_LOCKSTEP | FTC_SIM_FLAGS_ENDED,
    ],
)
def test_a_state_of_another_run_is_not_worked_on(rig: Rig, flags: int) -> None:
    for step in range(3):
        rig.send_neighbour_state(step)
        rig.state(step)
    rig.heard(rig.plant)
    rig.heard(rig.neighbour)
    for step in (0, 3):
        assert rig.state(step, flags, run=8 + step) == Outcome.RESTARTED
    assert rig.heard(rig.plant) == rig.heard(rig.neighbour) == []
    assert rig.controllers.states[0]["steps"] == 3


def test_after_a_reset_nothing_is_left_of_the_flight(scenario1: Scenario, rig: Rig) -> None:
    for step in range(20):
        rig.send_neighbour_state(step)
        rig.state(step, applied_usec=-1)
    fresh = Rig(scenario1)
    reset_link(rig.link)
    reset_controllers(rig.controllers)
    reset_controllers(fresh.controllers)  # its guidance, too, is set again by the modes
    for name, array in rig.controllers._asdict().items():
        assert array.tobytes() == getattr(fresh.controllers, name).tobytes(), name
    assert rig.link.signals.tobytes() == fresh.link.signals.tobytes()
    formation, expected = rig.link.formation, fresh.link.formation
    for name in ("heard_step", "pending_step", "misses"):
        assert getattr(formation, name).tobytes() == getattr(expected, name).tobytes(), name
    assert formation.state["edge_changes"] == expected.state["edge_changes"]
    for name in ("step", "pending_usec", "pending_s", "repeated"):
        assert rig.link.state[name].tobytes() == fresh.link.state[name].tobytes(), name
    fresh.close()


def test_a_step_uses_states_of_the_step_before_even_if_newer_ones_have_arrived(rig: Rig) -> None:
    for step in range(3):
        rig.send_neighbour_state(step, airspeed=40.0 + step)
    rig.state(0)
    assert rig.controllers.neighbour_states[0, 0]["step"] == 0
    rig.state(1)
    assert rig.controllers.neighbour_states[0, 0]["step"] == 0
    rig.state(2)
    assert rig.controllers.neighbour_states[0, 0]["step"] == 1
    assert rig.controllers.neighbour_states[0, 0]["airspeed"] == 41.0


def test_a_silent_neighbour_is_dropped_and_restored(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    for step in range(TIMEOUT_STEPS + 1):
        rig.state(step, FTC_SIM_FLAGS_RUNNING)
    assert rig.controllers.weights[0, 0] == 1.0
    rig.state(TIMEOUT_STEPS + 1, FTC_SIM_FLAGS_RUNNING)
    assert rig.controllers.weights[0, 0] == 0.0
    assert rig.link.formation.state[0]["edge_changes"] == 1
    rig.send_neighbour_state(TIMEOUT_STEPS + 1)
    rig.state(TIMEOUT_STEPS + 2, FTC_SIM_FLAGS_RUNNING)
    assert rig.controllers.weights[0, 0] == 1.0
    assert rig.link.formation.state[0]["edge_changes"] == 2


def test_a_neighbour_state_from_another_address_is_dropped_and_counted(rig: Rig) -> None:
    rig.send_neighbour_state(0, sock=rig.plant)
    rig.state(0, FTC_SIM_FLAGS_RUNNING)
    assert rig.link.drops[FORMATION, -DropReason.STRANGER] == 1
    assert rig.controllers.weights[0, 0] == 0.0
    rig.send_neighbour_state(0)
    rig.state(1, FTC_SIM_FLAGS_RUNNING)
    assert rig.controllers.weights[0, 0] == 1.0


def test_a_state_of_a_far_later_step_is_not_kept_as_pending(rig: Rig) -> None:
    """As they lie in the socket when the plant, and so the count of steps, was started again."""
    rig.send_neighbour_state(1)
    rig.send_neighbour_state(25_000)
    rig.state(0, FTC_SIM_FLAGS_RUNNING)
    assert rig.link.drops[FORMATION, -DropReason.OUT_OF_RANGE] == 1
    assert rig.link.formation.pending_step[0] == 1


def test_states_of_strangers_and_states_that_are_not_finite_are_ignored(rig: Rig) -> None:
    rig.send_neighbour_state(0, system=77)
    rig.send_neighbour_state(0, airspeed=math.nan)
    rig.state(0, FTC_SIM_FLAGS_RUNNING)
    assert rig.controllers.weights[0, 0] == 0.0


def test_noise_changes_nothing_and_is_counted(rig: Rig) -> None:
    for noise in (b"", b"noise", bytes(300), b"\xfd" + bytes(11)):
        rig.plant.sendto(noise, rig.own.getsockname())
        assert rig.run() in {Outcome.TICK, Outcome.SERVICE}
    assert rig.link.state[0]["step"] == -1
    assert rig.link.drops.sum() >= 3


def test_the_end_of_the_simulation_is_acknowledged(rig: Rig) -> None:
    assert rig.state(0, FTC_SIM_FLAGS_LOCKSTEP | FTC_SIM_FLAGS_ENDED) == Outcome.OVER
    assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]


def test_disarmed_in_flight_thrust_goes_to_zero_once(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    assert rig.controllers.actuators[0]["controls"][3] > 0.0
    rig.controllers.guidance[0]["active"] = 0
    rig.heard(rig.plant)
    rig.send_neighbour_state(1)
    rig.state(1)
    assert rig.heard(rig.plant) == [codec.MessageId.ACTUATORS, codec.MessageId.STEP_DONE]
    assert rig.controllers.actuators[0]["controls"][3] == 0.0
    rig.send_neighbour_state(2)
    rig.state(2)
    assert rig.heard(rig.plant) == [codec.MessageId.STEP_DONE]


def test_lockstep_uses_its_only_neighbour_again_after_a_lost_state(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    rig.state(0)
    rig.state(1)
    rig.state(2)  # the state of step 1 is lost
    assert rig.link.formation.misses[0] == 1  # waited for in vain
    rig.send_neighbour_state(2)
    rig.state(3)
    assert rig.controllers.neighbour_states[0, 0]["step"] == 2


def test_a_state_in_the_socket_is_taken_even_if_the_process_is_late(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A busy machine may let more time pass between two lines than the wait takes."""
    rig.send_neighbour_state(0)
    rig.state(0)
    for step in (0, 1):
        rig.send_neighbour_state(step)
    seconds = itertools.count()
    monkeypatch.setattr(formation_link, "monotonic_s", lambda: next(seconds))
    compiled = formation_link.collect_neighbour_states
    collect = getattr(compiled, "py_func", compiled)
    collect(rig.formation.fileno(), rig.link.formation, rig.controllers, 2, True)
    assert rig.controllers.neighbour_states[0, 0]["step"] == 1
    assert rig.link.formation.misses[0] == 0


def test_lockstep_stops_waiting_but_hears_a_neighbour_that_is_back(rig: Rig) -> None:
    rig.send_neighbour_state(0)
    for step in range(TIMEOUT_STEPS + 2):
        rig.state(step)
    assert rig.link.formation.misses[0] == 5  # steps that waited, of more than 250
    assert rig.controllers.weights[0, 0] == 0.0
    rig.send_neighbour_state(TIMEOUT_STEPS + 1)
    rig.state(TIMEOUT_STEPS + 2)
    assert rig.controllers.weights[0, 0] == 1.0
