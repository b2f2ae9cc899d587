"""Listing faults, against a vehicle that sends them before it acknowledges."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lossy_network import GCS, VEHICLE, LossyNetwork, over_the_wire, sent_by
from plain_faults import actuator_fault

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults.fault import Fault
from mavlink_defs.services.command_server import CommandReceived, CommandServer
from mavlink_defs.services.fault_list import MAX_REQUESTS, FaultLister, FaultsListed
from mavlink_defs.services.machine import Machine

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
FAULTS = (
    actuator_fault(2, 0.9, 0.0, 0.0, 19.0, 22.0),
    actuator_fault(3, 0.0, 1.5, 0.3, 0.0, math.inf),
    actuator_fault(0, 1.0, -2.5, 0.0, 7.25, math.inf),
)


UNKNOWN = [(9, 0, 0, 0), (0, 9, 0, 0), (0, 0, 7, 0), (0, 11, 1, 0), (0, 0, 1, 4)]


def message_of(faults: tuple[Fault, ...], i: int) -> MAVLink_message:
    if not faults:
        return dialect.MAVLink_ftc_fault_message(0, 0, 0, 0, 0, 0, 0, 0, 0)
    message = faults[i].message(0.0)
    message.index, message.count = i, len(faults)
    return message


@pytest.mark.parametrize(("actuator", "kind", "sensor", "axis"), UNKNOWN)
def test_a_fault_of_what_is_not_known_is_ignored(
    actuator: int, kind: int, sensor: int, axis: int
) -> None:
    message = dialect.MAVLink_ftc_fault_message(
        0.5, 1.0, 0.0, 1.0, 2.0, 0, 1, actuator, 0, kind, sensor, 1, axis
    )
    assert Fault.from_message(message) is None


class Vehicle(Machine[None]):
    def __init__(self, faults: tuple[Fault, ...], result: int = ACCEPTED) -> None:
        super().__init__()
        self.faults, self._result = faults, result
        self._server = CommandServer(VEHICLE)

    def receive(self, message: MAVLink_message, now: float) -> None:
        self._server.receive(message, now)
        for command in self._server.events():
            assert isinstance(command, CommandReceived)
            if self._result == ACCEPTED:
                for i in range(max(len(self.faults), 1)):
                    self._outbox.append(message_of(self.faults, i))
            self._server.finish(command.token, self._result, now=now)
        self._outbox += self._server.messages_to_send()

    def handle_timer(self, now: float) -> None:
        self._server.handle_timer(now)

    def deadline(self) -> float | None:
        return self._server.deadline()


def listed(vehicle: Machine[Any], network: LossyNetwork | None = None) -> FaultsListed:
    network = network or LossyNetwork(delay_s=0.0)
    lister = FaultLister(GCS, VEHICLE)
    node = network.join(lister, GCS)
    network.join(vehicle, VEHICLE)
    network.call_at(0.0, lambda: lister.start(0.0))
    network.run(limit_s=600.0)
    (event,) = node.events
    assert isinstance(event, FaultsListed)
    return event


def test_list_of_faults() -> None:
    assert listed(Vehicle(FAULTS)) == FaultsListed(ACCEPTED, FAULTS)


def test_no_faults() -> None:
    assert listed(Vehicle(())) == FaultsListed(ACCEPTED, ())


def test_a_vehicle_that_has_none_of_this() -> None:
    unsupported = dialect.MAV_RESULT_UNSUPPORTED
    assert listed(Vehicle(FAULTS, unsupported)) == FaultsListed(unsupported)


def test_silent_vehicle_is_given_up() -> None:
    assert listed(Vehicle(FAULTS), LossyNetwork(loss=1.0)) == FaultsListed(None)


def test_acknowledgements_without_faults_are_given_up() -> None:
    lister = FaultLister(GCS, VEHICLE)
    lister.start(0.0)
    now, requests, answers = 0.0, 0, 0
    while (at := lister.deadline()) is not None:
        now = max(now + 0.01, at)
        lister.handle_timer(now)
        for request in sent_by(lister, dialect.MAVLink_command_long_message):
            requests += request.confirmation == 0
            answers += 1
            ack = dialect.MAVLink_command_ack_message(
                dialect.MAV_CMD_REQUEST_MESSAGE, ACCEPTED, 0, 0, *GCS
            )
            lister.receive(over_the_wire(ack, VEHICLE, seq=answers), now)
    assert requests == MAX_REQUESTS
    assert lister.events() == [FaultsListed(None)]


def test_a_list_that_changes_meanwhile_is_no_mixture() -> None:
    lister = FaultLister(GCS, VEHICLE)
    lister.start(0.0)
    other = (FAULTS[1], FAULTS[0], FAULTS[2])
    for faults, i in ((FAULTS, 0), (FAULTS, 1), (other, 0), (other, 2)):
        lister.receive(over_the_wire(message_of(faults, i), VEHICLE), 0.1)
    ack = dialect.MAVLink_command_ack_message(dialect.MAV_CMD_REQUEST_MESSAGE, ACCEPTED, 0, 0, *GCS)
    lister.receive(over_the_wire(ack, VEHICLE), 0.1)
    assert lister.events() == []
    lister.receive(over_the_wire(message_of(other, 1), VEHICLE), 0.1)
    assert lister.events() == [FaultsListed(ACCEPTED, other)]


@given(
    st.builds(
        LossyNetwork,
        seed=st.integers(0, 2**32),
        loss=st.floats(0.0, 0.2),
        duplication=st.floats(0.0, 0.3),
        delay_s=st.floats(0.001, 0.15),
    ),
    st.integers(0, 16),
)
def test_lossy_link(network: LossyNetwork, n: int) -> None:
    faults = tuple(actuator_fault(i % 4, 0.5, 0.0, 0.0, float(i), i + 1.0) for i in range(n))
    done = listed(Vehicle(faults), network)
    assert done in (FaultsListed(ACCEPTED, faults), FaultsListed(None))
    if network.loss < 0.1:
        assert done.result == ACCEPTED
