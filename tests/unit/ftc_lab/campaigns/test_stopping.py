"""The condition of `--until`: its language, and its error however often one looks."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import betainc
from scipy.stats import beta

from ftc_lab.campaigns.conditions import EVENTS, Condition, happened, parse_condition
from ftc_lab.campaigns.statistics import proportion
from ftc_lab.campaigns.stopping import anytime_proportion, evidence, judge, leading
from ftc_lab.campaigns.store import OUTCOMES
from gcs.console.errors import BadInput

LOST = parse_condition("p(attitude_lost) < 0.05 at 95 %", "--until")
BAD = "'p(EVENT) < NUMBER at NUMBER %'"


def outcomes(good: int, bad: int) -> np.ndarray:
    return np.array(["completed"] * good + ["attitude_lost"] * bad, dtype=object)


@given(
    st.sampled_from(EVENTS),
    st.sampled_from("<>"),
    st.floats(1e-6, 0.999),
    st.floats(50.0, 99.999),
)
def test_a_condition_reads_as_it_is_written(
    event: str, relation: str, probability: float, confidence: float
) -> None:
    found = parse_condition(f" p({event}){relation} {probability!r} at {confidence!r} %", "--until")
    assert found == Condition(
        event=event, relation=relation, probability=probability, confidence_percent=confidence
    )
    text = str(found)
    assert parse_condition(text, "--until").event == event


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("", [BAD]),
        ("p(attitude_lost) < 0.05", [BAD]),
        ("attitude_lost < 0.05 at 95 %", [BAD]),
        ("p(lost) < 0.05 at 95 %", ["event: expected 'success'", "got 'lost'"]),
        ("p(crashed) <= 0.05 at 95%", ["relation: expected '<' or '>', got '<='"]),
        (
            "p(lost) <= 5 at 100 %",
            ["event:", "relation:", "probability: expected (0, 1)", "confidence_percent:"],
        ),
        ("p(crashed) < few at 95 %", ["probability: expected a number, got 'few'"]),
        ("p(crashed) < nan at 95 %", ["probability: expected"]),
    ],
)
def test_every_problem_of_a_condition_is_named(text: str, messages: list[str]) -> None:
    with pytest.raises(BadInput) as caught:
        parse_condition(text, "--until")
    for message in messages:
        assert message in str(caught.value)
    assert "--until" in str(caught.value)
    assert LOST.event in caught.value.hint


def test_an_event_counts_what_is_worse_too() -> None:
    every = np.array(OUTCOMES, dtype=object)
    assert list(happened("attitude_lost", every)) == [False, False, *[True] * 7]
    assert list(happened("ground", every)) == [*[False] * 3, *[True] * 6]
    assert list(happened("success", every)) == [True] + [False] * 8
    assert list(happened("failure", every)) == [False] + [True] * 8
    with pytest.raises(ValueError, match="landed"):
        happened("success", np.array(["landed"], dtype=object))


@pytest.mark.parametrize(("count", "flights", "bound"), [(0, 10, 0.05), (3, 40, 0.2), (9, 12, 0.5)])
def test_the_evidence_is_the_mixture_that_it_is_said_to_be(
    count: int, flights: int, bound: float
) -> None:
    def density(p: float) -> float:
        return 1.0 / math.sqrt(p * (1.0 - p)) / math.pi / betainc(0.5, 0.5, bound)

    def ratio(p: float) -> float:
        return (p / bound) ** count * ((1 - p) / (1 - bound)) ** (flights - count)

    mixture, _ = quad(lambda p: ratio(p) * density(p), 0.0, bound)
    assert math.exp(evidence(count, flights, bound, "<")) == pytest.approx(mixture, rel=1e-6)


def test_the_evidence_is_a_martingale_at_the_bound() -> None:
    for flights in range(30):
        for count in range(flights + 1):
            now = math.exp(evidence(count, flights, 0.3, "<"))
            one = math.exp(evidence(count + 1, flights + 1, 0.3, "<"))
            none = math.exp(evidence(count, flights + 1, 0.3, "<"))
            assert 0.3 * one + 0.7 * none == pytest.approx(now, rel=1e-9)


def test_it_takes_more_flights_than_a_single_check() -> None:
    first = next(n for n in range(1000) if judge(LOST, outcomes(n, 0)).decided == "shown")
    assert first == 74  # docs/explanation/campaign-statistics.md; 59 with one look


def test_a_condition_can_be_refuted() -> None:
    assert judge(LOST, outcomes(5, 20)).decided == "refuted"
    assert judge(LOST, outcomes(2, 0)).decided == "open"
    assert judge(LOST, outcomes(0, 0)).decided == "open"


@pytest.mark.parametrize("p", [0.05, 0.08])
def test_a_false_statement_is_rare_however_often_one_checks(p: float) -> None:
    random, rounds, looks, condition = np.random.default_rng(2), 2000, 400, LOST
    counts = (random.random((rounds, looks)) < p).cumsum(axis=1)
    enough = -math.log(condition.error)
    bounds = [  # most events with which it is shown after each flight
        next((k for k in range(n, -1, -1) if evidence(k, n, 0.05, "<") >= enough), -1)
        for n in range(1, looks + 1)
    ]
    wrong = (counts <= np.array(bounds)).any(axis=1).mean()
    assert wrong <= 0.05
    if p == 0.05:  # one test after the other without correction, for comparison
        n, k = np.arange(1, looks + 1)[:, None], np.arange(looks)
        high = beta.ppf(0.95, k + 1, np.maximum(n - k, 1e-9))  # Clopper and Pearson's, one-sided
        naive = ((high < 0.05) & (k < n)).sum(axis=1) - 1
        assert (counts <= naive).any(axis=1).mean() > 0.08


@pytest.mark.parametrize("p", [0.02, 0.3])
def test_all_intervals_of_a_campaign_hold_together(p: float) -> None:
    random, rounds, looks = np.random.default_rng(4), 300, 200
    missed = 0
    for _ in range(rounds):
        counts = (random.random(looks) < p).cumsum()
        at = range(9, looks, 10)
        intervals = [anytime_proportion(int(counts[n]), n + 1) for n in at]
        missed += any(not each.low <= p <= each.high for each in intervals)
    assert missed <= 0.05 * rounds


@given(st.integers(0, 60), st.integers(0, 60))
def test_an_anytime_interval_is_wider_than_one_of_a_single_check(good: int, bad: int) -> None:
    wide, narrow = anytime_proportion(bad, good + bad), proportion(bad, good + bad)
    assert wide.low <= narrow.low + 1e-12
    assert wide.high >= narrow.high - 1e-12


def test_flights_after_a_gap_do_not_count_yet() -> None:
    assert list(leading(np.array([4, 1, 0, 2]))) == [2, 1, 3]
    assert list(leading(np.array([1, 2]))) == []
    assert list(leading(np.array([], dtype=int))) == []


def test_what_finishes_first_is_no_fair_sample() -> None:
    """Lost flights end sooner: counted as they finish, they are too many."""
    random = np.random.default_rng(6)
    lost = random.random(400) < 0.03
    finished_at = np.arange(400) // 20 + np.where(lost, 0.1, 12.0)
    first = np.flatnonzero(finished_at <= 13.0)
    assert lost[first].mean() > 2.0 * lost.mean()
    fair = first[leading(first)]
    assert list(fair) == list(range(len(fair)))
