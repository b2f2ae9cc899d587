"""The sentences and ratios of the report follow the numbers, whatever they are."""

import re
from typing import Any

import pytest

from ftc_lab.reports.paper import CONTROLLERS, MODES, PaperResults, paper_report
from ftc_lab.reports.published_values import FIG_9, TABLE_IV, TABLE_V
from gcs.results.figures import FlightSummary, UavSummary
from gcs.results.quantities import PAPER_ORDER, QUANTITIES
from gcs.results.summary_parts import ChannelSummary


def summary(
    iae: dict[str, float], events: dict[str, int], loss: str | None = None
) -> FlightSummary:
    channels = {name: ChannelSummary(events[name], 0, None) for name in PAPER_ORDER}
    saving = 1.0 - sum(events.values()) / 96000
    uavs = tuple(
        UavSummary(
            i, 24000, 0, saving, channels, 0, 0, None, {}, iae, iae, iae, iae, iae, None, None
        )
        for i in (1, 2, 3)
    )
    return FlightSummary(
        "a flight", loss is None, loss, "in_process", 24.0, 24000, 1.0, 24.0, saving, None, uavs
    )


def results(**changed: Any) -> PaperResults:
    """Flights that give what the paper prints, but for some."""
    files = ("scenario1", *CONTROLLERS, *MODES)
    proposed = TABLE_IV["scenario2_proposed"], TABLE_V["scenario2_proposed"]
    summaries = {f: summary(*proposed) for f in files}
    for file in ("scenario2_periodic", "scenario2_backstepping"):
        summaries[file] = summary(TABLE_IV[file], TABLE_V[file])
    lag = dict.fromkeys(QUANTITIES, 12.0)
    return PaperResults(summaries | changed, lag, "The theory.\n", {"fig5": "Fig. 5: paths."})


def test_what_equals_the_paper_has_ratio_one() -> None:
    text = paper_report(results())
    cells = re.findall(r"[\d.]+ / [\d.]+ / ([\d.]+)", text.split("## Fault modes")[0])
    assert len(cells) == 12 + 12 + 12
    only = {c for c in cells[:24] if c != "1.00"}
    assert only == set()
    assert "86.67 % / 86.67 %" in text
    assert "Compared controller 2 tracks worse than the proposed one throughout" in text


def test_fig_9_is_compared_by_uav() -> None:
    text = paper_report(results())
    row = next(line for line in text.splitlines() if line.startswith("| UAV 2"))
    ours = TABLE_V["scenario2_proposed"]["throttle"]
    assert f"{FIG_9[2]['throttle']} / {ours} / {ours / FIG_9[2]['throttle']:.2f}" in row


@pytest.mark.parametrize(
    ("factor", "part"),
    [
        (
            0.1,
            "Compared controller 2 tracks better than the proposed one in airspeed, roll, "
            "pitch and yaw; the paper finds it the worst",
        ),
        (1.0, "Compared controller 2 tracks worse"),
        (0.5, "Compared controller 2 tracks better than the proposed one in pitch, worse in"),
    ],
)
def test_a_comparator_that_does_better_is_said_to(factor: float, part: str) -> None:
    worse = TABLE_IV["scenario2_backstepping"]
    iae = {q: worse[q] * factor for q in QUANTITIES}
    if factor == 0.5:
        iae = worse | {"pitch": 5.0}
    changed = summary(iae, TABLE_V["scenario2_backstepping"])
    assert part in paper_report(results(scenario2_backstepping=changed))


def test_a_lost_flight_is_said_to_be_lost() -> None:
    lost = summary(TABLE_IV["scenario2_proposed"], TABLE_V["scenario2_proposed"], "UAV 3 was lost")
    assert "**Lost flights: a flight: UAV 3 was lost.**" in paper_report(
        results(scenario3_mode4=lost)
    )


def test_every_figure_has_its_caption() -> None:
    assert "![fig5](figures/fig5.png)\n\n*Fig. 5: paths.*" in paper_report(results())
