"""Names of before of keys and parameters act as the present ones, and are warned of once."""

import operator
import tomllib
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from vehicle_bench import UAV, Bench, of_type

from ftc_autopilot.control.laws.tube import Tube
from ftc_autopilot.vehicle.param_table import _cut, law_tunables
from gcs.results.runs.details import scenario_keys
from gcs.scenario.changes import with_changes
from gcs.scenario.model import scenario_tree
from gcs.station.param_file import differing
from gcs.station.param_metadata import known_quantity
from mavlink_defs import dialect
from mavlink_defs.config.inherit import merged, value_at, with_values
from mavlink_defs.config.renamed import (
    GONE,
    PARAMETERS,
    SECTIONS,
    RenamedKey,
    RenamedWarning,
    present,
    text_of,
)
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.services.param import NOT_LISTED, Param

ALL = [(section, key) for section, keys in SECTIONS.items() for key in keys]
KEPT = Path(__file__).parents[3] / "data" / "kept" / "run" / "scenario.yaml"
TUBE = "paper/scenario1", ["tube"]


def other_than(value: float | None) -> float:
    return 1.1 * (value or 0.05)


def noticed(work: Callable[[], Any]) -> tuple[Any, list[str]]:
    """What a function returns, and the warnings that a program shows, each text once."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("default")
        result = work()
    return result, [str(one.message) for one in found if one.category is RenamedWarning]


def law_of(tree: dict[str, Any]) -> Tube:
    return Tube.model_validate(tree["controller"])


def laid_over(tree: dict[str, Any], place: str, value: float) -> Tube:
    return law_of(with_values(tree, {place: value}, "--set"))


def in_a_file(path: Path, place: str, value: float) -> Tube:
    tree: dict[str, Any] = {"extends": ["paper/scenario1", "tube"]}
    here, *keys = tree, *place.split(".")
    for key in keys[:-1]:
        here = here.setdefault(key, {})
    here[keys[-1]] = value
    path.write_text(yaml.safe_dump(tree))
    return law_of(scenario_tree(path))


def test_every_key_is_set_by_its_name_of_before(tmp_path: Path) -> None:
    """In a file, and laid over a scenario, as ``--set``, campaigns and sweeps do it."""
    base, wrong = merged(scenario_tree("paper/scenario1"), scenario_tree("tube")), []
    plain = law_of(base)
    for section, key in ALL:
        before, now = f"{section}.{key.before}", f"{section}.{key.now}"
        attribute = now.removeprefix("controller.")
        held = operator.attrgetter(attribute)(plain)
        value = other_than(held)
        expected = law_of(with_values(base, {now: value}))
        ways: dict[str, Callable[[], Tube]] = {
            "file": partial(in_a_file, tmp_path / "old.yaml", before, value),
            "--set": partial(laid_over, base, before, value),
        }
        for way, read in ways.items():
            law, texts = noticed(read)
            if (law, texts) != (expected, [text_of(key.before, key.now)]) or law == plain:
                wrong.append(f"{way}: {before}: {texts}")
        if held != value_at({"controller": plain.model_dump()}, before) or present(before) != now:
            wrong.append(f"as the key of a factor: {before}")
        get = operator.attrgetter(before.removeprefix("controller."))
        if noticed(partial(get, plain)) != (held, [text_of(key.before, key.now)]):
            wrong.append(f"attribute: {before}")
    assert not wrong, "\n".join(wrong)


def test_every_parameter_answers_to_its_name_of_before() -> None:
    """By that name, which the client waits for; a change comes by the present one as well."""
    bench, wrong = Bench(with_changes(*TUBE)), []
    read, put = dialect.MAVLink_param_request_read_message, dialect.MAVLink_param_set_message

    def say(message: Any) -> tuple[dict[str, tuple[float, int]], str]:
        answers = bench.say(message)
        values = of_type(answers, "PARAM_VALUE")
        found = {one.param_id: (one.param_value, one.param_index) for one in values}
        return found, "".join(one.text for one in of_type(answers, "STATUSTEXT"))

    for before, now in PARAMETERS.items():
        (held, index), _ = say(read(UAV, 1, now.encode(), -1))[0][now], None
        value = np.float32(other_than(held)).item()
        by_before, text = say(read(UAV, 1, before.encode(), -1))
        changed, second = say(put(UAV, 1, before.encode(), value, 9))
        after = say(read(UAV, 1, now.encode(), -1))[0]
        good = (
            by_before == {before: (held, NOT_LISTED)}
            and changed == {now: (value, index), before: (value, NOT_LISTED)}
            and after == {now: (value, index)}
            and (text, second) == (text_of(before, now), f"{now} is {value:g} now")
            and known_quantity(before) == known_quantity(now) is not None
        )
        if not good:
            wrong.append(f"{before}: {by_before}, {changed}, {after}, {text!r}, {second!r}")
    assert not wrong, "\n".join(wrong)


DEFAULTS_BEFORE = {
    "takeover_s": 0.5,
    "takeover_threshold": 2.0,
    "rescue_deg": 15.0,
    "storm_events": 17.0,
    "storm_s": 5.0,
    **yaml.safe_load(KEPT.read_text())["controller"]["diagnosis"],
}


def test_a_name_of_before_means_what_it_meant() -> None:
    """Its default is the same, and each parameter is its key's."""
    fields = {one.name: one.field for one in law_tunables(Tube, np.zeros(1, Tube.record()))}
    for section, key in ALL:
        place = f"{section}.{key.now}".removeprefix("controller.")
        assert operator.attrgetter(place)(Tube()) == DEFAULTS_BEFORE[key.before], key
        assert fields[key.parameter] == key.now.rpartition(".")[2], key
        if section == "controller.diagnosis":
            assert key.now == f"throttle.{key.before.removeprefix('throttle_')}", key
        prefix = "" if section == "controller" else "DIAG_"
        assert key.parameter_before == _cut(prefix + key.before.upper()), key
    assert len({key.now for _, key in ALL}) == len(ALL)


def test_a_file_of_parameters_may_have_names_of_before() -> None:
    held = [Param("FALLBACK_S", 0.5, 9), Param("OWN", 1.0, 9)]
    values = {"TAKEOVER_S": 0.5, "STORM_S": 5.0, "OWN": 1.0}
    assert differing(held, values) == {"STORM_S": None}  # which this vehicle does not have
    assert differing(held, {"TAKEOVER_S": 0.4}) == {"TAKEOVER_S": 0.5}


@pytest.mark.parametrize(
    ("own", "values", "expected"),
    [
        ("rescue_deg: 9", {"controller.fallback_error_deg": 8.0}, 8.0),
        ("fallback_error_deg: 9", {"controller.rescue_deg": 8.0}, 8.0),
        ("fallback_error_deg: 9, rescue_deg: 7", {"controller": {"fallback_error_deg": 8.0}}, 8.0),
    ],
)
def test_what_is_merged_last_counts(
    own: str, values: dict[str, Any], expected: float, tmp_path: Path
) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(f"extends: [paper/scenario1, tube]\ncontroller: {{{own}}}\n")
    scenario, _ = noticed(lambda: with_changes(path, values=values))
    assert scenario.controller.fallback_error_deg == expected


@pytest.mark.parametrize(
    "diagnosis",
    [
        {"throttle": {"jump_n": 9.0}, "jump_n": 8.0, "probe_n": 7.0},
        {"probe_n": 7.0, "jump_n": 9.0, "throttle": {"jump_n": 8.0}},
    ],
)
def test_a_mapping_and_names_of_before_are_merged(diagnosis: dict[str, Any]) -> None:
    law, _ = noticed(lambda: Tube.model_validate({"kind": "tube", "diagnosis": diagnosis}))
    assert (law.diagnosis.throttle.jump_n, law.diagnosis.throttle.probe_n) == (8.0, 7.0)


def test_flights_of_before_are_compared_by_present_names(tmp_path: Path) -> None:
    (tmp_path / "scenario.yaml").write_text("controller: {storm_s: 4, diagnosis: {jump_n: 9}}")
    assert scenario_keys(tmp_path) == {
        "controller.event_rate_cooldown_s": "4",
        "controller.diagnosis.throttle.jump_n": "9",
    }


def test_the_section_ardupilot_of_before_is_the_autopilots_outputs(tmp_path: Path) -> None:
    base = tmp_path / "base.yaml"
    old = {"hold": False, "launch_throttle": 0.05, "throttle": {"min_us": 1100}}
    base.write_text(yaml.safe_dump({"ardupilot": old}))
    values = {"autopilot.kind": "ardupilot", "autopilot.outputs": {"rudder": {"channel": 5}}}
    flown, texts = noticed(lambda: with_changes("paper/scenario1", [base], {}, "--set"))
    assert (flown.autopilot.kind, texts) == ("ftc", [])
    flown, texts = noticed(
        lambda: with_changes("paper/scenario1", [base], {"autopilot.kind": "ardupilot"}, "--set")
    )
    assert flown.autopilot.outputs.throttle.min_us == 1100.0
    assert texts == [text_of("ardupilot", "autopilot.outputs")]
    flown, _ = noticed(lambda: with_changes("paper/scenario1", [base], values, "--set"))
    outputs = flown.autopilot.outputs
    assert (outputs.rudder.channel, outputs.throttle.min_us) == (5, 1000.0), "the present name"


def test_a_law_that_extends_ours_reads_fields_by_names_of_before() -> None:
    class Own(Tube):
        """Another tube."""

    @compiled
    def limit(gains: np.void) -> float:
        return float(gains["rescue_rad"] - gains["fallback_error_rad"] + gains["storm_events"])

    gains = np.zeros(1, Own.record())[0]
    Own(kind="tube", fallback_error_deg=9.0, event_rate_limit=8.0).write_to(gains)
    assert limit(gains) == 8.0
    assert not set(Tube.record().fields or ()) & {"rescue_rad", "storm_events"}


def test_a_law_cannot_declare_a_key_by_its_name_of_before() -> None:
    with pytest.raises(TypeError, match="rescue_deg is fallback_error_deg now"):
        type("Own", (Tube,), {"rescue_deg": 9.0, "__annotations__": {"rescue_deg": float}})


def test_the_names_of_before_go_in_time() -> None:
    """With the version that `GONE` names, the table's entries go."""
    project = tomllib.loads((Path(__file__).parents[4] / "pyproject.toml").read_text())["project"]
    parts = [int(part) for part in project["version"].split(".")[:2]]
    assert parts < [int(part) for part in GONE.split(".")] or not any(SECTIONS.values())
    assert all(isinstance(key, RenamedKey) for _, key in ALL)
