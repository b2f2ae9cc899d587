"""The report of `gcs reproduce`: the paper's tables beside ours, and the differences."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ftc_lab.reports.markdown import render
from ftc_lab.reports.published_values import FIG_9, SAVING, TABLE_IV, TABLE_V
from gcs.results.figures import FlightSummary, UavSummary
from gcs.results.quantities import IAE_UNITS, PAPER_ORDER, QUANTITIES, percent

_FOLLOWER_2 = 3

CONTROLLERS = {
    "scenario2_proposed": "proposed",
    "scenario2_joint": "proposed, joint trigger",
    "scenario2_periodic": "compared controller 1 (periodic)",
    "scenario2_backstepping": "compared controller 2 (backstepping)",
    "scenario2_pid": "PID (not in the paper)",
}
"""Controllers compared, by scenario file, as tables and figures name them."""

MODES = {
    "scenario3_mode1": "mode 1: rudder ρ 0.9",
    "scenario3_mode2": "mode 2: rudder ρ 0.9 + 1°",
    "scenario3_mode3": "mode 3: elevator ρ 0.9 + 0.5°",
    "scenario3_mode4": "mode 4: aileron ρ 0.9 + 1°",
}
"""Fault modes of scenario 3, by scenario file."""


@dataclass(frozen=True)
class PaperResults:
    """The data of the report.

    Attributes:
        summaries: Of each flight, by scenario file.
        reference_lag: IAE between commands and filtered reference, by quantity [m, deg s].
        theory: Section on the theory, Markdown.
        figures: Caption of each figure, by its file's name without suffix, in order.
    """

    summaries: Mapping[str, FlightSummary]
    reference_lag: Mapping[str, float]
    theory: str
    figures: Mapping[str, str]

    def iae(self, file: str) -> dict[str, float]:
        """Return the IAE of follower 2 against the commands, by quantity."""
        iae = self._uav(file, _FOLLOWER_2).iae
        return {name: math.nan if value is None else value for name, value in iae.items()}

    def events(self, file: str, uav: int = _FOLLOWER_2) -> dict[str, int]:
        """Return the events by channel."""
        channels = self._uav(file, uav).channels
        return {name: channel.events for name, channel in channels.items()}

    def saving(self, file: str) -> float:
        """Return the share of transmissions that follower 2 saved."""
        share = self._uav(file, _FOLLOWER_2).saving
        return math.nan if share is None else share

    def _uav(self, file: str, uav: int) -> UavSummary:
        return next(u for u in self.summaries[file].uavs if u.id == uav)


def paper_report(results: PaperResults) -> str:
    """Return the whole report as Markdown; figures are expected in `figures/`."""
    summaries = results.summaries.values()
    modes = {"in_process": "in one process", "lockstep": "over MAVLink, in lockstep"}
    return (
        render(
            "paper.md",
            results=results,
            lost=[f"{s.scenario}: {s.loss}" for s in summaries if s.loss],
            how=", ".join(sorted({modes.get(s.mode, s.mode) for s in summaries})),
            table_iv=_table_iv(results),
            table_v=_table_v(results),
            fig_9=_fig_9(results),
            scenario_3=_scenario_3(results),
            tracking=_on_tracking(results),
            ranked=lambda file: _ranked(results, file),
            counts=_on_counts(results),
        ).rstrip("\n")
        + "\n"
    )


def _cell(paper: float | None, ours: float, shape: str) -> str:
    shown = format(ours, shape)
    return shown if paper is None else f"{paper:g} / {shown} / {ours / paper:.2f}"


def _table_iv(results: PaperResults) -> dict[str, list[Any]]:
    rows = []
    for file, label in CONTROLLERS.items():
        ours, paper = results.iae(file), TABLE_IV.get(file, {})
        rows.append([label, *(_cell(paper.get(q), ours[q], ".2f") for q in QUANTITIES)])
    lag = [f"{results.reference_lag[q]:.2f}" for q in QUANTITIES]
    rows.append(["of these, the reference filter's share", *lag])
    head = ["IAE against the commands", *(f"{q} [{IAE_UNITS[q]}]" for q in QUANTITIES)]
    return {"head": head, "rows": rows}


def _table_v(results: PaperResults) -> dict[str, list[Any]]:
    rows = []
    for file, label in CONTROLLERS.items():
        ours, paper = results.events(file), TABLE_V.get(file, {})
        saving = percent(results.saving(file))
        if file == "scenario2_proposed":
            saving = f"{100 * SAVING:g} % / {saving}"
        rows.append([label, *(_cell(paper.get(c), ours[c], "d") for c in PAPER_ORDER), saving])
    return {"head": ["transmissions", *PAPER_ORDER, "saved"], "rows": rows}


def _fig_9(results: PaperResults) -> dict[str, list[Any]]:
    rows = []
    for uav, paper in FIG_9.items():
        ours = results.events("scenario1", uav)
        rows.append([f"UAV {uav}", *(_cell(paper[c], ours[c], "d") for c in PAPER_ORDER)])
    return {"head": ["events in scenario 1 (Fig. 9)", *PAPER_ORDER], "rows": rows}


def _scenario_3(results: PaperResults) -> dict[str, list[Any]]:
    rows = []
    for file, label in MODES.items():
        iae, events = results.iae(file), results.events(file)
        counts = [str(events[c]) for c in PAPER_ORDER]
        rows.append([label, *(f"{iae[q]:.2f}" for q in QUANTITIES), *counts])
    head = ["in (19, 22] s", *(f"IAE {q} [{IAE_UNITS[q]}]" for q in QUANTITIES), *PAPER_ORDER]
    return {"head": head, "rows": rows}


def _on_tracking(results: PaperResults) -> dict[str, Any]:
    ours, paper = results.iae("scenario2_proposed"), TABLE_IV["scenario2_proposed"]
    periodic, printed = results.iae("scenario2_periodic"), TABLE_IV["scenario2_periodic"]
    return {
        "shares": ", ".join(f"{q} {ours[q] / paper[q] - 1.0:+.0%}" for q in QUANTITIES),
        "least": min(results.reference_lag.values()),
        "cost": max(abs(ours[q] - periodic[q]) / periodic[q] for q in QUANTITIES),
        "theirs": max(abs(paper[q] - printed[q]) / printed[q] for q in QUANTITIES),
    }


def _ranked(results: PaperResults, file: str) -> tuple[str, str]:
    """Return in which quantities a controller tracks better and worse than the proposed one."""
    ours, proposed = results.iae(file), results.iae("scenario2_proposed")
    better = [q for q in QUANTITIES if ours[q] < proposed[q]]
    return _listed(better), _listed([q for q in QUANTITIES if ours[q] >= proposed[q]])


def _on_counts(results: PaperResults) -> dict[str, Any]:
    ours, paper = results.events("scenario2_proposed"), TABLE_V["scenario2_proposed"]
    return {
        "listed": ", ".join(f"{c} {ours[c] / paper[c]:.2f}" for c in PAPER_ORDER),
        "saving": results.saving("scenario2_proposed"),
        "printed": SAVING,
    }


def _listed(names: list[str]) -> str:
    *first, last = names or [""]
    return f"{', '.join(first)} and {last}" if first else last
