"""Going on in a campaign's folder: with more draws of the same campaign, and with no other."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from campaign_tables import campaign, results_table

from ftc_lab.campaigns.draws import draw_table
from ftc_lab.campaigns.engine import missing_rows
from ftc_lab.campaigns.findings import findings_of
from ftc_lab.campaigns.flights import Flights
from ftc_lab.campaigns.folder import open_folder
from ftc_lab.campaigns.mark import Mark, mark_of, write_mark
from ftc_lab.campaigns.plan import Plan
from ftc_lab.campaigns.store import alone_in, append_results, read_draws, results_schema
from ftc_lab.campaigns.until import stopping_condition, verdict_lines
from ftc_lab.reports.campaign import write_report
from gcs.console.errors import BadInput


def planned(draws: int, **changes: Any) -> Plan:
    """A plan that nothing flies."""
    digest = changes.pop("digest", "abc")
    scenario = changes.pop("base", {"uavs": [{"id": 1}, {"id": 2}]})
    variants = changes.pop("variants", {"a": {}, "b": {}})
    request = campaign(["a"], draws, **changes).model_copy(update={"variants": variants})
    table = draw_table(request, [1, 2])
    mark = Mark(request, "synthetic.yaml", scenario, [1, 2], "0.1.0", digest)
    schema = results_schema(table.schema, [1, 2])
    return Plan(mark, Flights(request, mark.file, {}, {}, schema), table, None)


def fly(folder: Path, plan: Plan) -> None:
    """Store a result of every row that is missing."""
    rows = plan.draws.take(missing_rows(folder, plan.draws.num_rows))
    outcomes = dict.fromkeys(["a", "b"], ["completed"] * plan.draws.num_rows)
    append_results(folder, results_table(rows, outcomes))


@pytest.mark.parametrize("design", ["random", "sobol"])
def test_a_finished_campaign_goes_on_with_more_draws(tmp_path: Path, design: str) -> None:
    for draws, before in ((2, 0), (4, 2), (8, 4)):
        plan = planned(draws, design=design)
        open_folder(tmp_path, plan)
        missing = missing_rows(tmp_path, plan.draws.num_rows)
        assert missing.tolist() == list(range(2 * before, 2 * draws))
        fly(tmp_path, plan)
        assert read_draws(tmp_path).equals(plan.draws)
    assert list(mark_of(tmp_path).extended_from) == [2, 4]
    assert mark_of(tmp_path).campaign.draws == 8
    findings = findings_of(tmp_path)
    assert findings.anytime  # whoever adds draws may have seen the results
    write_report(findings_of(tmp_path))
    assert "had 2, then 4 draws before more were added" in (tmp_path / "report.md").read_text()


def test_a_campaign_flown_at_once_was_not_extended(tmp_path: Path) -> None:
    open_folder(tmp_path, planned(4))
    open_folder(tmp_path, planned(4))
    assert not mark_of(tmp_path).extended_from
    assert "extended_from" not in (tmp_path / "request.yaml").read_text()


def test_an_extension_that_was_cut_off_is_completed(tmp_path: Path) -> None:
    """The mark was written, and the draws were not."""
    open_folder(tmp_path, planned(4))
    more = planned(8)
    write_mark(tmp_path, replace(more.mark, extended_from=(4,)))
    open_folder(tmp_path, more)
    assert read_draws(tmp_path).equals(more.draws)
    assert list(mark_of(tmp_path).extended_from) == [4]


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"draws": 2}, ["has 4 draws, and 2 are asked for"]),
        ({"seed": 8}, ["seed is 8, the folder has 7"]),
        ({"draws": 8, "seed": 8}, ["seed is 8, the folder has 7"]),
        (
            {"variants": {"a": {"trigger": {"b2_deg": 2}}, "c": {}}},
            ["variants.a.trigger.b2_deg is 2, the folder has none", "variants.b is missing"],
        ),
        (
            {"variants": {"a": {}, "b": {}}, "factors": {}, "faults": {}, "design": "grid"},
            ["design is 'grid', the folder has 'random'", "factors.mass.key is missing"],
        ),
        ({"base": {"uavs": [{"id": 1}, {"id": 3}]}}, ["base scenario: uavs[1].id is 3"]),
        ({"digest": "xyz"}, ["digest abc", "with xyz"]),
    ],
)
def test_what_differs_is_named_and_nothing_changes(
    tmp_path: Path, changes: dict[str, Any], lines: list[str]
) -> None:
    open_folder(tmp_path, planned(4))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(BadInput) as caught:
        open_folder(tmp_path, planned(**{"draws": 4} | changes))
    for line in lines:
        assert line in str(caught.value)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_design_that_does_not_begin_with_the_same_draws_is_refused(tmp_path: Path) -> None:
    open_folder(tmp_path, planned(4, design="latin_hypercube"))
    with pytest.raises(BadInput, match="latin_hypercube design of 8 does not begin with one of 4"):
        open_folder(tmp_path, planned(8, design="latin_hypercube"))
    assert mark_of(tmp_path).campaign.draws == 4


def test_draws_are_not_added_while_another_command_flies(tmp_path: Path) -> None:
    open_folder(tmp_path, planned(4))
    with alone_in(tmp_path), pytest.raises(BadInput, match="another command flies"):
        open_folder(tmp_path, planned(8))
    assert mark_of(tmp_path).campaign.draws == 4


def test_each_variant_has_its_verdict(tmp_path: Path) -> None:
    plan = planned(60)
    open_folder(tmp_path, plan)
    outcomes = {"a": ["completed"] * 60, "b": ["crashed"] * 60}
    table = results_table(plan.draws, outcomes)
    append_results(tmp_path, table.slice(0, 99))  # the last draws of both are missing
    condition = stopping_condition("p(failure) < 0.1 at 95 %", plan.mark.campaign)
    assert verdict_lines(tmp_path, condition) == [
        f"{condition}: shown for a, failure in 0 of its first 50 draws",
        f"{condition}: refuted for b, failure in 49 of its first 49 draws",
    ]
