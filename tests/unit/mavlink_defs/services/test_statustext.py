from random import Random
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from lossy_network import VEHICLE, over_the_wire

from mavlink_defs.framing.frames import text_chunks
from mavlink_defs.services.statustext import CHUNK_TIMEOUT_S, Text, TextAssembler

WARNING = 4
ascii_text = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=300)


def chunks(text: str, identity: int = 5) -> list[Any]:
    return [over_the_wire(m, VEHICLE) for m in text_chunks(WARNING, text, identity)]


@given(ascii_text, st.randoms(use_true_random=False))
def test_chunks_in_any_order_make_the_text(text: str, random: Random) -> None:
    messages = chunks(text) * (1 if len(text) <= 50 else 2)
    random.shuffle(messages)
    assembler = TextAssembler()
    said = [one for message in messages for one in assembler.receive(message, 0.0)]
    assert said[0] == Text(WARNING, text)


def test_a_lost_chunk_shows() -> None:
    text = "a" * 50 + "b" * 50 + "c" * 20
    assembler = TextAssembler()
    first, _, last = chunks(text)
    assert assembler.receive(first, 0.0) == assembler.receive(last, 0.1) == []
    assert assembler.handle_timer(CHUNK_TIMEOUT_S) == []
    assert assembler.handle_timer(0.1 + CHUNK_TIMEOUT_S) == [
        Text(WARNING, "a" * 50 + "…" + "c" * 20)
    ]
    assert assembler.handle_timer(10.0) == []


def test_a_lost_last_chunk_shows() -> None:
    assembler = TextAssembler()
    assembler.receive(chunks("a" * 60)[0], 0.0)
    assert assembler.handle_timer(CHUNK_TIMEOUT_S) == [Text(WARNING, "a" * 50 + "…")]


def test_two_texts_at_a_time() -> None:
    assembler = TextAssembler()
    one, other = chunks("a" * 60, 1), chunks("b" * 60, 2)
    said = [assembler.receive(m, 0.0) for m in (one[0], other[0], one[1], other[1])]
    assert said == [[], [], [Text(WARNING, "a" * 60)], [Text(WARNING, "b" * 60)]]
