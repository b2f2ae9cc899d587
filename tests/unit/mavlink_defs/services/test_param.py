"""The parameter microservice's client side, against a vehicle as the specification has it."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lossy_network import GCS, OTHER_VEHICLE, VEHICLE, LossyNetwork, Node, over_the_wire, sent_by

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.services.machine import Machine, SystemId, is_for, sender_of
from mavlink_defs.services.param import (
    MAX_RETRIES,
    MAX_TOGETHER,
    RESPONSE_TIMEOUT_S,
    Param,
    ParamFinished,
    ParamLister,
    ParamProgress,
    ParamReader,
    ParamSetter,
)

REAL, INT = dialect.MAV_PARAM_TYPE_REAL32, dialect.MAV_PARAM_TYPE_INT32
OK = dialect.MAV_PARAM_ERROR_NO_ERROR
PARAMS = (Param("B1", 0.02, REAL), Param("COUNT", 7, INT), Param("SIXTEEN_LETTERS_", -1.5, REAL))


class Vehicle(Machine[None]):
    """Parameters in a list; values above 100 are out of range."""

    def __init__(self, params: tuple[Param, ...], own: SystemId = VEHICLE) -> None:
        super().__init__()
        self.params = list(params)
        self.own = own
        self.says_errors = True
        self.sets = 0

    def receive(self, message: MAVLink_message, now: float) -> None:
        if not is_for(message, self.own):
            return
        match message:
            case dialect.MAVLink_param_request_list_message():
                for i in range(len(self.params)):
                    self._value(i)
            case dialect.MAVLink_param_request_read_message(param_index=-1):
                self._by_name(message, message.param_id)
            case dialect.MAVLink_param_request_read_message():
                self._value(message.param_index)
            case dialect.MAVLink_param_set_message():
                self.sets += 1
                if message.param_value > 100.0:
                    self._refuse(message, dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
                    return
                known = self._index(message.param_id)
                if known is not None:
                    old = self.params[known]
                    self.params[known] = Param(old.name, message.param_value, old.type)
                self._by_name(message, message.param_id)

    def handle_timer(self, now: float) -> None:
        pass

    def deadline(self) -> float | None:
        return None

    def _index(self, name: str) -> int | None:
        return next((i for i, p in enumerate(self.params) if p.name == name), None)

    def _by_name(self, message: Any, name: str) -> None:
        i = self._index(name)
        if i is None:
            self._refuse(message, dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST)
        else:
            self._value(i)

    def _refuse(self, message: Any, error: int) -> None:
        if self.says_errors:
            to = sender_of(message)
            raw = message.param_id.encode()
            self._outbox.append(dialect.MAVLink_param_error_message(*to, raw, -1, error))
        elif (i := self._index(message.param_id)) is not None:
            self._value(i)

    def _value(self, i: int) -> None:
        p = self.params[i]
        self._outbox.append(
            dialect.MAVLink_param_value_message(
                p.name.encode(), float(p.value), p.type, len(self.params), i
            )
        )


def run(
    machine: Any, vehicle: Vehicle, network: LossyNetwork | None = None
) -> tuple[ParamFinished, Node]:
    """Return the last event of the operation."""
    network = network or LossyNetwork()
    node = network.join(machine, GCS)
    network.join(vehicle, VEHICLE)
    network.call_at(0.0, lambda: machine.start(0.0))
    network.run(limit_s=600.0)
    finished = node.events[-1]
    assert isinstance(finished, ParamFinished)
    assert not any(isinstance(event, ParamFinished) for event in node.events[:-1])
    return finished, node


def test_list() -> None:
    finished, node = run(ParamLister(GCS, VEHICLE), Vehicle(PARAMS))
    assert finished == ParamFinished(OK, PARAMS)
    assert node.events[:-1] == [ParamProgress(i, 3) for i in (1, 2, 3)]
    assert [m.get_type() for m in node.sent] == ["PARAM_REQUEST_LIST"]
    assert isinstance(finished.params[1].value, int)


def test_gaps_of_a_list_are_asked_for_by_index() -> None:
    machine = ParamLister(GCS, VEHICLE)
    machine.start(0.0)
    machine.messages_to_send()
    vehicle = Vehicle(tuple(Param(f"P{i}", float(i), REAL) for i in range(30)))
    vehicle.receive(dialect.MAVLink_param_request_list_message(*VEHICLE), 0.0)
    for message in vehicle.messages_to_send()[::2]:
        machine.receive(over_the_wire(message, VEHICLE), 0.1)
    at = machine.deadline()
    assert at is not None
    machine.handle_timer(at)
    asked = sent_by(machine, dialect.MAVLink_param_request_read_message)
    assert [m.param_index for m in asked] == list(range(1, 30, 2))[:MAX_TOGETHER]


def test_read_by_name() -> None:
    finished, _ = run(ParamReader(GCS, VEHICLE, "SIXTEEN_LETTERS_"), Vehicle(PARAMS))
    assert finished == ParamFinished(OK, (PARAMS[2],))


def test_unknown_name_is_refused() -> None:
    finished, _ = run(ParamReader(GCS, VEHICLE, "NOPE"), Vehicle(PARAMS))
    assert finished == ParamFinished(dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST)


@pytest.mark.parametrize("name", ["", "SEVENTEEN_LETTERS", "Ü"])
def test_impossible_name(name: str) -> None:
    with pytest.raises(ValueError, match="ASCII"):
        ParamReader(GCS, VEHICLE, name)


def test_set() -> None:
    vehicle = Vehicle(PARAMS)
    finished, _ = run(ParamSetter(GCS, VEHICLE, Param("B1", 0.3, REAL)), vehicle)
    assert finished == ParamFinished(OK, (Param("B1", 0.3, REAL),))
    assert vehicle.params[0].value == pytest.approx(0.3)


def test_set_out_of_range_is_refused_with_its_reason() -> None:
    vehicle = Vehicle(PARAMS)
    finished, _ = run(ParamSetter(GCS, VEHICLE, Param("B1", 101.0, REAL)), vehicle)
    assert finished == ParamFinished(dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
    assert vehicle.sets == 1


def test_a_vehicle_without_error_messages_refuses_by_its_old_value() -> None:
    vehicle = Vehicle(PARAMS)
    vehicle.says_errors = False
    finished, _ = run(ParamSetter(GCS, VEHICLE, Param("B1", 101.0, REAL)), vehicle)
    assert finished == ParamFinished(dialect.MAV_PARAM_ERROR_PERMISSION_DENIED, (PARAMS[0],))
    assert vehicle.sets == 2


def test_late_news_of_the_old_value_are_no_refusal() -> None:
    machine = ParamSetter(GCS, VEHICLE, Param("B1", 0.3, REAL))
    machine.start(0.0)
    for value in (0.02, 0.3):
        message = dialect.MAVLink_param_value_message(b"B1", value, REAL, 3, 0)
        machine.receive(over_the_wire(message, VEHICLE), 0.1)
    assert machine.events() == [ParamFinished(OK, (Param("B1", 0.3, REAL),))]


@pytest.mark.parametrize(
    "machine",
    [
        ParamLister(GCS, VEHICLE),
        ParamReader(GCS, VEHICLE, "B1"),
        ParamSetter(GCS, VEHICLE, Param("B1", 1.0, REAL)),
    ],
)
def test_silent_vehicle_is_given_up(machine: Any) -> None:
    machine.start(now=0.0)
    with pytest.raises(RuntimeError):
        machine.start(now=0.0)
    assert machine.deadline() == RESPONSE_TIMEOUT_S
    while (at := machine.deadline()) is not None:
        machine.handle_timer(at)
    assert len(machine.messages_to_send()) == 1 + MAX_RETRIES
    assert machine.events() == [ParamFinished(None)]


def test_other_vehicles_do_not_answer() -> None:
    machine = ParamReader(GCS, VEHICLE, "B1")
    machine.start(0.0)
    value = dialect.MAVLink_param_value_message(b"B1", 5.0, REAL, 3, 0)
    machine.receive(over_the_wire(value, OTHER_VEHICLE), 0.1)
    elsewhere = dialect.MAVLink_param_error_message(
        1, 1, b"B1", -1, dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST
    )
    machine.receive(over_the_wire(elsewhere, VEHICLE), 0.1)
    assert machine.events() == []


lossy = st.builds(
    LossyNetwork,
    seed=st.integers(0, 2**32),
    loss=st.floats(0.0, 0.3),
    duplication=st.floats(0.0, 0.3),
    delay_s=st.floats(0.001, 0.2),
)


@given(lossy, st.integers(1, 60))
def test_a_list_over_a_lossy_link_is_complete_or_given_up(network: LossyNetwork, n: int) -> None:
    params = tuple(Param(f"P{i}", float(i), REAL) for i in range(n))
    finished, _ = run(ParamLister(GCS, VEHICLE), Vehicle(params), network)
    assert finished in (ParamFinished(OK, params), ParamFinished(None))
    if network.loss < 0.1:
        assert finished.error == OK


@given(lossy, st.floats(-50.0, 150.0, width=16))
def test_a_setting_over_a_lossy_link_says_what_holds(network: LossyNetwork, value: float) -> None:
    vehicle = Vehicle(PARAMS)
    finished, _ = run(ParamSetter(GCS, VEHICLE, Param("B1", value, REAL)), vehicle, network)
    if finished.error == OK:
        assert vehicle.params[0].value == value <= 100.0
    elif finished.error is not None:
        assert value > 100.0
        assert vehicle.params[0] == PARAMS[0]
