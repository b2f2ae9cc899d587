"""Text of others is shown without a single control character."""

import sys
import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from mavlink_defs.visible import visible, visible_lines

UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}


def test_every_control_character_becomes_visible() -> None:
    every = map(chr, range(sys.maxunicode + 1))
    for character in (one for one in every if unicodedata.category(one) in UNSEEN):
        shown = visible(f"a{character}b")
        assert not any(unicodedata.category(c) in UNSEEN for c in shown), repr(character)
        assert shown.encode().startswith(b"a\\"), shown


def test_escapes_match_python() -> None:
    assert visible("\x1b]0;X\x07\x9b\r\n\u202e\udc80\U000e0001") == (
        r"\x1b]0;X\x07\x9b\r\n\u202e\udc80\U000e0001"
    )


@given(st.text(st.characters(exclude_categories=("Cc", "Cf", "Cs", "Zl", "Zp"))))
def test_other_text_stays(text: str) -> None:
    assert visible(text) == text


@given(st.text(st.characters()))
def test_a_second_pass_changes_nothing(text: str) -> None:
    assert visible(visible(text)) == visible(text)
    assert visible_lines(text).split("\n") == [visible(line) for line in text.split("\n")]
