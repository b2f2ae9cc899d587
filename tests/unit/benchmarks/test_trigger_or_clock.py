"""A trigger must not send more than a clock that tracks as well, in noise and in gusts."""

import pytest

from benchmarks.trigger_or_clock import (
    Compared,
    cells_of,
    fly,
    scenario_with,
    scenarios_of,
    sentences_of,
)
from ftc_lab.baselines.senders import Sender, SenderVerdict, Yardstick, worst_ratio
from gcs.scenario.bundled import bundled_names


def compared(sent: int, **clocks: int) -> Compared:
    """A flight beside one clock by each yardstick, of so many transmissions."""
    sender = Sender((300,) * 4, scenario_with("tube", "consequence", "ideal", "none"), {})
    names: dict[str, Yardstick] = {"reference": "reference", "commands": "commands"}
    found = {names[name]: SenderVerdict(sender, count, good=True) for name, count in clocks.items()}
    return Compared(sent, sent, False, found, {})


def test_a_range_has_the_flights_that_a_clock_wins() -> None:
    flown = [
        compared(100, reference=400, commands=200),
        compared(100, reference=80),
        compared(100),
    ]
    told = list(sentences_of({"tube": flown}))
    assert told == [
        "tube, against one period, errors against the reference: saved -25.0 to 75.0 %, median "
        "25.0 %; 2 of 3 flights have an equal clock",
        "tube, against one period, errors against the commands: saved 50.0 to 50.0 %, median "
        "50.0 %; 1 of 3 flights have an equal clock",
    ]
    assert cells_of(flown[:1], ()) == [
        *("100", "100"),
        *("300 ms", "400", "75.0 %"),
        *("300 ms", "200", "50.0 %"),
    ]
    assert cells_of(flown[2:], ()) == ["100", "100", *("none", "-", "-") * 2]


def test_a_pattern_names_all_that_it_matches() -> None:
    profiles = scenarios_of(["profiles/*", "mine.yaml"])
    assert profiles == [n for n in bundled_names() if n.startswith("profiles/")] + ["mine.yaml"]
    assert {"profiles/turns", "profiles/slalom", "profiles/corrections"} <= set(profiles)


@pytest.mark.slow
@pytest.mark.parametrize("hardware", ["ideal", "realistic", "cheap_imu"])
@pytest.mark.parametrize("turbulence", ["light", "moderate"])
def test_scaled_thresholds_send_less_than_a_clock_that_tracks_no_better(
    hardware: str, turbulence: str
) -> None:
    scaled = fly(scenario_with("surviving", "scaled", hardware, turbulence))
    clock = scenario_with("surviving", "periodic", hardware, turbulence)
    periodic = clock.trigger.model_copy(update={"period_s": 0.05})
    by_clock = fly(clock.model_copy(update={"trigger": periodic}))
    assert sum(u.events for u in scaled.uavs) < 0.9 * sum(u.events for u in by_clock.uavs)
    ratio = worst_ratio(scaled, by_clock, "commands")
    assert ratio is not None
    assert ratio < 1.15
    # Against the reference it tracks worse than this clock where there is least noise.
    own = worst_ratio(scaled, by_clock)
    assert own is not None
    assert own < (2.5 if hardware == "ideal" else 1.3)


@pytest.mark.slow
@pytest.mark.parametrize("hardware", ["realistic", "cheap_imu"])
def test_noise_is_not_counted(hardware: str) -> None:
    counts = {
        mode: sum(
            uav.events for uav in fly(scenario_with("surviving", mode, hardware, "moderate")).uavs
        )
        for mode in ("per_channel", "scaled")
    }
    assert counts["scaled"] < counts["per_channel"] / 4
