"""The report of a campaign: what it counts, what it says of it, and what it draws."""

import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign_tables import UAVS, campaign, draws_table, results_table, write_campaign

from ftc_lab.campaigns.findings import Findings, findings_of
from ftc_lab.campaigns.importance import Importance
from ftc_lab.campaigns.until import is_decided, note_condition, stopping_condition
from ftc_lab.figures.campaign import distributions, importance, sobol_indices, two_factors
from ftc_lab.reports.campaign import campaign_report, write_report
from gcs.console.errors import BadInput

pytestmark = pytest.mark.slow

DRAWS = 60
MANY = [*["crashed", "attitude_lost", "attitude_lost", "failed"], *["completed"] * (DRAWS - 4)]
GOOD = ["completed"] * DRAWS


def written(
    folder: Path,
    outcomes: dict[str, list[str]],
    flown: list[int] | None = None,
    figures: dict[str, Any] | None = None,
    **changes: Any,
) -> Findings:
    """A campaign in a folder; `flown` are the rows that have results."""
    draws = draws_table(list(outcomes), DRAWS)
    results = results_table(draws, outcomes, figures)
    if flown is not None:
        results = results.take(np.array(flown, dtype=int))
    write_campaign(folder, campaign(list(outcomes), DRAWS, **changes), draws, results)
    return findings_of(folder)


def rows_of(report: str, heading: str) -> list[list[str]]:
    """The rows of the first table below a heading, without its head."""
    section = report.partition(f"## {heading}\n")[2].partition("\n## ")[0]
    lines = re.findall(r"^\| (.*) \|$", section, re.MULTILINE)
    return [line.split(" | ") for line in lines[2:]]


def report_of(findings: Findings) -> str:
    """The text of a report, without its figures, which take a second to draw."""
    return campaign_report(findings, {})


def drawn_report_of(findings: Findings) -> str:
    write_report(findings)
    return (findings.folder / "report.md").read_text()


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Findings:
    return written(tmp_path_factory.mktemp("mixed") / "a b", {"good": GOOD, "bad": MANY})


@pytest.fixture(scope="module")
def text(mixed: Findings) -> str:
    return drawn_report_of(mixed)


def test_every_flight_is_counted_as_what_it_was(text: str) -> None:
    good, bad = rows_of(text, "Success")
    assert good[:10] == ["`good`", "60", "60", *["0"] * 7]
    assert bad[:10] == ["`bad`", "60", "56", "0", "2", "0", "0", "0", "1", "1"]
    assert good[10:] == ["100.0 % [94.0 %, 100.0 %]", "95.1 %"]  # 0.025^(1/60), 0.05^(1/60)
    assert bad[10].startswith("93.3 % [83.8 %, 98.2 %]")


def test_failures_are_above_every_figure(text: str) -> None:
    rows = {(row[0], row[1]): row[2:] for row in rows_of(text, "Tracking and events")}
    assert rows["IAE of roll [deg s]", "`good`"][2] == "0"
    assert rows["IAE of roll [deg s]", "`bad`"][1:] == ["-", "4"]  # no 95/95 bound any more
    assert rows["IAE of roll [deg s]", "`good`"][1] != "-"


def test_variants_are_compared_on_the_same_draws(text: str) -> None:
    row = rows_of(text, "Variants on the same draws")[0]
    assert row[:4] == ["`bad`", "60", "0", "4"]
    assert row[4].startswith("0.0 % [0.0 %, 60.2 %]")  # 1 - 0.025^(1/4)
    assert row[5:7] == ["0.12", "0.75"]  # McNemar: 2 / 2⁴; Holm: six times the smallest
    assert "over all 6 tests" in text


def test_all_draws_come_first_and_survivors_apart(tmp_path: Path) -> None:
    """Lost in its ten hardest draws and little worse in the others."""
    lost = np.arange(DRAWS) < 10
    iae = [value for hard in lost for value in ((500.0, 1.0) if hard else (10.0, 11.0))]
    columns = {f"uav{k}.iae_roll": iae for k in UAVS}
    outcomes = {"old": GOOD, "new": ["attitude_lost" if each else "completed" for each in lost]}
    text = report_of(written(tmp_path, outcomes, figures=columns))
    section = text.partition("## Variants on the same draws")[2].partition("\n## ")[0]
    everything, _, survivors = section.partition("### Of the draws that both survived")
    [row] = [line for line in everything.splitlines() if "IAE of roll" in line]
    assert row.startswith("| `new` | IAE of roll [deg s] | 60 | 60 | 0 | 100.0 % [94.0 %, 100.0 %]")
    assert "mean" not in everything
    [row] = [line for line in survivors.splitlines() if "IAE of roll" in line]
    assert "| 50 of 60 | 1 [1, 1] | 1 [1, 1] |" in row


def test_the_worst_flights_come_with_a_command_that_flies_them(mixed: Findings, text: str) -> None:
    rows = rows_of(text, "The worst flights")
    assert [row[3] for row in rows[:5]] == [
        "failed",
        "crashed",
        "attitude lost",
        "attitude lost",
        "completed",
    ]
    assert len(rows) == 10
    arguments = shlex.split(rows[0][0].strip("`"))
    assert arguments == ["gcs", "fly", "--campaign", str(mixed.folder), "--row", "7"]
    errors = [float(row[4]) for row in rows[4:]]
    assert errors == sorted(errors, reverse=True)


def test_a_lost_flight_that_ended_soonest_is_worst(tmp_path: Path) -> None:
    ends = np.where(np.arange(DRAWS) == 2, 3.0, 9.0)
    found = written(tmp_path, {"bad": MANY}, figures={"duration_s": ends}).worst(4)
    assert [each.draw for each in found] == [3, 0, 2, 1]


def test_the_page_needs_no_other_file(mixed: Findings, text: str) -> None:
    page = (mixed.folder / "report.html").read_text()
    assert len(re.findall(r'src="data:image/png', page)) == 3
    assert 'src="figures' not in page
    assert text.count("![") == 3
    for name in ("distributions", "importance", "two_factors"):
        for suffix in ("png", "svg"):
            assert (mixed.folder / "figures" / f"{name}.{suffix}").stat().st_size > 1000


def test_the_report_is_the_same_each_time(mixed: Findings, text: str) -> None:
    files = [mixed.folder / "report.html", *(mixed.folder / "figures").iterdir()]
    before = [path.read_bytes() for path in files]
    assert drawn_report_of(mixed) == text
    assert [path.read_bytes() for path in files] == before


def test_reasons_are_shown_as_they_are(tmp_path: Path) -> None:
    reasons = ["", "<b>5 | 6</b>\n![x](y)", *[""] * (DRAWS - 2)]
    outcome = ["completed", "model_left", *["completed"] * (DRAWS - 2)]
    findings = written(tmp_path, {"a": outcome}, figures={"reason": reasons})
    drawn_report_of(findings)
    page = (tmp_path / "report.html").read_text()
    assert "&lt;b&gt;5 | 6&lt;/b&gt; ![x](y)" in page


def test_what_has_not_been_flown_is_said(tmp_path: Path) -> None:
    """Row 20, of draw 10, is missing: later draws of its variant do not count yet."""
    flown = [row for row in range(100) if row != 20]
    findings = written(tmp_path, {"good": GOOD, "bad": MANY}, flown)
    assert [len(own) for own in findings.counted.values()] == [10, 50]
    report = report_of(findings)
    assert "99 of 120 planned flights" in report
    assert "21 planned flights have not been flown" in report
    assert "Statistics leave out 39 flights" in report
    assert [row[1] for row in rows_of(report, "Success")] == ["10", "50"]


def test_a_report_of_no_flights_says_so(tmp_path: Path) -> None:
    findings = written(tmp_path, {"good": GOOD}, [])
    assert "0 of 60 planned flights" in report_of(findings)


def test_all_flights_may_fail(tmp_path: Path) -> None:
    report = report_of(written(tmp_path, {"a": ["crashed"] * DRAWS, "b": GOOD}))
    assert rows_of(report, "Success")[0][10].startswith("0.0 % [0.0 %, 6.0 %]")


def test_flights_of_different_code_are_reported(tmp_path: Path) -> None:
    digests = ["abc"] * 59 + ["def"]
    report = report_of(written(tmp_path, {"a": GOOD}, figures={"digest": digests}))
    assert "**The flights were flown by different code.**" in report


def test_a_grid_has_no_probabilities(tmp_path: Path) -> None:
    choice = {"kind": "choice", "values": [0.9, 1.0]}
    factors = {name: {"key": "aircraft.mass_kg", "draw": choice} for name in ("mass", "idle")}
    report = report_of(written(tmp_path, {"a": GOOD, "b": MANY}, design="grid", factors=factors))
    for row in rows_of(report, "Success"):
        assert "[" not in row[10]
        assert row[11] == "-"
    assert "not probabilities" in report
    assert "McNemar" not in report


def test_a_saltelli_design_has_sobol_indices_and_no_intervals(tmp_path: Path) -> None:
    """Three factors, 16 points: five flights each."""
    draws = draws_table(["a"], 80)
    x = np.random.default_rng(2).uniform(size=(16, 6))
    points = np.stack(
        [
            [a, *([*a[:k], b[k], *a[k + 1 :]] for k in range(3)), b]
            for a, b in zip(x[:, :3], x[:, 3:], strict=True)
        ]
    ).reshape(-1, 3)
    for k, name in enumerate(("mass", "cl_alpha", "idle")):
        at = draws.column_names.index(f"factor.{name}")
        draws = draws.set_column(at, f"factor.{name}", [points[:, k]])
    cost = 1.0 + points[:, 1] + 0.1 * points[:, 0]
    iaes = {f"uav{k}.iae_{q}": cost for k in UAVS for q in ("airspeed", "roll", "pitch", "yaw")}
    request = campaign(["a"], 16, design="saltelli")
    write_campaign(tmp_path, request, draws, results_table(draws, {"a": ["completed"] * 80}, iaes))
    findings = findings_of(tmp_path)
    [(what, found)] = findings.sobol("a").items()
    assert what == "tracking error"  # no flight failed: failure has no variance
    assert found[0].factor == "factor.cl_alpha"
    report = drawn_report_of(findings)
    assert "first-order index" in report
    assert "not probabilities" in report
    figure = sobol_indices(findings)
    assert figure is not None
    [panel] = figure.axes
    assert panel.get_yticklabels()[0].get_text() == "cl_alpha"
    bars = [bar.get_width() for bar in panel.patches]  # type: ignore[attr-defined]  # rectangles
    assert bars == [each.total for each in found]
    assert (tmp_path / "figures" / "sobol.svg").exists()


def test_a_campaign_that_could_be_stopped_has_other_intervals(tmp_path: Path) -> None:
    findings = written(tmp_path, {"a": GOOD})
    fixed = rows_of(report_of(findings), "Success")[0][10]
    condition = stopping_condition("p(failure) < 0.1 at 95 %", findings.mark.campaign)
    assert is_decided(tmp_path, findings.mark.campaign, condition)
    note_condition(tmp_path, condition)
    note_condition(tmp_path, condition)
    findings = findings_of(tmp_path)
    assert findings.until == [str(condition)]
    report = report_of(findings)
    assert (fixed, rows_of(report, "Success")[0][10]) == (
        "100.0 % [94.0 %, 100.0 %]",
        "100.0 % [91.1 %, 100.0 %]",  # 0.05 C(120, 60) / 4⁶⁰ = 0.911⁶⁰
    )
    assert f"| `{condition}` | `a` | 0 | 60 | shown |" in report


def test_a_condition_is_decided_when_it_is_for_every_variant(tmp_path: Path) -> None:
    outcomes = {"a": GOOD, "b": GOOD}
    half = written(tmp_path / "half", outcomes, list(range(0, 120, 2)))  # one variant only
    condition = stopping_condition("p(failure) < 0.1 at 95 %", half.mark.campaign)
    assert not is_decided(half.folder, half.mark.campaign, condition)
    whole = written(tmp_path / "whole", outcomes)
    assert is_decided(whole.folder, whole.mark.campaign, condition)
    unclear = stopping_condition("p(failure) < 0.01 at 95 %", whole.mark.campaign)
    assert not is_decided(whole.folder, whole.mark.campaign, unclear)


def test_only_independent_draws_may_be_stopped() -> None:
    for design in ("latin_hypercube", "sobol"):
        with pytest.raises(BadInput, match=design):
            stopping_condition("p(failure) < 0.1 at 95 %", campaign(["a"], 8, design=design))


# figures


def test_curves_end_at_the_share_that_succeeded(mixed: Findings) -> None:
    for panel in distributions(mixed).axes[:5]:
        lines = panel.get_lines()
        ends = {str(line.get_label()): float(np.asarray(line.get_ydata())[-1]) for line in lines}
        assert ends == pytest.approx({"good": 1.0, "bad": 56 / 60})


def test_every_flight_is_a_point_and_failures_are_crosses(mixed: Findings) -> None:
    assert sobol_indices(mixed) is None
    figure = two_factors(mixed)
    assert figure is not None
    for panel, failed in zip(figure.axes, (0, 4), strict=True):
        good, bad = panel.collections
        points = [len(np.asarray(drawn.get_offsets())) for drawn in (good, bad)]
        assert points == [DRAWS - failed, failed]
        assert panel.get_title("right") == f"{failed} of 60 failed"


def test_the_factor_that_matters_is_named_first(mixed: Findings) -> None:
    figure = importance(mixed)
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels[0] == "mass"  # the figures of these tables grow with it


def test_a_bar_of_no_length_has_no_direction(
    mixed: Findings, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = [Importance("mass", 0.4, -0.4, 0.1, 60), Importance("drag", 0.0, 0.0, 1.0, 60)]
    both = {"failure": own, "tracking error": own}
    monkeypatch.setattr(Findings, "importances", lambda *_: both)
    for panel in importance(mixed).axes:
        assert [text.get_text() for text in panel.texts] == ["−", "−"]  # of two variants


def test_a_uav_that_a_variant_lacks_is_no_failure(tmp_path: Path) -> None:
    alone = np.arange(2 * DRAWS) % 2 == 0
    columns = {
        name: [None if lacks else 7.0 for lacks in alone]
        for name in (f"uav2.iae_{q}" for q in ("airspeed", "roll", "pitch", "yaw"))
    }
    findings = written(tmp_path, {"alone": GOOD, "two": GOOD}, figures=columns)
    assert np.isfinite(findings.counted["alone"].cost("iae_roll")).all()
    assert np.isinf(findings.counted["alone"].cost("uav2.iae_roll")).all()


# laws


def laws_of(folder: Path, outcomes: dict[str, list[str]], iae: list[float], **variants: Any) -> str:
    """The section on laws of a report; `iae` is of the flights in the order of their rows."""
    columns = {f"uav{k}.iae_filtered_roll": iae for k in UAVS}
    kinds = {name: {"controller": {"kind": name}} for name in outcomes} | variants
    return laws_in(report_of(written(folder, outcomes, figures=columns, variants=kinds)))


def laws_in(report: str) -> str:
    return report.partition("## Laws on the same flights\n")[2].partition("\n## ")[0]


def iae_row(section: str) -> list[str]:
    [line] = re.findall(r"^\| IAE of roll .*$", section, re.MULTILINE)
    return [cell.strip() for cell in line.strip("|").split("|")][1:]


def test_what_a_simpler_law_does_better_is_bold(tmp_path: Path) -> None:
    section = laws_of(tmp_path, {"tube": GOOD, "pid": GOOD}, [3.0, 2.0] * DRAWS)
    assert iae_row(section) == ["2.00, 2.00", "**3.00**, **3.00**"]  # the simplest law first
    assert "`pid` | `tube`" in section
    assert "No simpler law" not in section
    write_report(findings_of(tmp_path))
    assert "<strong>3.00</strong>" in (tmp_path / "report.html").read_text()


def test_a_law_that_was_lost_early_is_not_the_better_one(tmp_path: Path) -> None:
    lost = ["ground"] * 40 + GOOD[40:]
    section = laws_of(tmp_path, {"tube": lost, "pid": GOOD}, [0.1, 2.0] * DRAWS)
    assert iae_row(section) == ["2.00, 2.00", "**lost**, **lost**"]
    assert "| flights that failed | 0 | **40** |" in section
    section = laws_of(tmp_path / "other", {"tube": GOOD, "pid": lost}, [2.0, 0.1] * DRAWS)
    assert iae_row(section) == ["lost, lost", "2.00, 2.00"]


def test_only_variants_that_fly_the_same_are_compared(tmp_path: Path) -> None:
    noisy = {"controller": {"kind": "tube"}, "sensors": {"gyro_deg_s": {"noise_rms": 0.3}}}
    slow = {"controller": {"kind": "surviving", "reference_bandwidth_rad_s": 1.0}}
    names = {"pid": GOOD, "tube": GOOD, "noisy": GOOD, "slow": GOOD}
    section = laws_of(tmp_path, names, [2.0, 3.0, 9.0, 9.0] * DRAWS, noisy=noisy, slow=slow)
    assert iae_row(section) == ["2.00, 2.00", "**3.00**, **3.00**"]
    assert "No simpler law flew the same as noisy, slow; to add one" in section


def test_only_draws_that_all_laws_have_flown_are_compared(tmp_path: Path) -> None:
    """The simpler law has not flown the hard draws yet."""
    iae = [value for k in range(DRAWS) for value in ((2.0, 2.0) if k < 30 else (2.0, 50.0))]
    outcomes = {"pid": GOOD, "tube": GOOD}
    found = written(
        tmp_path,
        outcomes,
        flown=[row for row in range(2 * DRAWS) if row % 2 or row < 60],
        figures={f"uav{k}.iae_filtered_roll": iae for k in UAVS},
        variants={name: {"controller": {"kind": name}} for name in outcomes},
    )
    section = laws_in(report_of(found))
    assert "of 30 draws" in section
    assert iae_row(section) == ["2.00, 2.00", "2.00, 2.00"]


def test_a_campaign_without_a_simpler_law_says_how_to_add_one(tmp_path: Path) -> None:
    section = laws_of(tmp_path, {"surviving": GOOD}, [2.0] * DRAWS)
    assert "No simpler law flew the same as surviving" in section
    assert "kind: pid" in section
    assert laws_of(tmp_path / "pid", {"pid": GOOD}, [2.0] * DRAWS) == ""


def test_laws_that_are_drawn_fly_different_draws(tmp_path: Path) -> None:
    """Whether a law, or what else was drawn, made the difference is not known."""
    choice = {"kind": "choice", "values": ["pid", "tube"]}
    factors = {name: {"key": "controller.kind", "draw": choice} for name in ("mass", "idle")}
    outcomes = {"a": GOOD, "b": GOOD}
    report = report_of(written(tmp_path, outcomes, design="grid", factors=factors))
    assert "Laws on the same flights" not in report
