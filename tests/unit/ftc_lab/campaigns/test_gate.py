"""The gate: its rules, its tests, and what it must not let pass."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from campaign_tables import UAVS, campaign, draws_table, results_table, samples, write_campaign
from typer.testing import CliRunner

from ftc_lab.campaigns.gate import DEFAULT, Check, gate, parse_rules
from ftc_lab.campaigns.samples import Sample, same_draws, samples_of
from gcs.commands.cli import app
from gcs.console.errors import BadInput

GOOD = ["completed"] * 40


def lost(count: int, outcome: str = "attitude_lost", of: int = 40) -> list[str]:
    return [outcome] * count + ["completed"] * (of - count)


def checked(old: dict[str, Sample], new: dict[str, Sample], *rules: str) -> list[Check]:
    return gate(old, new, parse_rules(rules or [DEFAULT], [*old.values(), *new.values()]))


def test_equal_campaigns_pass() -> None:
    old = samples({"a": lost(3), "b": GOOD})
    rules = (DEFAULT, "worse iae_roll at 95 %", "worse saving at 95 %", "worse p(failure) at 99 %")
    assert not any(check.violated for check in checked(old, old, *rules))


@pytest.mark.parametrize("outcome", ["heading_lost", "attitude_lost", "model_left", "crashed"])
def test_new_failures_of_any_kind_close_the_gate(outcome: str) -> None:
    [check] = checked(samples({"a": GOOD}), samples({"a": lost(8, outcome)}))
    assert check.violated
    assert "success in 32 of 40 flights, was 40 of 40; worse in 8 draws, better in 0" in check.text
    assert "the same 40 draws; p = 0.00391" in check.text  # 1 / 2⁸


def test_an_event_counts_worse_outcomes_and_says_so() -> None:
    new = samples({"a": lost(2, "ground")})
    rules = "p(heading_lost) > 0.5 at 95 %", "worse p(heading_lost) at 95 %"
    absolute, relative = checked(samples({"a": GOOD}), new, *rules)
    assert "heading_lost or worse in 2 of 40 flights; p is" in absolute.text
    assert "heading_lost or worse in 2 of 40 flights, was 0 of 40" in relative.text


def test_fewer_failures_are_not_worse() -> None:
    [check] = checked(samples({"a": lost(8)}), samples({"a": GOOD}))
    assert not check.violated


def test_few_new_failures_may_be_chance() -> None:
    [check] = checked(samples({"a": GOOD}), samples({"a": lost(4)}))
    assert not check.violated  # p = 1 / 2⁴
    [check] = checked(samples({"a": GOOD}), samples({"a": lost(5)}))
    assert check.violated  # p = 1 / 2⁵


def test_the_level_is_shared_by_the_variants() -> None:
    old, new = samples({"a": GOOD, "b": GOOD}), samples({"a": lost(5), "b": GOOD})
    assert [check.violated for check in checked(old, new)] == [False, False]  # 1 / 2⁵ > 2.5 %
    assert "limit 0.025" in checked(old, new)[0].text


def test_a_figure_may_get_worse_without_a_failure() -> None:
    draws = draws_table(["a"], 40)
    iae = results_table(draws, {"a": GOOD})["uav2.iae_roll"].to_numpy()
    old, new = samples({"a": GOOD}), samples({"a": GOOD}, **{"uav2.iae_roll": 1.05 * iae})
    by_name = {
        rule: checked(old, new, f"worse {rule} at 99 %")[0].violated
        for rule in ("uav2.iae_roll", "iae_roll", "uav1.iae_roll", "p(success)")
    }
    assert by_name == {
        "uav2.iae_roll": True,
        "iae_roll": True,
        "uav1.iae_roll": False,
        "p(success)": False,
    }
    [better] = checked(new, old, "worse uav2.iae_roll at 99 %")
    assert not better.violated


def test_a_lower_saving_is_worse() -> None:
    old = samples({"a": GOOD}, saving=np.linspace(0.8, 0.9, 40))
    new = samples({"a": GOOD}, saving=np.linspace(0.7, 0.8, 40))
    assert checked(old, new, "worse saving at 95 %")[0].violated
    assert not checked(new, old, "worse saving at 95 %")[0].violated


def test_a_failure_is_worse_than_the_best_figure() -> None:
    """Lost flights are short: the small integrals of their errors must not look good."""
    small = np.where(np.arange(40) < 8, 0.01, 10.0)
    old = samples({"a": GOOD}, **{"uav1.iae_roll": np.full(40, 10.0)})
    new = samples({"a": lost(8)}, **{"uav1.iae_roll": small})
    [check] = checked(old, new, "worse uav1.iae_roll at 95 %")
    assert check.violated
    assert "8 of 40 draws with a failure" in check.text


def test_a_missing_figure_is_not_left_out() -> None:
    old = samples({"a": GOOD}, **{"uav1.iae_roll": [1.0] * 40})
    new = samples({"a": GOOD}, **{"uav1.iae_roll": [None] * 8 + [1.0] * 32})
    for figure in ("uav1.iae_roll", "iae_roll"):
        assert np.isinf(new["a"].cost(figure)[:8]).all()
    assert checked(old, new, "worse uav1.iae_roll at 95 %")[0].violated


def test_other_draws_are_compared_without_pairs() -> None:
    old = samples({"a": GOOD})
    draws = draws_table(["a"], 40, seed=8)
    new = samples_of(results_table(draws, {"a": lost(6)}), "memory")
    assert same_draws(old["a"], new["a"]) is None
    [check] = checked(old, new)
    assert check.violated
    assert "Fisher's exact test, different draws" in check.text
    assert "Mann and Whitney's" in checked(old, new, "worse iae_yaw at 95 %")[0].text


def test_one_changed_value_makes_other_draws() -> None:
    table = results_table(draws_table(["a"], 40), {"a": GOOD})
    old = samples_of(table, "memory")["a"]
    mass = table["factor.mass"].to_pylist()
    changed = table.set_column(
        table.column_names.index("factor.mass"), "factor.mass", [[*mass[:-1], mass[-1] + 1e-12]]
    )
    assert same_draws(old, samples_of(changed, "memory")["a"]) is None
    assert same_draws(old, samples_of(table.slice(0), "memory")["a"]) is not None


def test_flights_without_a_partner_are_counted() -> None:
    old = samples({"a": GOOD})
    new = {"a": old["a"].take(np.arange(30))}
    [check] = checked(old, new)
    assert "the same 30 draws (10 flights without a partner left out)" in check.text


def test_a_requirement_needs_evidence() -> None:
    new = samples({"a": lost(4)})
    [met, broken] = checked(
        new, new, "p(attitude_lost) > 0.05 at 95 %", "p(attitude_lost) > 0.03 at 95 %"
    )
    assert not met.violated  # 4 of 40: at least 3.5 % at 95 %, one-sided
    assert broken.violated
    assert "at least 0.0349" in broken.text


@pytest.mark.parametrize(
    ("rules", "messages"),
    [
        (["better p(success) at 95 %"], ["expected 'p(EVENT) < NUMBER at NUMBER %'"]),
        (["worse iae_roll"], ["expected 'worse FIGURE at NUMBER %'"]),
        (["worse iae_roll at 95"], ["expected 'worse FIGURE at NUMBER %'"]),
        (["worse p(lost) at 95 %"], ["'lost' is no event, expected one of success, failure"]),
        (["worse iae_rol at 95 %"], ["no figure 'iae_rol'"]),
        (["worse min_interval_s at 95 %"], ["no figure 'min_interval_s'"]),
        (["worse iae_roll at 20 %"], ["confidence_percent: expected [50, 100) %, got 20.0"]),
        (["worse nothing at 95 %", "p(x) < 2 at 95 %"], ["'nothing'", "'x'", "got 2.0"]),
    ],
)
def test_every_bad_rule_is_named(rules: list[str], messages: list[str]) -> None:
    with pytest.raises(BadInput) as caught:
        parse_rules(rules, samples({"a": GOOD}).values())
    for message in messages:
        assert message in str(caught.value)
    assert caught.value.hint


def test_a_flight_that_is_there_twice_is_refused() -> None:
    table = results_table(draws_table(["a"], 40), {"a": GOOD})
    with pytest.raises(BadInput, match="row 3 more than once"):
        samples_of(table.take([*range(40), 3]), "memory")


# the command


def folder(path: Path, outcomes: dict[str, list[str]], flown: int | None = None) -> str:
    names, draws = list(outcomes), len(next(iter(outcomes.values())))
    planned = draws_table(names, draws)
    results = results_table(planned, outcomes).slice(0, flown)
    return str(write_campaign(path, campaign(names, draws), planned, results))


def test_the_command_writes_what_ci_reads(tmp_path: Path) -> None:
    old = folder(tmp_path / "old", {"a": GOOD, "b": GOOD})
    new = folder(tmp_path / "new", {"a": GOOD, "b": lost(12)})
    junit, markdown = tmp_path / "gate.xml", tmp_path / "gate.md"
    files = ["--junit", str(junit), "--markdown", str(markdown)]
    done = CliRunner().invoke(app, ["compare", old, new, *files])
    assert done.exit_code == 1, done.output
    assert "passed  a: worse p(success) at 95 %" in done.output
    assert "FAILED  b: worse p(success) at 95 %" in done.output
    assert "both were flown by the same code" in done.output
    [suite] = ET.parse(junit).getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    a, b = suite.iter("testcase")
    assert (a.get("classname"), a.find("failure")) == ("a", None)
    failure = b.find("failure")
    assert failure is not None
    assert "worse in 12 draws" in str(failure.get("message"))
    assert "**1 of 2 checks failed.**" in markdown.read_text()
    assert CliRunner().invoke(app, ["compare", new, old]).exit_code == 0


def test_half_a_campaign_is_not_compared(tmp_path: Path) -> None:
    old = folder(tmp_path / "old", {"a": GOOD})
    new = folder(tmp_path / "new", {"a": GOOD}, flown=30)
    done = CliRunner().invoke(app, ["compare", old, new])
    assert isinstance(done.exception, BadInput)
    assert f"{new} has 30 of 40 planned flights" in str(done.exception)


def test_a_variant_cannot_disappear(tmp_path: Path) -> None:
    old = folder(tmp_path / "old", {"a": GOOD, "b": GOOD})
    new = folder(tmp_path / "new", {"a": GOOD})
    done = CliRunner().invoke(app, ["compare", old, new])
    assert isinstance(done.exception, BadInput)
    assert "has no flights of b" in str(done.exception)


def test_a_folder_of_something_else_is_bad_input(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["compare", str(tmp_path), str(tmp_path)])
    assert isinstance(done.exception, BadInput)


def test_two_campaigns_by_different_laws_mark_what_the_simpler_one_does_better(
    tmp_path: Path,
) -> None:
    def flown(name: str, law: str, roll: float, seed: int = 7) -> str:
        draws = draws_table(["a"], 40, seed)
        figures = {f"uav{k}.iae_filtered_roll": np.full(40, roll) for k in UAVS}
        results = results_table(draws, {"a": GOOD}, figures)
        request = campaign(["a"], 40, variants={"a": {"controller": {"kind": law}}})
        return str(write_campaign(tmp_path / name, request, draws, results))

    simple, later = flown("simple", "pid", 2.0), flown("later", "tube", 3.0)
    markdown = tmp_path / "gate.md"
    for old, new, cells in (
        (simple, later, "| 2.00, 2.00 | **3.00**, **3.00** |"),
        (later, simple, "| **3.00**, **3.00** | 2.00, 2.00 |"),
    ):
        done = CliRunner().invoke(app, ["compare", old, new, "--markdown", str(markdown)])
        assert "3.00*, 3.00*" in done.output
        assert "a, of 40 draws" in done.output
        assert cells in markdown.read_text()
    for other in (flown("other draws", "pid", 2.0, seed=8), flown("same law", "tube", 2.0)):
        assert "*" not in CliRunner().invoke(app, ["compare", other, later]).output
