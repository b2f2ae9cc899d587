"""The impairment machine: statistics, conservation, reproducibility, identity."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.impairer import Impairer
from mavlink_defs import dialect
from mavlink_defs.capture.impairing import MEMORY
from mavlink_defs.capture.impairment import Bursts, Impairment, Outage
from mavlink_defs.config.files import validate
from mavlink_defs.config.models import ConfigError
from mavlink_defs.framing.frames import FramePacker

N = 4000
shares = st.floats(0.0, 1.0)
impairments = st.builds(
    Impairment,
    seed=st.integers(0, 2**63 - 1),
    loss=shares,
    bursts=st.none() | st.builds(Bursts, begin=shares, end=st.floats(0.01, 1.0), loss=shares),
    duplicate=shares,
    delay_ms=st.floats(0.0, 100.0),
    jitter_ms=st.floats(0.0, 100.0),
    reorder=shares,
    reorder_ms=st.floats(1.0, 100.0),
    bit_errors=st.sampled_from([0.0, 5e-324, 1e-12, 1e-3, 0.5]),
    outages=st.lists(
        st.builds(Outage, from_s=st.just(1.0), to_s=st.floats(1.5, 9.0)), max_size=1
    ).map(tuple),
)
traffic = st.lists(st.tuples(st.floats(0.0, 10.0), st.binary(max_size=30)), max_size=40).map(
    lambda sent: sorted(sent, key=lambda s: s[0])
)


def numbered(n: int = N) -> list[bytes]:
    return [i.to_bytes(4) for i in range(n)]


def fates(impairment: Impairment, datagrams: list[bytes], path: str = "a") -> list[bool]:
    """Whether each datagram was delivered."""
    impairer = Impairer(impairment, path)
    return [bool(impairer.send(d, 0.0)) for d in datagrams]


@given(impairments, traffic)
def test_every_datagram_is_delivered_dropped_or_doubled_as_counted(impairment, sent) -> None:
    impairer = Impairer(impairment, "a")
    arrived = [a for at, datagram in sent for a in impairer.send(datagram, at)]
    fate = impairer.fate
    assert fate.taken == len(sent)
    assert len(arrived) == fate.delivered == len(sent) - fate.lost - fate.outage + fate.duplicated
    assert fate.damaged <= len(arrived)
    assert fate.reordered <= len(arrived)


@given(impairments, traffic)
def test_nothing_arrives_early_and_damage_keeps_the_length(impairment, sent) -> None:
    impairer = Impairer(impairment, "a")
    for at, datagram in sent:
        for due_s, arrived in impairer.send(datagram, at):
            assert due_s >= at + impairment.delay_ms / 1e3
            assert math.isfinite(due_s)
            assert len(arrived) == len(datagram)
            assert impairment.bit_errors or arrived == datagram


@given(impairments, traffic)
def test_the_same_seed_gives_the_same_and_another_direction_something_else(
    impairment, sent
) -> None:
    def run(path: str) -> list[list[tuple[float, bytes]]]:
        impairer = Impairer(impairment, path)
        return [impairer.send(datagram, at) for at, datagram in sent]

    assert run("plant/to") == run("plant/to")
    half = Impairment(seed=impairment.seed, loss=0.5)
    assert fates(half, numbered(100), "to") != fates(half, numbered(100), "from")


@given(traffic)
def test_no_impairment_is_the_identity(sent) -> None:
    impairer = Impairer(Impairment(), "a")
    assert [impairer.send(datagram, at) for at, datagram in sent] == [
        [(at, datagram)] for at, datagram in sent
    ]


@given(impairments.map(lambda i: i.model_copy(update={"reorder": 0.0})), traffic)
def test_delay_and_jitter_alone_keep_the_order(impairment, sent) -> None:
    impairer = Impairer(impairment, "a")
    due = [due_s for at, datagram in sent for due_s, _ in impairer.send(datagram, at)]
    assert due == sorted(due)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("share", [0.01, 0.1, 0.4])
@pytest.mark.parametrize("key", ["loss", "duplicate", "reorder"])
def test_shares_are_as_asked_for(key: str, share: float, seed: int) -> None:
    for datagrams in (numbered(), [b"always the same"] * N):
        impairer = Impairer(Impairment.model_validate({"seed": seed, key: share}), "a")
        for datagram in datagrams:
            impairer.send(datagram, 0.0)
        fate = impairer.fate
        count = {"loss": fate.lost, "duplicate": fate.duplicated, "reorder": fate.reordered}[key]
        assert abs(count - N * share) < 4.5 * math.sqrt(N * share * (1 - share))


def test_bursts_have_the_length_and_the_loss_of_their_chain() -> None:
    bursts = Bursts(begin=0.02, end=0.25)
    lost = [not ok for ok in fates(Impairment(bursts=bursts), numbered(20_000))]
    begun = sum(now and not before for before, now in zip([False, *lost], lost, strict=False))
    assert sum(lost) / begun == pytest.approx(1 / 0.25, rel=0.15)
    assert sum(lost) / len(lost) == pytest.approx(0.02 / (0.02 + 0.25), rel=0.15)


@pytest.mark.parametrize("share", [1e-3, 0.2])
def test_bit_errors_are_as_many_as_asked_for(share: float) -> None:
    impairer = Impairer(Impairment(bit_errors=share), "a")
    flipped = 0
    for i in range(400):
        sent = i.to_bytes(2) * 50
        ((_, arrived),) = impairer.send(sent, 0.0)
        flipped += sum((a ^ b).bit_count() for a, b in zip(sent, arrived, strict=True))
    assert flipped == pytest.approx(400 * 800 * share, rel=0.2)
    assert impairer.fate.damaged == pytest.approx(400 * (1 - (1 - share) ** 800), rel=0.2)


def test_reordered_datagrams_are_overtaken() -> None:
    impairer = Impairer(Impairment(reorder=0.1, reorder_ms=5.0), "a")
    arrivals = [a for i, d in enumerate(numbered(500)) for a in impairer.send(d, i * 1e-3)]
    order = [d for _, d in sorted(arrivals)]
    assert order != numbered(500)
    assert sorted(order) == numbered(500)


def test_nothing_passes_during_an_outage_by_its_own_clock() -> None:
    impairer = Impairer(Impairment(outages=(Outage(from_s=3.0, to_s=5.0),)), "a")
    passed = [bool(impairer.send(b"x", 100.0 + t, t)) for t in (2.9, 3.0, 4.9, 5.0)]
    assert passed == [True, False, False, True]
    assert impairer.fate.outage == 2


def test_more_loss_loses_the_same_and_more() -> None:
    some = fates(Impairment(loss=0.1), numbered())
    more = fates(Impairment(loss=0.2), numbered())
    assert all(a or not b for a, b in zip(some, more, strict=True))
    assert sum(more) < sum(some)


def test_the_fate_of_a_message_does_not_depend_on_its_number_or_what_came_before() -> None:
    """Lossy lockstep flights are repeatable, though their start takes any number of messages."""
    message = dialect.MAVLink_ftc_step_done_message

    def lost(heartbeats: int) -> list[bool]:
        speaker = FramePacker(1, 1)
        impairer = Impairer(Impairment(loss=0.3), "a")
        for _ in range(heartbeats):
            impairer.send(speaker.pack(dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)), 0.0)
        return [bool(impairer.send(speaker.pack(message(k)), 0.0)) for k in range(300)]

    assert lost(0) == lost(7)


def test_memory_is_bounded() -> None:
    impairer = Impairer(Impairment(loss=0.1), "a")
    most = 0
    for datagram in numbered(3 * MEMORY):
        impairer.send(datagram, 0.0)
        most = max(most, int(np.count_nonzero(impairer._directions.contents)))
    assert most == MEMORY


def test_wrong_values_are_named() -> None:
    wrong = {
        "loss": 1.5,
        "delay": 3,
        "bursts": {"begin": 0.1},
        "outages": [{"from_s": 3, "to_s": 3}],
    }
    with pytest.raises(ConfigError) as caught:
        validate("a.yaml", wrong, Impairment)
    text = str(caught.value)
    assert "loss: expected [0, 1], got 1.5" in text
    assert "delay: unknown key; did you mean 'delay_ms'?" in text
    assert "bursts.end: missing" in text
    assert "outages[0].to_s: expected > from_s = 3.0 s, got 3.0" in text
