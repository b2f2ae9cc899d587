"""A log tells of the same faults as the vehicle and its plant have."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_faults import actuator_fault

from gcs.station.fleet_state import FleetState
from gcs.station.passive_observer import PassiveObserver
from gcs.station.vehicle_state import VehicleState
from gcs.tui.fault_history import FaultHistory
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS, MAX_FAULTS
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.table import FaultTable, no_faults
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.services.command_server import CommandServer
from mavlink_defs.services.fault_list import FaultLister, FaultsListed
from mavlink_defs.services.machine import SystemId

STATION, VEHICLE = SystemId(255, 77), SystemId(3, 1)
NAN, INF = math.nan, math.inf
NOW_S = 5.5  # simulated time that the vehicle last reported [s]

float32s = st.floats(width=32, allow_nan=False, allow_infinity=False)
anything = st.builds(
    actuator_fault,
    st.integers(0, 3),
    st.floats(0, 1, width=32),
    float32s,
    float32s,
    float32s,
    float32s | st.just(INF),
)


def received(message: MAVLink_message, source: SystemId) -> Any:
    return parse(FramePacker(*source).pack(message))


class Log:
    """A station's log of one vehicle, played into a fleet state and a fault_history."""

    def __init__(self) -> None:
        self._fleet = FleetState()
        self._overheard = PassiveObserver(self._fleet)
        self.fault_history = FaultHistory((0, 0))
        self.play(dialect.MAVLink_heartbeat_message(1, 3, 1, 12, 4, 3), VEHICLE)
        self.tell_time(NOW_S)

    @property
    def state(self) -> VehicleState:
        return self._fleet.vehicles[VEHICLE.system]

    def play(self, message: MAVLink_message, source: SystemId) -> None:
        message = received(message, source)
        for notifications in (
            *self._fleet.receive(message, 0.0),
            *self._overheard.receive(message, 0.0),
        ):
            self.fault_history.receive(notifications, 0.0)
        self.fault_history.update(self.state, 0.0)

    def tell_time(self, time_s: float) -> None:
        zeros = [0.0] * 4
        self.play(
            dialect.MAVLink_ftc_tracking_message(round(time_s * 1e3), zeros, zeros, zeros), VEHICLE
        )

    def command(self, command: int, params: Sequence[float]) -> None:
        self.play(dialect.MAVLink_command_long_message(*VEHICLE, command, 0, *params), STATION)
        self.play(dialect.MAVLink_command_ack_message(command, 0, 0, 0, *STATION), VEHICLE)

    def set(self, fault: Fault) -> None:
        self.command(dialect.MAV_CMD_FTC_SET_FAULT, fault.params)

    def list(self, faults: Sequence[Fault]) -> None:
        for message in listing(faults):
            self.play(message, VEHICLE)


def listing(faults: Sequence[Fault]) -> list[dialect.MAVLink_ftc_fault_message]:
    """The FTC_FAULT messages of a vehicle that has these faults."""
    if not faults:
        return [dialect.MAVLink_ftc_fault_message(0, 0, 0, 0, 0, 0, 0, 0, 0)]
    messages = [fault.message(0.0) for fault in faults]
    for i, message in enumerate(messages):
        message.index, message.count = i, len(faults)
    return messages


def listed_live(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """Return the answers to a station that asks the vehicle."""
    lister, server = FaultLister(STATION, VEHICLE), CommandServer(VEHICLE)
    lister.start(0.0)
    for message in lister.messages_to_send():
        server.receive(received(message, STATION), 0.0)
    for command in server.events():
        server.finish(command.token, dialect.MAV_RESULT_ACCEPTED, now=0.0)
    for message in (*listing(faults), *server.messages_to_send()):
        lister.receive(received(message, VEHICLE), 0.0)
    (done,) = lister.events()
    assert isinstance(done, FaultsListed)
    return done.faults


@given(st.lists(anything, max_size=MAX_FAULTS))
def test_a_log_tells_the_same_faults_as_the_vehicle(faults: list[Fault]) -> None:
    log = Log()
    log.list(faults)
    assert log.state.faults == listed_live(faults)


@given(st.lists(anything, min_size=2, max_size=4), st.data())
def test_a_list_may_come_in_pieces(faults: list[Fault], data: st.DataObject) -> None:
    log, messages = Log(), listing(faults)
    for message in data.draw(st.permutations(messages + messages)):
        log.play(message, VEHICLE)
    assert log.state.faults == listed_live(faults)


def test_an_actuator_that_does_not_exist_is_ignored() -> None:
    log = Log()
    log.play(dialect.MAVLink_ftc_fault_message(0.5, 0, 0, 1, 2, 0, 1, 9, 0), VEHICLE)
    assert log.state.faults is None


@pytest.mark.parametrize("value", [19.3, 100.1, 0.1, 0.7])
def test_a_listed_fault_does_not_replace_itself(value: float) -> None:
    log, fault = Log(), actuator_fault(2, 0.9, value, value, value + 19.0, value + 30.0)
    log.set(fault)
    log.list([fault])
    (record,) = log.fault_history.records
    assert (record.fault, record.gone, record.acknowledged is None) == (fault, "", False)


def test_a_start_that_was_estimated_is_set_right_by_the_list() -> None:
    log = Log()
    log.set(actuator_fault(2, 0.9, 0.0, 0.0, NAN, NAN))
    exact = actuator_fault(2, 0.9, 0.0, 0.0, NOW_S + 0.043, INF)
    log.list([exact])
    (record,) = log.fault_history.records
    assert (record.fault, record.gone, record.acknowledged is None) == (exact, "", False)
    log.set(actuator_fault(2, 0.9, 0.0, 0.0, NAN, NAN))  # the same once more is another fault
    log.list([actuator_fault(2, 0.9, 0.0, 0.0, NOW_S + 0.5, INF)])
    first, second = log.fault_history.records
    assert (first.gone, second.gone) == ("replaced", "")


whole = st.integers(0, 12).map(float)
commands = st.one_of(
    st.builds(
        lambda actuator, start, length: actuator_fault(
            actuator, 0.5, 0.0, 0.0, start, start + length
        ),
        st.integers(0, 1),
        st.just(NAN) | whole,
        st.integers(1, 6),
    ),
    st.builds(
        lambda actuator, start, end: actuator_fault(actuator, 0.25, 1.0, 0.0, start, end),
        st.integers(0, 1),
        st.just(NAN) | whole,
        st.just(NAN),
    ),
    st.sampled_from([-1, 0, 1]),
)


@given(st.lists(st.tuples(st.integers(0, 3), commands), max_size=MAX_FAULTS))
def test_windows_follow_the_plants_rule(steps: list[tuple[int, Fault | int]]) -> None:
    table, log, time_s = FaultTable(ACTUATOR_FAULTS, no_faults(ACTUATOR_FAULTS, 1)[0]), Log(), NOW_S
    for later_s, step in steps:
        time_s += later_s
        log.tell_time(time_s)
        if isinstance(step, int):
            log.command(dialect.MAV_CMD_FTC_CLEAR_FAULTS, (step, 0, 0, 0, 0, 0, 0))
            table.clear(ACTUATOR_FAULTS.target(step))
        else:
            log.set(step)
            table.set([step], time_s)
    there = [(f.number, f.effectiveness, f.start_s, f.end_s) for f in table.faults]
    known = log.state.faults or ()
    assert [(f.number, f.effectiveness, f.start_s, f.end_s) for f in known] == there
