"""Transmissions against IAE of every law with every trigger, and their Pareto front."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ftc_autopilot.control.laws import KINDS
from ftc_autopilot.control.triggers import MODES
from ftc_lab.baselines.combinations import AIRCRAFT, Combination, on_the_front
from gcs.reports.figures.style import GREY, SMALL, STYLES, new_figure, note, tidy
from gcs.results.quantities import IAE_UNITS, QUANTITIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARKERS = "osD^vPX*"
_WIDEST = 2.0
"""Largest IAE of a panel, relative to its smallest one."""
_COLOURS = [style.colour for style in (*STYLES[1:], STYLES[0])]


def draw_combinations(listed: Sequence[Combination], uav_id: int) -> "Figure":
    """Draw a row of panels for each aircraft, a panel for each quantity.

    The colour is the law, the marker the trigger; a line joins what no other combination beats
    in both numbers. Combinations that track too badly for a panel, or that lost control, are
    counted above it.
    """
    figure = new_figure(6.4)
    panels = figure.subplots(len(AIRCRAFT), len(QUANTITIES), sharey=True, squeeze=False)
    for row, aircraft in zip(panels, AIRCRAFT, strict=True):
        own = [one for one in listed if one.aircraft == aircraft]
        for panel, quantity in zip(row, QUANTITIES, strict=True):
            _draw(panel, own, uav_id, quantity)
            panel.set_xlabel(f"IAE of {quantity} [{IAE_UNITS[quantity]}]", size=SMALL)
            panel.set_ylabel(f"transmissions of UAV {uav_id}", size=SMALL)
        row[0].set_ylabel(f"{aircraft} aircraft\ntransmissions of UAV {uav_id}", size=SMALL)
        lost = sum(one.uav(uav_id) is None for one in own)
        row[0].set_title(f"{lost} of {len(own)} lost control", loc="left", size=SMALL, color=GREY)
    _draw_legend(figure, listed)
    return figure


def _draw(panel: "Axes", own: Sequence[Combination], uav_id: int, quantity: str) -> None:
    points = {}
    for one in own:
        if (uav := one.uav(uav_id)) is None or (iae := uav.iae[quantity]) is None:
            continue
        points[f"{one.law} {one.trigger}"] = (iae, float(uav.events))
        panel.plot(iae, uav.events, zorder=3, **_look(one.law, one.trigger))
    if points:
        least = min(iae for iae, _ in points.values())
        panel.set_xlim(0.95 * least, _WIDEST * least)
        beyond = sum(iae > _WIDEST * least for iae, _ in points.values())
        note(panel, f"{beyond} beyond" if beyond else "")
    front = [points[name] for name in on_the_front(points)]
    if front:
        panel.step(*zip(*front, strict=True), where="post", color="0.6", lw=0.9, zorder=1)
        panel.set_yscale("log")
    panel.locator_params(axis="x", nbins=5)
    tidy(panel)


def _look(law: str, trigger: str) -> dict[str, Any]:
    return {
        "color": _COLOURS[KINDS.index(law) % len(_COLOURS)],
        "marker": _MARKERS[MODES.index(trigger) % len(_MARKERS)],
        "ls": "",
        "markersize": 6,
        "markeredgecolor": "white",
        "markeredgewidth": 0.5,
        "alpha": 0.9,
    }


def _draw_legend(figure: "Figure", listed: Sequence[Combination]) -> None:
    from matplotlib.lines import Line2D

    laws = list(dict.fromkeys(one.law for one in listed))
    triggers = list(dict.fromkeys(one.trigger for one in listed))
    dots = (_look(law, MODES[0])["color"] for law in laws)
    handles = [Line2D([], [], ls="", marker="o", color=colour) for colour in dots]
    handles += [
        Line2D([], [], ls="", marker=_look(laws[0], trigger)["marker"], color=GREY)
        for trigger in triggers
    ]
    figure.legend(
        handles,
        [*laws, *triggers],
        loc="outside upper center",
        ncols=6,
        frameon=False,
        fontsize=SMALL + 1.0,
    )
