"""Figure of an estimate: its errors with what it expects of them, the wind, and lost sensors."""

from typing import TYPE_CHECKING

import numpy as np

from ftc_lab.flight_estimation.estimated import FlightEstimate
from ftc_lab.flight_estimation.judged import SENSORS, differences
from gcs.reports.figures.style import draw_curve, draw_legend, new_figure, style, tidy
from gcs.results.logs.names import ATTITUDE
from gcs.results.logs.table import FlightTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEIGHT_IN = 7.0


def draw_estimate(found: FlightEstimate, flight: FlightTable) -> "Figure":
    """Draw the angles or their errors, the wind, and the times without a sensor."""
    figure = new_figure(_HEIGHT_IN)
    panels = figure.subplots(5, 1, sharex=True)
    followed = found.followed
    t, reports = followed.samples.time_s, followed.reports
    errors = differences(followed, flight)
    for k, name in enumerate(ATTITUDE):
        own = np.degrees(reports["attitude_std"][:, k])
        off, label = errors.get(name, (None, ""))[0], "estimated less recorded"
        if off is None:
            off, label = np.degrees(followed.states["attitude"][:, k]), "estimated"
        else:
            for side in (-2.0, 2.0):
                draw_curve(panels[k], t, side * own, color="0.6", label="2 standard deviations")
        draw_curve(panels[k], t, off, color=style(1).colour, label=label)
        panels[k].set_ylabel(f"{name}\n[deg]")
    for k, name in enumerate(("north", "east")):
        colour = style(2 * k).colour
        draw_curve(panels[3], t, reports["wind"][:, k], color=colour, label=f"wind to {name}")
    panels[3].set_ylabel("wind\n[m/s]")
    numbers = {name: place for place, name in enumerate(SENSORS)}
    for one in found.judged.exclusions:
        panels[4].plot([one.from_s, one.to_s], [numbers[one.sensor]] * 2, color="0.2", linewidth=4)
    panels[4].set_yticks(range(len(SENSORS)), list(SENSORS))
    panels[4].set_ylim(len(SENSORS) - 0.5, -0.5)
    panels[4].set_ylabel("not used")
    panels[4].set_xlabel("time [s]")
    for panel in panels:
        tidy(panel)
    draw_legend(figure)
    return figure
