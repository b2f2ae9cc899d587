"""A mission with fence and rally points as a map in characters."""

from ftc_autopilot.common.geography import Origin
from gcs.scenario.fence import Areas
from gcs.station.mission import Mission
from gcs.station.navigation import KnownHome

_LINES = 24
_COLOURS = {"text": (200, 200, 200), "route": (90, 200, 90), "fault": (230, 80, 80)}


def mission_map(mission: Mission, areas: Areas, origin: Origin, columns: int) -> str:
    """Return a map, north up, with the colours of a terminal.

    Args:
        mission: Home included.
        areas: Fence and rally points.
        origin: Where home is.
        columns: Its width.
    """
    from textual_plotext.plot import Plot

    from gcs.tui.curves import Palette
    from gcs.tui.map_areas import map_areas
    from gcs.tui.map_drawing import MapWindow, Scene, draw_map, route_of

    grey, route = _COLOURS["text"], _COLOURS["route"]
    palette = Palette(grey, grey, _COLOURS["fault"], (grey, grey, grey, grey), grey, route)
    plt = Plot()
    plt.plotsize(columns, _LINES)
    places, circles = route_of(mission, KnownHome(origin, 0.0, 0.0))
    scene = Scene((), (), (0.0, 0.0), places, circles, map_areas(*areas, origin))
    draw_map(plt, scene, MapWindow(), (columns, _LINES), palette)
    text: str = plt.build()
    return text.rstrip()
