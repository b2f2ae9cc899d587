"""The ground station's end of the command protocol, message by message."""

import pytest
from command_messages import (
    ACCEPTED,
    ARM,
    FAILED,
    IN_PROGRESS,
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

from mavlink_defs.dialect import (
    MAVLink_command_ack_message,
    MAVLink_command_long_message,
)
from mavlink_defs.services.command import (
    ACK_TIMEOUT_S,
    MAX_SENDS,
    PROGRESS_TIMEOUT_S,
    CommandClient,
    CommandFinished,
    CommandProgress,
)
from mavlink_defs.services.machine import SystemId


def run_out(client: CommandClient) -> None:
    while (at := client.deadline()) is not None:
        client.handle_timer(at)


class TestClient:
    def test_command_is_abandoned_after_max_sends(self) -> None:
        client = CommandClient(GCS)
        client.send(int_(), now=0.0)
        run_out(client)
        assert len(client.messages_to_send()) == MAX_SENDS
        client.events()
        client.send(long(), now=0.0)
        run_out(client)
        sent = sent_by(client, MAVLink_command_long_message)
        assert [m.confirmation for m in sent] == list(range(MAX_SENDS))
        assert client.events() == [CommandFinished(ARM, result=None)]
        assert not client.busy

    def test_answer_ends_it(self) -> None:
        client = CommandClient(GCS)
        client.send(long(), now=0.0)
        client.receive(ack(result=FAILED, progress=3), now=0.1)
        assert client.events() == [CommandFinished(ARM, FAILED, 3, 7)]
        assert client.deadline() is None

    @pytest.mark.parametrize(
        "foreign",
        [
            ack(command=SET_FAULT),
            ack(source=OTHER_VEHICLE),
            ack(source=SystemId(1, 2)),
            ack(target=OTHER_GCS),
            ack(target=SystemId(255, 191)),
            over_the_wire(long(), VEHICLE),
        ],
    )
    def test_foreign_answer_is_ignored(self, foreign: MAVLink_command_ack_message) -> None:
        client = CommandClient(GCS)
        client.receive(ack(), now=0.0)
        client.send(long(), now=0.0)
        client.receive(foreign, now=0.1)
        assert client.busy
        assert client.events() == []

    def test_answer_without_target_is_for_everybody(self) -> None:
        client = CommandClient(GCS)
        client.send(long(target=SystemId(0, 0)), now=0.0)
        client.receive(ack(target=SystemId(0, 0)), now=0.1)
        assert client.events() == [CommandFinished(ARM, ACCEPTED, 0, 7)]

    def test_progress_is_reported_and_extends_patience(self) -> None:
        client = CommandClient(GCS)
        client.send(long(), now=0.0)
        client.receive(ack(result=IN_PROGRESS, progress=40), now=0.1)
        client.receive(ack(result=IN_PROGRESS, progress=255), now=0.2)
        assert client.events() == [CommandProgress(ARM, 40), CommandProgress(ARM, None)]
        assert client.deadline() == 0.2 + PROGRESS_TIMEOUT_S
        run_out(client)
        sent = sent_by(client, MAVLink_command_long_message)
        assert [m.confirmation for m in sent] == list(range(MAX_SENDS + 1))

    def test_second_answer_to_a_repeated_command_does_not_answer_the_next(self) -> None:
        client = CommandClient(GCS)
        client.send(long(1.0), now=0.0)
        client.handle_timer(ACK_TIMEOUT_S)
        client.receive(ack(), now=0.6)
        client.send(long(0.0), now=0.6)
        client.receive(ack(seq=1), now=0.7)  # for the repetition of the first
        assert client.busy
        client.handle_timer(0.6 + ACK_TIMEOUT_S)
        client.receive(ack(seq=2), now=1.2)
        assert not client.busy

    def test_duplicate_of_an_answer_does_not_answer_the_next(self) -> None:
        client = CommandClient(GCS)
        client.send(long(1.0), now=0.0)
        client.receive(ack(seq=255), now=0.1)
        client.send(long(0.0), now=0.1)
        client.receive(ack(seq=255), now=0.2)
        assert client.busy
        client.receive(ack(seq=0), now=0.3)
        assert not client.busy

    def test_cancel_stops_waiting(self) -> None:
        client = CommandClient(GCS)
        client.cancel(now=0.0)
        client.send(long(), now=0.0)
        client.cancel(now=0.1)
        assert client.events() == [CommandFinished(ARM, None, cancelled=True)]
        assert client.deadline() is None

    def test_one_command_at_a_time(self) -> None:
        client = CommandClient(GCS)
        client.send(long(), now=0.0)
        with pytest.raises(RuntimeError, match="in flight"):
            client.send(long(), now=0.0)

    def test_early_timer_does_nothing(self) -> None:
        client = CommandClient(GCS)
        client.handle_timer(9.0)
        client.send(long(), now=9.0)
        client.handle_timer(9.1)
        assert len(client.messages_to_send()) == 1
