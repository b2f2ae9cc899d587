"""Figure of a fault flown again: the log, the model under its commands, and other laws."""

from typing import TYPE_CHECKING

from ftc_lab.fault_replay.replay import QUANTITIES
from ftc_lab.fault_replay.replayed import ReplayedFault
from gcs.reports.figures.style import draw_curve, draw_legend, new_figure, style, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEIGHT_IN = 7.0


def draw_replay(found: ReplayedFault) -> "Figure":
    """Draw what each did, time since the fault; heights and headings since the first sample."""
    figure = new_figure(_HEIGHT_IN)
    panels = figure.subplots(len(QUANTITIES), 1, sharex=True)
    onset_s, first = found.read.fault.onset_s, float(found.recorded.time_s[0])
    end = float(found.recorded.time_s[-1])
    flights = [("the log", found.recorded), ("model, recorded commands", found.model)]
    flights += [(one.law, one.flown) for one in found.laws]
    for k, (label, one) in enumerate(flights):
        shown = (one.time_s >= first) & (one.time_s <= max(end, onset_s + 10.0))
        for panel, (name, unit) in zip(panels, QUANTITIES.items(), strict=True):
            values = one.values[name][shown]
            if name in {"height", "yaw"} and len(values):
                values = values - values[0]
            draw_curve(panel, one.time_s[shown] - onset_s, values, label=label, **style(k).line)
            panel.set_ylabel(f"{name}\n[{unit}]")
    for panel in panels:
        panel.axvline(0.0, color="0.4", linewidth=0.8, linestyle="--")
        tidy(panel)
    panels[-1].set_xlabel("time since the fault [s]")
    draw_legend(figure)
    return figure
