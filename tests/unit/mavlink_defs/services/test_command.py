import math
from collections import Counter

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
from hypothesis import given, settings
from hypothesis import strategies as st
from lossy_network import (
    GCS,
    OTHER_GCS,
    OTHER_VEHICLE,
    VEHICLE,
    LossyNetwork,
    over_the_wire,
)

from mavlink_defs.dialect import (
    MAVLink_command_ack_message,
    MAVLink_command_int_message,
    MAVLink_command_long_message,
)
from mavlink_defs.services.command import (
    ACK_TIMEOUT_S,
    MAX_SENDS,
    PROGRESS_TIMEOUT_S,
    CommandClient,
    CommandFinished,
    CommandMessage,
    CommandProgress,
    command_params,
)
from mavlink_defs.services.command_server import (
    LATE_S,
    CommandReceived,
    CommandServer,
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
        assert [m.confirmation for m in client.messages_to_send()] == list(range(MAX_SENDS))
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
        confirmations = [m.confirmation for m in client.messages_to_send()]
        assert confirmations == list(range(MAX_SENDS + 1))

    def test_second_answer_to_a_repeated_command_is_not_that_of_the_next(self) -> None:
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

    def test_duplicate_of_an_answer_is_not_that_of_the_next(self) -> None:
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


def test_params_of_both_forms() -> None:
    sent: CommandMessage = MAVLink_command_long_message(1, 1, ARM, 0, 1, 2, 3, 4, 5, 6, 7)
    assert command_params(sent) == (1, 2, 3, 4, 5, 6, 7)
    sent = MAVLink_command_int_message(1, 1, 0, ARM, 0, 0, 1, 2, 3, 4, 5, 2**31 - 1, 7)
    params = command_params(sent)
    assert params[:5] == (1, 2, 3, 4, 5)
    assert math.isnan(params[5])
    assert params[6] == 7


@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    loss=st.floats(0.0, 0.4),
    duplication=st.floats(0.0, 0.3),
    delay_s=st.floats(0.0, LATE_S),
    works_s=st.lists(st.sampled_from([0.0, 0.3, 2.0, 6.0, math.inf]), min_size=1, max_size=4),
    form=st.sampled_from([long, int_]),
)
def test_any_network_ends_in_one_effect_or_an_explicit_failure(
    seed: int, loss: float, duplication: float, delay_s: float, works_s: list[float], form: type
) -> None:
    network = LossyNetwork(seed, loss, duplication, delay_s)
    client, server = CommandClient(GCS), CommandServer(VEHICLE)
    gcs, vehicle = network.join(client, GCS), network.join(server, VEHICLE)
    network.join(CommandServer(OTHER_VEHICLE), OTHER_VEHICLE)
    executed: Counter[float] = Counter()
    waiting = [form(float(i)) for i in range(len(works_s))]

    def execute(event: CommandReceived, now: float) -> None:
        number = event.message.param1
        executed[number] += 1
        if math.isfinite(work_s := works_s[int(number)]):
            network.call_at(
                now + work_s, lambda: server.finish(event.token, ACCEPTED, now=network.now)
            )

    def send_next(event: CommandFinished | CommandProgress, now: float) -> None:
        if isinstance(event, CommandFinished):
            number = len(works_s) - len(waiting) - 1
            assert event.result in {ACCEPTED, FAILED, None}
            assert executed[number] >= 1 or event.result is None
            assert event.result != ACCEPTED or math.isfinite(works_s[number])
            if waiting and event.result is not None:
                client.send(waiting.pop(0), now)

    vehicle.on_event, gcs.on_event = execute, send_next
    client.send(waiting.pop(0), now=0.0)
    network.run(limit_s=40.0 * len(works_s))

    finished = [event for event in gcs.events if isinstance(event, CommandFinished)]
    assert len(finished) == len(works_s) or finished[-1].result is None
    assert form is int_ or set(executed.values()) <= {1}
    if loss == 0.0 and max(works_s) < 1.0:
        assert {event.result for event in finished} == {ACCEPTED}
