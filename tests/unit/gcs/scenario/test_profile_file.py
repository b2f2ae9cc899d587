from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.scenario.model import Scenario, load_scenario
from gcs.scenario.profile_file import load_profile, profile_yaml
from mavlink_defs.config.models import ConfigError
from mavlink_defs.profile import Segment

SCENARIO_1 = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"


def write(folder: Path, text: str) -> Path:
    path = folder / "profile.yaml"
    path.write_text(text)
    return path


def test_a_scenario_is_a_profile_file(scenario1: Scenario) -> None:
    assert load_profile(SCENARIO_1) == scenario1.segments()


def decimals(low: float, high: float) -> st.SearchStrategy[float]:
    return st.integers(round(low * 100), round(high * 100)).map(lambda n: n / 100)


angles = decimals(-89.0, 89.0)


@given(st.lists(st.tuples(decimals(1, 200), angles, angles, angles, st.booleans()), min_size=1))
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory,
    values: list[tuple[float, float, float, float, bool]],
) -> None:
    last = len(values) - 1
    segments = tuple(
        Segment(float(i), v, roll, pitch, yaw, ramp and 0 < i < last)
        for i, (v, roll, pitch, yaw, ramp) in enumerate(values)
    )
    path = write(tmp_path_factory.mktemp("profile"), profile_yaml(segments))
    if len(segments) <= 50:
        assert load_profile(path) == segments
    else:
        with pytest.raises(ConfigError, match="at most 50 entries"):
            load_profile(path)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("profile: []", "profile: expected at least 1 entry"),
        ("name: only", "profile: missing"),
        ("profile: [{start_s: 0, airspeed: 40}]", "did you mean 'airspeed_m_s'"),
        ("profile: [{start_s: 1, airspeed_m_s: 40}]", "profile[0]: start 1 s, must be 0 s"),
        (
            "profile: [{start_s: 0, airspeed_m_s: 40}, {start_s: 0, airspeed_m_s: 40}]",
            "profile[1]: start 0 s, must be after 0 s",
        ),
        ("profile: [{start_s: 0, airspeed_m_s: 40, shape: ramp}]", "cannot be a ramp"),
        ("profile: [{start_s: 0, airspeed_m_s: -40}]", "profile[0].airspeed_m_s: expected > 0"),
    ],
)
def test_bad_profiles_are_refused(tmp_path: Path, text: str, problem: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_profile(path)
    assert problem in str(caught.value)
    assert str(path) in str(caught.value)


def test_scenario_loads_as_before() -> None:
    assert load_scenario(SCENARIO_1).segments()[0].airspeed_m_s == 40.0
