"""Planning a campaign: what a row means, and every mistake before the first flight."""

import math
import re
from pathlib import Path
from typing import Any

import pytest
from campaign_flights import MASS, campaign_tree, planned, write_campaign

from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.surviving import Surviving
from ftc_lab.campaigns.distributions import Choice
from ftc_lab.campaigns.model import load_campaign
from ftc_lab.campaigns.plan import load_plan, plan, row_of, rows_of
from gcs.scenario.bundled import SCENARIOS
from gcs.scenario.model import load_scenario
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.yaml_text import yaml_of

LOSS = {"loss": {"kind": "choice", "values": [0.25]}}


def at(value: Any) -> dict[str, Any]:
    return {"kind": "choice", "values": [value]}


def uniform(low: float, high: float) -> dict[str, Any]:
    return {"kind": "uniform", "low": low, "high": high}


def faulty(**keys: Any) -> dict[str, Any]:
    fault = {"uavs": [3], "actuators": ["rudder"], "kinds": LOSS, "start_s": at(5)}
    return {"factors": {}, "faults": {"f": fault | keys}, "variants": {"v": {"faults": []}}}


def message(tmp_path: Path, **changes: Any) -> str:
    path = write_campaign(tmp_path, **changes)
    with pytest.raises(ConfigError) as caught:
        load_plan(path)
    text = str(caught.value)
    assert all(re.match(rf"{re.escape(str(path))}(:\d+)?: ", line) for line in text.splitlines())
    return re.sub(rf"^{re.escape(str(path))}(:\d+)?: ", "", text, flags=re.MULTILINE)


def test_problems_name_the_line_that_has_the_value(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(
        "name: c\nscenario: paper/scenario1\ndraws: 2\nfactors:\n"
        "  uncertainty.mass: {draw: {kind: uniform, low: -2, high: -1}}\n"
        "variants:\n  a:\n    trigger:\n      b2_deg: -3\n  b: {nonsense: 3}\n"
    )
    with pytest.raises(ConfigError) as caught:
        load_plan(path)
    lines = [line.removeprefix(f"{path}:") for line in str(caught.value).splitlines()]
    places = ["9: variants.a.trigger.b2_deg", "10: variants.b.nonsense", "5: factors"]
    for place in places:
        assert any(line.startswith(place) for line in lines), lines
    path.write_text("name: c\nscenario: secret\ndraws: 2\n")
    (tmp_path / "secret").write_text("name: x\npassword: hunter2\n")
    with pytest.raises(ConfigError) as caught:
        load_plan(path)
    assert f"{path}:2: scenario: {tmp_path / 'secret'}:2: unknown key" in str(caught.value)
    assert "password" not in str(caught.value)


def test_a_row_is_a_scenario_with_its_values() -> None:
    key = "uavs[2].initial.altitude_m"
    campaign = planned(factors=MASS | {"other": {"key": key, "draw": uniform(90.0, 110.0)}})
    for row in rows_of(campaign.draws):
        scenario = campaign.flights.scenario(row)
        assert scenario.uncertainty.mass == row["factor.uncertainty.mass"]
        assert scenario.uavs[2].initial.altitude_m == row["factor.other"]
        assert scenario.duration_s == 0.01


def test_a_relative_factor_multiplies_what_the_variant_has() -> None:
    variants = {"one": {}, "two": {"uavs": planned().flights.trees["short"]["uavs"]}}
    variants["two"]["uavs"][0]["initial"]["airspeed_m_s"] = 50.0
    key = "uavs[0].initial.airspeed_m_s"
    factors = {"v": {"key": key, "draw": at(0.9), "relative": True}}
    campaign = planned(factors=factors, variants=variants)
    for row, expected in zip(rows_of(campaign.draws), (40.0 * 0.9, 50.0 * 0.9), strict=False):
        assert campaign.flights.scenario(row).uavs[0].initial.airspeed_m_s == expected


def test_every_uav_of_every_variant_has_columns() -> None:
    trees = planned().flights.trees
    fewer = {"uavs": trees["short"]["uavs"][:2], "network": {"edges": []}, "faults": []}
    fewer["network"]["leader_access"] = {1: 1.0, 2: 1.0, 3: None}
    fewer["uavs"][1]["id"], fewer["network"]["leader_access"][9] = 9, 1.0
    fewer["network"]["leader_access"][2] = None
    names = planned(variants={"all": {}, "fewer": fewer}).flights.schema.names
    assert {f"uav{k}.iae_roll" for k in (1, 2, 3, 9)} <= set(names)


def test_a_choice_of_whole_numbers_stays_whole() -> None:
    campaign = planned(factors={"step_us": {"draw": at(2000)}})
    assert campaign.flights.scenario(row_of(campaign.draws, 0)).step_us == 2000


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({}, {"effectiveness": 0.75}),
        ({"kinds": {"bias": at(-0.2)}}, {"bias_deg": -7.0}),
        ({"kinds": {"stuck": at(-0.2)}}, {"stuck_deg": -7.0}),
        ({"kinds": {"bias": at(-0.2)}, "actuators": ["throttle"]}, {"bias_n": -400.0}),
        ({"kinds": {"stuck": at(-0.2)}, "actuators": ["throttle"]}, {"stuck_n": 400.0}),
        ({"lasts_s": at(2.5)}, {"effectiveness": 0.75, "end_s": 7.5}),
        ({"kinds": {"drift": at(-0.2)}}, {"drift_deg_s": -7.0}),
        ({"kinds": {"hardover": at(-0.2)}, "actuators": ["throttle"]}, {"hardover_n": 400.0}),
        (
            {"kinds": {"intermittent": at(0.2)}, "frequency_hz": at(1.5)},
            {"intermittent_deg": 7.0, "frequency_hz": 1.5},
        ),
    ],
)
def test_a_drawn_fault_is_a_fault_of_the_scenario(
    keys: dict[str, Any], expected: dict[str, Any]
) -> None:
    campaign = planned(**faulty(**keys))
    (fault,) = campaign.flights.scenario(row_of(campaign.draws, 0)).faults
    actuator = keys.get("actuators", ["rudder"])[0]
    assert fault.model_dump(exclude_defaults=True) == pytest.approx(
        {"uav": 3, "actuator": actuator, "start_s": 5.0, **expected}
    )


@pytest.mark.parametrize(
    ("severity", "stuck_deg"), [(-0.5, -10.0), (0.5, 15.0), (-1.0, -20.0), (1.0, 30.0)]
)
@pytest.mark.parametrize("own", [False, True])
def test_a_drawn_fault_is_a_share_of_the_stop_on_its_side(
    tmp_path: Path, severity: float, stuck_deg: float, own: bool
) -> None:
    """Of the scenario's aircraft, or of one that the UAV has for itself."""
    limits = {"rudder": [-20.0, 30.0]}
    uavs = load_scenario("paper/scenario1").model_dump()["uavs"]
    changes: dict[str, Any] = {"aircraft": {"surface_limits_deg": limits}}
    if own:
        paper = load_scenario("paper/scenario1").aircraft.model_dump()
        uavs[2]["aircraft"] = paper | {"surface_limits_deg": limits}
        changes = {"uavs": uavs}
    (tmp_path / "s.yaml").write_text(yaml_of({"extends": "paper/scenario1", **changes}))
    keys = faulty(kinds={"stuck": at(severity)}) | {"scenario": str(tmp_path / "s.yaml")}
    campaign = planned(**keys)
    (fault,) = campaign.flights.scenario(row_of(campaign.draws, 0)).faults
    assert fault.model_dump()["stuck_deg"] == pytest.approx(stuck_deg)


def test_a_campaign_cannot_draw_faults_of_a_rudder_that_is_not_there(tmp_path: Path) -> None:
    keys = {"scenario": "airframes/mixed", "variants": {"v": {"faults": []}}, "factors": {}}
    drawn = {"actuators": ["aileron", "rudder"], "kinds": LOSS, "start_s": at(5)}
    text = message(tmp_path, faults={"f": drawn}, **keys)
    assert text == "faults.f.actuators[1]: the aircraft of UAV 2 has no rudder"
    load_plan(write_campaign(tmp_path, faults={"f": drawn | {"uavs": [1, 3]}}, **keys))


def test_every_mistake_of_a_file_is_named(tmp_path: Path) -> None:
    text = message(
        tmp_path,
        seed=-1,
        draws=None,
        factors={
            "a": {"draw": uniform(2.0, 1.0)},
            "b": {"draw": {"kind": "normal", "mean": 1.0}},
            "c": {"draw": {"kind": "beta"}},
            "d": {"draws": uniform(0.0, 1.0)},
            "trigger.b2_deq": {"draw": uniform(0.1, 1.0)},
            "trigger.b1": {"draw": uniform(0.1, 1.0)},
        },
        faults={"f": faulty(uavs=[7])["faults"]["f"]},
        variants={"v": {"duration": 1.0}, "w": {}},
        keep={"worst": -1},
    )
    for part in (
        "seed: expected",
        "draws: missing",
        "factors.a.draw.high: expected > low = 2.0, got 1.0",
        "factors.b.draw.deviation: missing",
        "factors.c.draw.kind: expected one of 'uniform'",
        "factors.d.draws: unknown key; did you mean 'draw'?",
        "factors.a: a: unknown key",
        "factors.c: c: unknown key",
        "factors.trigger.b2_deq: trigger.b2_deq: unknown key; did you mean",
        "factors.trigger.b1.draw: with its end 1.0, trigger.b1: expected [0, 1)",
        "faults.f.uavs[0]: expected one of the UAVs 1, 2, 3, got 7",
        "variants.v.duration: unknown key; did you mean 'duration_s'?",
        "keep.worst: expected >= 0, got -1",
    ):
        assert part in text, text
    assert "duration_s: " not in text, text  # which stands in for what was left out


def test_an_unknown_key_hides_no_other_mistake(tmp_path: Path) -> None:
    """Of the file, of a factor, of a fault and of the only variant."""
    normal = {"kind": "normal", "mean": 0.0, "deviation": 1.0}
    text = message(
        tmp_path,
        drows=5,
        factors={
            "uncertainty.mass": {"draw": normal},
            "uncertainty.mas": {"draw": uniform(0.8, 1.2)},
            "b1": {"key": "trigger.b1", "draw": uniform(2.0, 1.0) | {"mid": 3.0}},
        },
        faults={"f": faulty(uavs=[7])["faults"]["f"] | {"when": 3.0}},
        keep={"worst": 1, "figurs": []},
    )
    for part in (
        "drows: unknown key; did you mean 'draws'?",
        "factors.uncertainty.mas: uncertainty.mas: unknown key",
        "factors.b1.draw.mid: unknown key",
        "factors.b1.draw.high: expected > low = 2.0",
        "faults.f.when: unknown key",
        "faults.f.uavs[0]: expected one of the UAVs 1, 2, 3, got 7",
        "keep.figurs: unknown key",
        "keep.figures: missing",
    ):
        assert text.count(part) == 1, text


def test_draws_are_checked_beside_other_mistakes(tmp_path: Path) -> None:
    normal = {"kind": "normal", "mean": 0.0, "deviation": 1.0}
    factors = {
        "uncertainty.mass": {"draw": normal},
        "trigger.b1": {"draw": uniform(0.1, 1.0), "relativ": True},
    }
    text = message(tmp_path, factors=factors, draws=50, drows=1)
    assert "factors.uncertainty.mass: draw " in text
    assert "factors.trigger.b1.relativ: unknown key" in text
    assert "factors.trigger.b1.draw: with its end 1.0" in text
    assert len(text.splitlines()) == 4


def test_factors_are_checked_although_no_variant_is_right(tmp_path: Path) -> None:
    factors = {"uncertainty.mas": {"draw": uniform(0.8, 1.2)}}
    text = message(tmp_path, factors=factors, variants={"v": {"duration": 1.0}})
    assert "variants.v.duration: unknown key" in text
    assert "factors.uncertainty.mas: uncertainty.mas: unknown key" in text


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"factors": {}}, "factors: missing"),
        ({"draws": None}, "draws: missing"),
        ({"design": "sobol", "draws": 10}, "draws: expected a power of two with sobol, got 10"),
        ({"design": "grid", "draws": None}, "expected kind 'choice' in a grid, got 'uniform'"),
        ({"keep": {"worst": 1}}, "keep.figures: missing"),
        ({"keep": {"figures": ["uav9.iae_roll"]}}, "keep.figures[0]: expected a column of numbers"),
        ({"keep": {"figures": ["outcome"]}}, "got 'outcome'"),
        (faulty(kinds={"loss": uniform(0.5, 1.5)}), "faults.f.kinds.loss: draws 1.5"),
        (faulty(start_s=uniform(-1, 1)), "faults.f.start_s: draws -1.0, expected within [0, inf]"),
        (faulty(uavs=[3, 7]), "faults.f.uavs[1]: expected one of the UAVs 1, 2, 3, got 7"),
        ({"variants": {"v": {"duration": 1.0}}}, "variants.v.duration: unknown key"),
        ({"scenario": "paper/scenario11"}, "did you mean paper/scenario1"),
    ],
)
def test_a_mistake_is_named_with_its_place(
    tmp_path: Path, changes: dict[str, Any], reason: str
) -> None:
    assert reason in message(tmp_path, **changes)


@pytest.mark.parametrize(
    ("key", "factor", "reason"),
    [
        ("trigger.b2_deq", {"draw": uniform(1.0, 2.0)}, "did you mean 'b2_deg'"),
        ("faults[7].start_s", {"draw": uniform(1.0, 2.0)}, "a list of more than 7"),
        ("uncertainty.mass", {"draw": uniform(0.0, 1.0)}, "end 0.0, uncertainty.mass: expected >"),
        ("trigger.mode", {"draw": at("sometimes")}, "value 'sometimes', trigger.mode: expected"),
        ("trigger.mode", {"draw": at(1.5), "relative": True}, "expected a number in the scenario"),
        ("no.such", {"draw": at(1.5), "relative": True}, "no.such: no such key"),
    ],
)
def test_a_factor_that_fits_no_key_is_named(
    tmp_path: Path, key: str, factor: dict[str, Any], reason: str
) -> None:
    text = message(tmp_path, factors=MASS | {"bad": {"key": key, **factor}})
    assert "factors.bad" in text
    assert reason in text
    assert "factors.uncertainty.mass" not in text


def test_draws_without_a_scenario_are_counted_with_their_factor(tmp_path: Path) -> None:
    """A normal distribution has no ends to check, but values."""
    normal = {"kind": "normal", "mean": 0.0, "deviation": 1.0}
    text = message(tmp_path, draws=50, factors={"uncertainty.mass": {"draw": normal}})
    (line,) = text.splitlines()
    assert line.startswith("factors.uncertainty.mass: draw ")
    assert "uncertainty.mass: expected > 0, got -" in line
    assert "more draws)" in line


def test_factors_that_go_wrong_together_are_named(tmp_path: Path) -> None:
    ends = {"Jxx": (0.1, 1.0), "Jxz": (1.0, 5.0)}
    factors = {f"uncertainty.inertia.{j}": {"draw": uniform(*by)} for j, by in ends.items()}
    text = message(tmp_path, factors=factors, draws=40)
    assert "factors.uncertainty.inertia.Jxx, uncertainty.inertia.Jxz: draw" in text
    assert "not positive definite" in text


def test_problems_are_capped(tmp_path: Path) -> None:
    faults = {f"f{k}": faulty()["faults"]["f"] for k in range(30)}
    text = message(tmp_path, factors={}, faults=faults, variants={"v": {"faults": []}})
    assert 20 <= len(text.splitlines()) <= 22
    assert "overlaps faults[0]" in text


def test_impairments_of_links_are_refused(tmp_path: Path) -> None:
    scenario = tmp_path / "wire.yaml"
    scenario.write_text("extends: paper/scenario1\nlinks: {impairments: {plant: {}}}\n")
    assert "campaigns fly in process" in message(tmp_path, scenario="wire.yaml")


@pytest.mark.parametrize(
    "name", sorted(path.stem for path in (SCENARIOS / "campaigns").glob("*.yaml"))
)
def test_shipped_campaigns_can_be_flown(name: str) -> None:
    path = SCENARIOS / "campaigns" / f"{name}.yaml"
    campaign = load_campaign(path)
    short = campaign.model_copy(update={"draws": 4})
    points = 4
    if campaign.design == "saltelli":
        points = 4 * (len(campaign.factors) + 2)
    elif campaign.design == "grid":
        choices = [one.draw for one in campaign.factors.values() if isinstance(one.draw, Choice)]
        points = math.prod(len(one.values) for one in choices)
    assert plan(short, path).draws.num_rows == points * len(campaign.variants)


def test_the_campaign_of_guidance_can_be_flown() -> None:
    path = SCENARIOS / "campaigns" / "guidance.yaml"
    campaign = load_campaign(path)
    assert plan(campaign, path).draws.num_rows == 2 * len(campaign.variants)


def test_the_autopilots_of_a_campaign_follow_from_its_variants() -> None:
    """What a variant leaves open, as the servos that a diagnosis models, its flights know, too."""
    path = SCENARIOS / "campaigns" / "stuck_surface.yaml"
    campaign = plan(load_campaign(path, draws=1), path)
    for row in rows_of(campaign.draws):
        law = campaign.flights.scenario(row).autopilot_config(3).controller
        assert isinstance(law, Surviving)
        assert law.diagnosis.servo_lag_s == (0.02 if row["variant"].endswith("_real") else 0.0)


@pytest.mark.parametrize("name", ["uncertainty", "faults"])
def test_shipped_campaigns_are_for_all_laws(name: str) -> None:
    campaign = load_campaign(SCENARIOS / "campaigns" / f"{name}.yaml")
    assert set(campaign.variants) == set(LAWS)


def test_the_shipped_uncertainty_is_of_everything() -> None:
    from sitl_plant.airframe.config import Coefficients, Inertia

    of_the_paper = Coefficients.model_fields.items()  # no factor makes anything of a zero
    path = SCENARIOS / "campaigns" / "uncertainty.yaml"
    keys = {name.removeprefix("uncertainty.") for name in load_campaign(path).factors}
    assert keys == {
        "mass",
        *(f"inertia.{name}" for name in Inertia.model_fields),
        *(f"coefficients.{name}" for name, key in of_the_paper if key.is_required()),
    }


def test_a_campaign_is_no_scenario_and_a_scenario_no_campaign() -> None:
    with pytest.raises(ConfigError, match=r"faults\.yaml: a campaign, not a scenario"):
        load_scenario("campaigns/faults")
    with pytest.raises(ConfigError, match=r"two_uavs\.yaml: a scenario, not a campaign"):
        load_campaign(SCENARIOS / "faults" / "two_uavs.yaml")


def test_the_example_of_the_docs_can_be_flown(tmp_path: Path) -> None:
    page = (SCENARIOS.parent / "docs" / "how-to" / "campaigns.md").read_text()
    path = tmp_path / "my.yaml"
    path.write_text(page.partition("```yaml\n")[2].partition("```")[0])
    campaign = plan(load_campaign(path), path)
    assert campaign.draws.num_rows == 400
    gust = campaign.flights.values(row_of(campaign.draws, 0))["disturbance.acceleration_m_s2.y.sin"]
    assert gust == 0.1 * campaign.draws.column("factor.gust")[0].as_py()


def test_a_tree_of_the_helper_is_a_campaign(tmp_path: Path) -> None:
    assert load_campaign(write_campaign(tmp_path)).name == campaign_tree()["name"]


def test_a_factor_named_as_no_key_hears_of_key(tmp_path: Path) -> None:
    hint = "factors.gust: gust: unknown key; a factor sets the key of its name, unless it has"
    assert hint in message(tmp_path, factors={"gust": {"draw": uniform(0.0, 1.0)}})
    named = {"gust": {"key": "wind.gusty", "draw": uniform(0.0, 1.0)}}
    assert "unless it has" not in message(tmp_path, factors=named)
