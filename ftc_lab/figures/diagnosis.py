"""Figure of a diagnosis: each relation, measured and as predicted, and the evidence against it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ftc_lab.flight_diagnosis.decisions import Diagnosis, Watched
from ftc_lab.flight_diagnosis.relations import Surface
from gcs.reports.figures.style import draw_curve, draw_legend, new_figure, style, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANEL_IN, _LAST_IN = 1.3, 2.0


def draw_diagnosis(watched: Mapping[Surface, Watched], diagnosis: Diagnosis) -> "Figure":
    """Draw the relations one above the other, and below them all evidence.

    Args:
        watched: The relations along the flight.
        diagnosis: What they say; alarm and onset are marked.
    """
    figure = new_figure(_PANEL_IN * len(watched) + _LAST_IN)
    heights = [_PANEL_IN] * len(watched) + [_LAST_IN]
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    t = diagnosis.time_s
    for k, (surface, one) in enumerate(watched.items()):
        judged = one.residuals.weight > 0.0
        predicted = np.where(judged, one.residuals.predicted, np.nan)
        draw_curve(panels[k], t, one.relation.measured, color="0.6", label="measured")
        draw_curve(
            panels[k],
            t,
            predicted,
            color=style(0).colour,
            label=f"as predicted {one.relation.pace.guard_s:g} s before",
        )
        panels[k].set_ylabel(f"{surface}\n[{one.relation.unit}]")
        draw_curve(
            panels[-1], t, diagnosis.ratios[surface], color=style(k + 1).colour, label=surface
        )
    panels[-1].axhline(1.0, color="0.4", linewidth=0.8, linestyle="--", label="threshold")
    panels[-1].set_ylabel("evidence\nover threshold")
    panels[-1].set_xlabel("time [s]")
    for panel in panels:
        tidy(panel)
        if diagnosis.finding is not None:
            panel.axvline(diagnosis.finding.onset_s, color="0.2", linewidth=0.8, label="failed")
            panel.axvline(
                diagnosis.finding.alarm_s, color="0.2", linewidth=0.8, linestyle=":", label="alarm"
            )
    draw_legend(figure)
    return figure
