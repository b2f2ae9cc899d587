"""Both ends of the command protocol."""

import math
from collections import Counter

from command_messages import (
    ACCEPTED,
    ARM,
    FAILED,
    int_,
    long,
)
from hypothesis import given
from hypothesis import strategies as st
from lossy_network import (
    GCS,
    OTHER_VEHICLE,
    VEHICLE,
    LossyNetwork,
)

from mavlink_defs.dialect import (
    MAVLink_command_int_message,
    MAVLink_command_long_message,
)
from mavlink_defs.services.command import (
    CommandClient,
    CommandFinished,
    CommandMessage,
    CommandProgress,
    command_params,
)
from mavlink_defs.services.command_server import LATE_S, CommandReceived, CommandServer


def test_params_of_both_forms() -> None:
    sent: CommandMessage = MAVLink_command_long_message(1, 1, ARM, 0, 1, 2, 3, 4, 5, 6, 7)
    assert command_params(sent) == (1, 2, 3, 4, 5, 6, 7)
    sent = MAVLink_command_int_message(1, 1, 0, ARM, 0, 0, 1, 2, 3, 4, 5, 2**31 - 1, 7)
    params = command_params(sent)
    assert params[:5] == (1, 2, 3, 4, 5)
    assert math.isnan(params[5])
    assert params[6] == 7


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
