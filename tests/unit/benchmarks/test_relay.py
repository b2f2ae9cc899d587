"""The relay's benchmark runs, and nothing gets lost in it."""

import pytest

from benchmarks.relay import LINKS, microseconds


@pytest.mark.parametrize("link", LINKS)
def test_a_datagram_costs_something_and_all_arrive(link: str) -> None:
    assert microseconds(LINKS[link], peers=3, rounds=20) > 0.0
