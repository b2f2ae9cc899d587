"""The vehicle's end of the command protocol, message by message."""

from collections.abc import Callable

import pytest
from command_messages import (
    ACCEPTED,
    ARM,
    CLEAR_FAULTS,
    FAILED,
    IN_PROGRESS,
    QUESTIONS,
    SET_FAULT,
    ack,
    int_,
    long,
)
from lossy_network import (
    GCS,
    OTHER_GCS,
    OTHER_VEHICLE,
    VEHICLE,
    over_the_wire,
    sent_by,
)

from mavlink_defs import dialect
from mavlink_defs.dialect import (
    MAVLink_command_ack_message,
    MAVLink_command_long_message,
    MAVLink_message,
)
from mavlink_defs.services.command import CommandMessage
from mavlink_defs.services.command_server import (
    CONFIRMED_WINDOW_S,
    LATE_S,
    MAX_PENDING,
    PENDING_TIMEOUT_S,
    CommandReceived,
    CommandServer,
)
from mavlink_defs.services.machine import SystemId


class Vehicle:
    """A server and what came out of it; each arrival takes the next sequence number."""

    def __init__(self) -> None:
        self.server = CommandServer(VEHICLE)
        self.seq = 250

    def gets(
        self, message: CommandMessage, now: float, source: SystemId = GCS, seq: int | None = None
    ) -> list[CommandReceived]:
        self.seq = (self.seq + 1) % 256
        received = over_the_wire(message, source, self.seq if seq is None else seq)
        self.server.receive(received, now)
        return self.server.events()

    def executes(self, message: CommandMessage, now: float, source: SystemId = GCS) -> bool:
        """Accept every command at once; return whether `message` was executed."""
        events = self.gets(message, now, source)
        for event in events:
            self.server.finish(event.token, ACCEPTED, now=now)
        (answer,) = sent_by(self.server, MAVLink_command_ack_message)
        assert (answer.command, answer.result) == (message.command, ACCEPTED)
        assert (answer.target_system, answer.target_component) == source
        return bool(events)

    def results(self) -> list[int]:
        return [ack.result for ack in sent_by(self.server, MAVLink_command_ack_message)]


class TestServer:
    def test_repetition_has_no_second_effect(self) -> None:
        vehicle = Vehicle()
        assert vehicle.executes(long(), now=0.0)
        assert not vehicle.executes(long(confirmation=1), now=0.5)
        assert not vehicle.executes(long(confirmation=2), now=CONFIRMED_WINDOW_S)
        assert vehicle.executes(long(confirmation=3), now=CONFIRMED_WINDOW_S + 0.1)

    @pytest.mark.parametrize("form", [long, int_])
    def test_what_does_not_say_that_it_repeats_is_executed(self, form: type) -> None:
        vehicle = Vehicle()
        assert all(vehicle.executes(form(), now=0.5 * i) for i in range(6))

    @pytest.mark.parametrize("command", QUESTIONS)
    @pytest.mark.parametrize("confirmation", [0, 1])
    def test_questions_are_answered_as_often_as_they_are_asked(
        self, command: int, confirmation: int
    ) -> None:
        vehicle = Vehicle()
        question = long(148.0, command, confirmation)
        assert all(vehicle.executes(question, now=1.0 * i) for i in range(6))

    def test_a_datagram_that_the_network_duplicates_is_dropped(self) -> None:
        vehicle = Vehicle()
        assert vehicle.gets(long(), now=0.0, seq=7)
        assert vehicle.gets(long(), now=LATE_S, seq=7) == []
        vehicle.gets(long(0.0), now=LATE_S, seq=8)
        assert vehicle.gets(long(), now=LATE_S, seq=7) == []
        assert vehicle.server.messages_to_send() == []
        assert vehicle.gets(long(), now=LATE_S + 0.1, seq=7)  # of a client that was restarted

    def test_a_change_by_another_station_is_undone_by_the_same_command_given_again(self) -> None:
        vehicle = Vehicle()
        assert vehicle.executes(long(1.0), now=0.0)
        assert vehicle.executes(long(0.0), now=0.2, source=OTHER_GCS)
        assert vehicle.executes(long(1.0), now=0.4)
        assert vehicle.executes(long(0.0), now=0.6, source=OTHER_GCS)
        # lost as it was sent first at 0.7 s, so its repetition comes first
        assert vehicle.executes(long(1.0, confirmation=1), now=1.2)

    def test_short_lived_clients_of_one_address_mean_what_they_say(self) -> None:
        vehicle = Vehicle()
        for now, command in enumerate((SET_FAULT, CLEAR_FAULTS, SET_FAULT, CLEAR_FAULTS)):
            assert vehicle.gets(long(command=command), now=0.2 * now, seq=0)

    @pytest.mark.parametrize(
        "change",
        [
            dialect.MAVLink_set_mode_message(1, 1, 12),
            dialect.MAVLink_mission_clear_all_message(*VEHICLE, 0),
            dialect.MAVLink_mission_count_message(*VEHICLE, 3, 0),
            dialect.MAVLink_mission_set_current_message(*VEHICLE, 2),
        ],
    )
    def test_messages_change_what_commands_act_on(self, change: MAVLink_message) -> None:
        start = dialect.MAV_CMD_MISSION_START
        vehicle = Vehicle()
        assert vehicle.executes(long(0.0, start), now=0.0)
        assert not vehicle.executes(long(0.0, start, confirmation=1), now=0.5)
        vehicle.server.receive(over_the_wire(change, OTHER_GCS), now=0.6)
        assert vehicle.executes(long(0.0, start, confirmation=1), now=1.1)

    @pytest.mark.parametrize("source", [GCS, OTHER_GCS])
    @pytest.mark.parametrize("form", [lambda: long(confirmation=1), int_])
    def test_a_repetition_that_comes_late_undoes_nothing(
        self, source: SystemId, form: Callable[[], CommandMessage]
    ) -> None:
        vehicle = Vehicle()
        first = long() if isinstance(form(), MAVLink_command_long_message) else int_()
        vehicle.gets(first, now=0.0, seq=255)
        vehicle.gets(long(0.0), now=0.5, source=source, seq=1)
        assert vehicle.gets(form(), now=0.5 + LATE_S, seq=0) == []
        assert vehicle.server.messages_to_send() == []
        assert vehicle.gets(form(), now=1.0, seq=2)  # it was meant

    def test_confirmation_alone_does_not_make_a_repetition(self) -> None:
        vehicle = Vehicle()
        assert vehicle.executes(long(confirmation=1), now=0.0)
        assert vehicle.executes(long(0.0, confirmation=1), now=0.1)
        assert vehicle.executes(long(0.0, SET_FAULT, confirmation=1), now=0.2)
        assert vehicle.executes(long(0.0, confirmation=1), now=0.3, source=OTHER_GCS)

    def test_arm_disarm_arm_in_a_hurry_is_three_commands(self) -> None:
        vehicle = Vehicle()
        assert all(vehicle.executes(long(p), now=0.1 * i) for i, p in enumerate((1.0, 0.0, 1.0)))
        assert vehicle.executes(long(0.0), now=0.4)  # lost, so its repetition comes first
        assert vehicle.executes(long(1.0, confirmation=1), now=0.5)

    def test_set_clear_set_in_a_hurry_is_three_commands(self) -> None:
        vehicle = Vehicle()
        assert vehicle.executes(int_(command=SET_FAULT), now=0.0)
        assert vehicle.executes(int_(command=CLEAR_FAULTS), now=0.1)
        assert vehicle.executes(int_(command=SET_FAULT), now=0.2)

    def test_other_command_in_between_does_not_hide_a_confirmed_repetition(self) -> None:
        vehicle = Vehicle()
        assert vehicle.executes(long(command=SET_FAULT), now=0.0)
        assert vehicle.executes(long(), now=0.1)
        assert not vehicle.executes(long(command=SET_FAULT, confirmation=1), now=0.5)

    def test_pending_command_is_in_progress(self) -> None:
        vehicle = Vehicle()
        (event,) = vehicle.gets(long(), now=0.0)
        assert (event.sender, event.message.command) == (GCS, ARM)
        assert vehicle.server.messages_to_send() == []
        assert vehicle.gets(long(), now=PENDING_TIMEOUT_S - 1.0) == []
        (answer,) = sent_by(vehicle.server, MAVLink_command_ack_message)
        assert (answer.result, answer.progress) == (IN_PROGRESS, 255)

    def test_progress_is_passed_on_and_gives_more_time(self) -> None:
        vehicle = Vehicle()
        (event,) = vehicle.gets(long(), now=0.0)
        vehicle.server.finish(event.token, IN_PROGRESS, now=5.0, progress=30)
        assert vehicle.server.deadline() == 5.0 + PENDING_TIMEOUT_S
        vehicle.gets(long(confirmation=1), now=6.0)
        vehicle.server.finish(event.token, ACCEPTED, now=7.0, result_param2=-3)
        answers = sent_by(vehicle.server, MAVLink_command_ack_message)
        assert [(a.result, a.progress) for a in answers] == [
            (IN_PROGRESS, 30),
            (IN_PROGRESS, 30),
            (ACCEPTED, 0),
        ]
        assert answers[-1].result_param2 == -3
        assert vehicle.server.deadline() is None

    def test_pending_too_long_is_failed_for_good(self) -> None:
        vehicle = Vehicle()
        (event,) = vehicle.gets(long(), now=0.0)
        vehicle.server.handle_timer(PENDING_TIMEOUT_S - 0.1)
        assert vehicle.server.messages_to_send() == []
        vehicle.server.handle_timer(PENDING_TIMEOUT_S)
        vehicle.server.finish(event.token, ACCEPTED, now=PENDING_TIMEOUT_S + 0.1)
        assert vehicle.results() == [FAILED]
        assert vehicle.gets(long(confirmation=9), now=PENDING_TIMEOUT_S + 0.2) == []
        assert vehicle.results() == [FAILED]

    @pytest.mark.parametrize("target", [SystemId(0, 0), SystemId(1, 0), SystemId(0, 1), VEHICLE])
    def test_addressed_to_us(self, target: SystemId) -> None:
        assert Vehicle().gets(long(target=target), now=0.0)

    @pytest.mark.parametrize("target", [OTHER_VEHICLE, SystemId(1, 2), SystemId(2, 0)])
    def test_addressed_to_others(self, target: SystemId) -> None:
        vehicle = Vehicle()
        assert vehicle.gets(long(target=target), now=0.0) == []
        assert vehicle.server.messages_to_send() == []

    def test_other_messages_are_ignored(self) -> None:
        assert Vehicle().gets(ack(), now=0.0) == []

    def test_too_many_pending_are_turned_away(self) -> None:
        vehicle = Vehicle()
        for i in range(MAX_PENDING):
            assert vehicle.gets(long(float(i)), now=0.0)
        assert vehicle.gets(long(-1.0), now=0.0) == []
        (answer,) = sent_by(vehicle.server, MAVLink_command_ack_message)
        assert answer.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED

    def test_memory_is_bounded_and_pending_ones_stay(self) -> None:
        vehicle = Vehicle()
        (pending,) = vehicle.gets(long(0.5), now=0.0)
        for i in range(500):
            assert vehicle.executes(long(float(i)), now=0.001 * i)
        assert len(vehicle.server._records) <= 2 * MAX_PENDING
        vehicle.server.finish(pending.token, ACCEPTED, now=1.0)
        assert len(vehicle.server.messages_to_send()) == 1
