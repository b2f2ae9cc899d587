"""The heights of a mission over its way, drawn in the terminal."""

from typing import Any

from gcs.scenario.itinerary import Itinerary

_LINES = 12
_MOST_LABELS = 12


def height_profile(itinerary: Itinerary, width: int) -> str:
    """Draw the height over the way, with the numbers of the items below where they are reached.

    What else lies in these axes, such as a fence or a landing, is drawn by a further `plt.plot`.

    Args:
        itinerary: The mission.
        width: Of the terminal [characters].
    """
    import plotext  # type: ignore[import-untyped]  # has no annotations; slow to import

    plt: Any = plotext
    plt.clear_figure()
    plt.theme("clear")
    plt.plot_size(width, _LINES)
    ways, heights = zip(*itinerary.profile, strict=True)
    plt.plot(ways, heights, marker="braille")
    low, high = min(0.0, *heights), max(heights)
    plt.ylim(low, high + max(0.05 * (high - low), 1.0))
    plt.yticks(levels := sorted({low, *heights[:1], high}), [f"{level:.0f}" for level in levels])
    way, ticks = 0.0, dict[float, str]()
    for stage in itinerary.stages:
        way += stage.length_m
        ticks[way] = str(stage.item)
    step = -(-len(ticks) // _MOST_LABELS)
    plt.xticks(list(ticks)[::step], list(ticks.values())[::step])
    plt.title("height [m] at each item")
    lines = str(plt.uncolorize(plt.build())).splitlines()
    return "\n".join(line.rstrip() for line in lines).rstrip()
