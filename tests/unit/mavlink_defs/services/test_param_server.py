import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lossy_network import GCS, OTHER_GCS, OTHER_VEHICLE, VEHICLE, LossyNetwork, over_the_wire

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.services import param
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.param_server import (
    BURST,
    BURST_PERIOD_S,
    INT32,
    REAL32,
    ParamChanged,
    Parameter,
    ParamRefused,
    ParamServer,
    ParamValueError,
)

DOES_NOT_EXIST = dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST
OUT_OF_RANGE = dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
READ_ONLY = dialect.MAV_PARAM_ERROR_READ_ONLY


class Vehicle:
    """A server of n gains, a whole number and an id that cannot be set."""

    def __init__(self, gains: int = 12, bytewise: bool = False) -> None:
        self.values: dict[str, float] = {"ID": 7.0, "MODE": 1.0}
        self.values |= {f"GAIN{i}": i / 10 for i in range(gains)}
        parameters = [Parameter("ID", INT32, lambda: self.values["ID"])]
        parameters += [
            self._settable(name, INT32 if name == "MODE" else REAL32)
            for name in self.values
            if name != "ID"
        ]
        self.server = ParamServer(VEHICLE, parameters, bytewise=bytewise)

    def _settable(self, name: str, kind: int) -> Parameter:
        def put(value: float) -> None:
            if value < 0.0:
                raise ParamValueError(f"is {value:g}, must be >= 0")
            self.values[name] = value

        return Parameter(name, kind, lambda: self.values[name], put)

    def answers(
        self, message: MAVLink_message, source: SystemId = GCS, now: float = 0.0
    ) -> list[Any]:
        self.server.receive(over_the_wire(message, source), now)
        return [over_the_wire(answer, VEHICLE) for answer in self.server.messages_to_send()]

    def set(self, name: str, value: float, kind: int = REAL32) -> list[Any]:
        return self.answers(dialect.MAVLink_param_set_message(*VEHICLE, name.encode(), value, kind))


def read(name: str = "", index: int = -1) -> MAVLink_message:
    return dialect.MAVLink_param_request_read_message(*VEHICLE, name.encode(), index)


REQUEST_LIST = dialect.MAVLink_param_request_list_message(*VEHICLE)


def test_a_list_is_paced_and_complete() -> None:
    vehicle = Vehicle()
    sent = vehicle.answers(REQUEST_LIST, now=10.0)
    assert len(sent) == BURST
    vehicle.server.handle_timer(10.0 + BURST_PERIOD_S / 2)
    assert vehicle.server.messages_to_send() == []
    while (at := vehicle.server.deadline()) is not None:
        vehicle.server.handle_timer(at)
    assert at is None
    sent += vehicle.server.messages_to_send()
    assert [m.param_index for m in sent] == list(range(14))
    assert {m.param_count for m in sent} == {14}
    assert [m.param_type for m in sent] == [INT32, INT32, *[REAL32] * 12]


def test_a_list_asked_for_meanwhile_goes_round_once_more_and_no_faster() -> None:
    vehicle = Vehicle()
    sent = vehicle.answers(REQUEST_LIST)
    for _ in range(5):  # an impatient client does not speed it up
        assert vehicle.answers(REQUEST_LIST, source=OTHER_GCS) == []
    while (at := vehicle.server.deadline()) is not None:
        vehicle.server.handle_timer(at)
    sent += vehicle.server.messages_to_send()
    assert len(sent) == BURST + 14
    assert {m.param_index for m in sent[BURST:]} == set(range(14))


def test_reading_by_name_and_by_index() -> None:
    vehicle = Vehicle()
    (by_name,) = vehicle.answers(read("GAIN3"))
    (by_index,) = vehicle.answers(read("ignored", index=by_name.param_index))
    assert by_name.param_value == by_index.param_value == pytest.approx(0.3)
    assert by_index.param_id == "GAIN3"


@pytest.mark.parametrize(
    ("message", "name", "index"), [(read("NOPE"), "NOPE", -1), (read(index=99), "", 99)]
)
def test_what_does_not_exist_is_answered(message: Any, name: str, index: int) -> None:
    (error,) = Vehicle().answers(message)
    assert error.get_type() == "PARAM_ERROR"
    assert (error.target_system, error.target_component) == GCS
    assert (error.param_id, error.param_index, error.error) == (name, index, DOES_NOT_EXIST)


def test_a_value_that_is_set_is_a_decimal_and_echoed() -> None:
    vehicle = Vehicle()
    (echo,) = vehicle.set("GAIN1", 0.9)
    assert vehicle.values["GAIN1"] == 0.9
    assert (echo.param_id, echo.param_value) == ("GAIN1", pytest.approx(0.9))
    assert vehicle.server.events() == [ParamChanged("GAIN1", 0.9)]
    (again,) = vehicle.set("GAIN1", 0.9)
    assert again.param_value == echo.param_value
    assert vehicle.server.events() == []


@pytest.mark.parametrize("kind", [INT32, REAL32, dialect.MAV_PARAM_TYPE_UINT8])
def test_c_cast_does_not_care_for_the_type(kind: int) -> None:
    vehicle = Vehicle()
    (echo,) = vehicle.set("MODE", 2.0, kind)
    assert (echo.param_value, echo.param_type) == (2.0, INT32)
    assert vehicle.values["MODE"] == 2.0


def test_bytewise_integers() -> None:
    vehicle = Vehicle(bytewise=True)
    (raw,) = struct.unpack("<f", struct.pack("<i", 2))
    (echo,) = vehicle.set("MODE", raw, INT32)
    assert vehicle.values["MODE"] == 2.0
    assert struct.unpack("<i", struct.pack("<f", echo.param_value)) == (2,)
    (gain,) = vehicle.set("GAIN1", 0.5)
    assert gain.param_value == 0.5


@pytest.mark.parametrize(
    ("name", "value", "code"),
    [
        ("ID", 8.0, READ_ONLY),
        ("MODE", 1.5, OUT_OF_RANGE),
        ("MODE", 1e10, OUT_OF_RANGE),
        ("GAIN1", -1.0, OUT_OF_RANGE),
        ("GAIN1", math.nan, OUT_OF_RANGE),
        ("GAIN1", -math.inf, OUT_OF_RANGE),
    ],
)
def test_a_refusal_says_why_and_leaves_the_value(name: str, value: float, code: int) -> None:
    vehicle = Vehicle()
    before = dict(vehicle.values)
    error, kept = vehicle.set(name, value)
    assert (error.get_type(), error.error, error.param_id) == ("PARAM_ERROR", code, name)
    assert kept.param_value == pytest.approx(before[name])
    assert vehicle.values == before
    (event,) = vehicle.server.events()
    assert isinstance(event, ParamRefused)
    assert event.text.startswith(f"{name} is ")


def test_setting_what_does_not_exist() -> None:
    vehicle = Vehicle()
    (error,) = vehicle.set("NOPE", 1.0)
    assert error.error == DOES_NOT_EXIST
    assert vehicle.server.events() == [ParamRefused("NOPE", "NOPE is not known")]


def test_only_what_is_addressed_to_it_counts() -> None:
    vehicle = Vehicle()
    elsewhere = dialect.MAVLink_param_set_message(*OTHER_VEHICLE, b"GAIN1", 5.0, REAL32)
    assert vehicle.answers(elsewhere) == []
    everyone = dialect.MAVLink_param_request_read_message(0, 0, b"GAIN1", -1)
    assert len(vehicle.answers(everyone)) == 1


@pytest.mark.parametrize("names", [["A", "A"], [""], ["A" * 17], ["Ä"]])
def test_names_must_fit(names: list[str]) -> None:
    with pytest.raises(ValueError, match=r"expected a name of 1 to 16|two parameters"):
        ParamServer(VEHICLE, [Parameter(name, REAL32, float) for name in names])


networks = st.builds(
    LossyNetwork,
    seed=st.integers(0, 2**32),
    loss=st.floats(0.0, 0.4),
    duplication=st.floats(0.0, 0.3),
    delay_s=st.floats(0.0, 0.3),
)


@given(networks, st.integers(1, 60))
def test_a_list_arrives_whole_or_fails(network: LossyNetwork, gains: int) -> None:
    vehicle, lister = Vehicle(gains), param.ParamLister(GCS, VEHICLE)
    network.join(vehicle.server, VEHICLE)
    network.join(Vehicle(3).server, OTHER_VEHICLE)
    gcs = network.join(lister, GCS)
    lister.start(now=0.0)
    network.run(limit_s=120.0)
    (done,) = (event for event in gcs.events if isinstance(event, param.ParamFinished))
    assert done.error in {dialect.MAV_PARAM_ERROR_NO_ERROR, None}
    if done.error is not None:
        found = {p.name: p.value for p in done.params}
        assert found == pytest.approx(vehicle.values)
    else:
        assert network.loss > 0.0


@given(networks, st.sampled_from([("GAIN1", 0.75), ("GAIN1", -1.0), ("ID", 3.0), ("NOPE", 1.0)]))
def test_a_value_is_set_or_refused_or_it_fails(
    network: LossyNetwork, requested: tuple[str, float]
) -> None:
    name, value = requested
    vehicle = Vehicle()
    before = dict(vehicle.values)
    setter = param.ParamSetter(GCS, VEHICLE, param.Param(name, value, REAL32))
    network.join(vehicle.server, VEHICLE)
    gcs = network.join(setter, GCS)
    setter.start(now=0.0)
    network.run(limit_s=60.0)
    (done,) = (event for event in gcs.events if isinstance(event, param.ParamFinished))
    if done.error == dialect.MAV_PARAM_ERROR_NO_ERROR:
        assert vehicle.values == before | {name: value}
    elif done.error is not None:
        assert vehicle.values == before
    else:
        assert network.loss > 0.0


@given(networks, st.sampled_from(["GAIN1", "NOPE"]))
def test_a_value_is_read_or_refused_or_it_fails(network: LossyNetwork, name: str) -> None:
    vehicle, reader = Vehicle(), param.ParamReader(GCS, VEHICLE, name)
    network.join(vehicle.server, VEHICLE)
    gcs = network.join(reader, GCS)
    reader.start(now=0.0)
    network.run(limit_s=60.0)
    (done,) = (event for event in gcs.events if isinstance(event, param.ParamFinished))
    if done.error == dialect.MAV_PARAM_ERROR_NO_ERROR:
        assert done.params[0].value == pytest.approx(vehicle.values[name])
    else:
        assert done.error == (None if name == "GAIN1" else DOES_NOT_EXIST) or network.loss > 0.0
