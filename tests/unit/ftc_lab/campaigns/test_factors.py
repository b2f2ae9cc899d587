"""Severities of faults: what is pooled means the same, whatever kinds and actuators are drawn."""

from pathlib import Path

import numpy as np
import pytest
from campaign_tables import campaign, results_table, write_campaign
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from ftc_lab.campaigns.draws import draw_table
from ftc_lab.campaigns.factors import title_of, unit_of
from ftc_lab.campaigns.findings import Findings, findings_of
from ftc_lab.campaigns.importance import importances
from ftc_lab.campaigns.samples import Sample, samples_of
from ftc_lab.figures.campaign import two_factors
from ftc_lab.reports.campaign import write_report
from gcs.scenario.model import load_scenario

DRAWS = 150
MAX_VALUES = {"loss": 1.0, "bias": 0.4, "stuck": 0.3}
ACTUATORS = ("rudder", "throttle")


def drawn_faults(largest: dict[str, float] = MAX_VALUES, **changes: object) -> dict[str, object]:
    kinds = {k: {"kind": "uniform", "low": -high, "high": high} for k, high in largest.items()}
    start = {"kind": "uniform", "low": 1.0, "high": 2.0}
    return {"any": {"kinds": kinds, "start_s": start, "actuators": ACTUATORS} | changes}


def flown(
    offset: dict[str, float], largest: dict[str, float] = MAX_VALUES, **changes: object
) -> Sample:
    """Flights whose cost grows with the size of the fault, for each kind from an offset on."""
    draws = draw_table(campaign(["a"], DRAWS, faults=drawn_faults(largest, **changes)), [1, 2])
    kinds, sizes = draws["fault.any.kind"].to_pylist(), np.abs(draws["fault.any.severity"])
    cost = sizes + [offset[kind] for kind in kinds]
    table = results_table(draws, {"a": ["completed"] * DRAWS}, {"uav1.iae_roll": cost})
    return samples_of(table, "memory")["a"]


@given(
    st.permutations(sorted(MAX_VALUES)),
    st.lists(st.floats(0.05, 1.0), min_size=3, max_size=3),
    st.floats(0.0, 20.0),
)
def test_where_larger_faults_are_worse_of_each_kind_no_factor_says_the_contrary(
    kinds: list[str], largest: list[float], step: float
) -> None:
    sizes = dict(zip(kinds, largest, strict=True))
    flights = flown({kind: step * k for k, kind in enumerate(kinds)}, largest=sizes)
    found = importances(flights.factors(), {"cost": flights.cost("uav1.iae_roll")})["cost"]
    severities = [each for each in found if ".severity" in each.factor]
    assert len(severities) == 5  # one of loss; of bias and stuck two each, throttle and surfaces
    for each in severities:
        assert each.correlation == pytest.approx(1.0)


def test_pooled_severities_would_have_the_other_sign() -> None:
    """Loss has the largest numbers and harms least: the paradox that the test above excludes."""
    flights = flown({"loss": 0.0, "bias": 2.0, "stuck": 4.0}, largest={**MAX_VALUES, "stuck": 0.1})
    pooled = stats.spearmanr(
        np.abs(flights.numbers("fault.any.severity")), flights.cost("uav1.iae_roll")
    )
    assert pooled.statistic < -0.3
    assert pooled.pvalue < 1e-3


def test_each_severity_is_of_its_kind_and_limit_and_every_flight_is_in_one() -> None:
    flights = flown(dict.fromkeys(MAX_VALUES, 0.0))
    kind, actuator = (flights.texts(f"fault.any.{part}") for part in ("kind", "actuator"))
    found = {n.partition("[")[2]: v for n, v in flights.factors() if "severity" in n}
    meant = {
        "loss]": kind == "loss",
        **{
            f"{k} {name}]": (kind == k) & ((actuator == "throttle") == (name == "throttle"))
            for k in ("bias", "stuck")
            for name in ("surface", "throttle")
        },
    }
    assert found.keys() == meant.keys()
    for name, values in found.items():
        assert np.array_equal(~np.isnan(values), meant[name])
    sizes = np.abs(flights.numbers("fault.any.severity"))
    assert np.array_equal(np.nansum(list(found.values()), axis=0), sizes)


def test_actuators_with_one_limit_share_a_severity() -> None:
    for own in (["rudder", "aileron"], ["throttle"]):
        flights = flown(dict.fromkeys(MAX_VALUES, 0.0), actuators=own)
        names = [name for name, _ in flights.factors() if "severity" in name]
        assert names == [f"fault.any.severity[{kind}]" for kind in sorted(MAX_VALUES)]


def test_names_have_units() -> None:
    scenario = load_scenario("paper/scenario1")
    keys = {
        "trigger.b2_deg": "deg",
        "aircraft.mass_kg": "kg",
        "uavs[0].initial.pitch_deg": "deg",
        "faults[0].start_s": "s",
        "controller.kind": "",
        "uncertainty.coefficients.cD0": "",
        "no.such[3].key": "",
    }
    assert {key: unit_of(scenario, key) for key in keys} == keys
    assert title_of("mass", "kg") == title_of("factor.mass", "kg") == "mass [kg]"
    assert title_of("fault.left.start_s") == "fault left: onset [s]"
    assert title_of("fault.left.severity[loss]") == "fault left: loss [share of command]"
    assert title_of("fault.left.severity[stuck throttle]") == (
        "fault left: stuck throttle [share of limit]"
    )


# the report


def reported(folder: Path, largest: dict[str, float]) -> Findings:
    request = campaign(["a"], DRAWS, faults=drawn_faults(largest))
    draws = draw_table(request, [1, 2])
    kinds = np.array(draws["fault.any.kind"].to_pylist())
    lost = (kinds != "loss") & (np.abs(draws["fault.any.severity"]) > 0.2)
    outcomes = ["attitude_lost" if each else "completed" for each in lost]
    write_campaign(folder, request, draws, results_table(draws, {"a": outcomes}))
    write_report(findings_of(folder))
    return findings_of(folder)


def test_the_report_has_severities_by_kind(tmp_path: Path) -> None:
    findings = reported(tmp_path, MAX_VALUES)
    text = (tmp_path / "report.md").read_text()
    assert r"fault any: stuck surface \[share of limit\] +0." in text
    assert "flights)" in text
    assert "fault.any" not in text
    pair = findings.most_important_pair()
    assert pair is not None
    x, y = (findings.counted["a"].factor(name) for name in pair)
    both = np.isfinite(x) & np.isfinite(y)
    assert both.any()
    figure = two_factors(findings)
    assert figure is not None
    points = [len(np.asarray(drawn.get_offsets())) for drawn in figure.axes[0].collections]
    assert sum(points) == both.sum()
    assert [figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()] == [
        findings.title(name) for name in pair
    ]


def test_factors_that_no_flight_has_together_are_not_drawn_over_each_other(tmp_path: Path) -> None:
    start = {"kind": "choice", "values": [1.0]}
    request = campaign(["a"], DRAWS, factors={}, faults=drawn_faults(start_s=start))
    draws = draw_table(request, [1, 2])
    draws = draws.append_column("factor.mass", [np.ones(draws.num_rows)])
    sizes = np.abs(draws["fault.any.severity"])
    outcomes = {"a": ["attitude_lost" if each > 0.2 else "completed" for each in sizes]}
    write_campaign(tmp_path, request, draws, results_table(draws, outcomes))
    findings = findings_of(tmp_path)
    assert findings.most_important_pair() is None
    assert two_factors(findings) is None
