"""A reference profile as a table, compared with another one, and as a plot."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.text import Text
from textual.widgets import DirectoryTree
from textual.widgets.directory_tree import DirEntry
from textual_plotext import PlotextPlot

from gcs.scenario.bundled import SCENARIOS
from gcs.tui.curves import palette_of, ticks
from gcs.tui.formatting import Cell
from gcs.tui.grid import Grid, GridColumn, Row
from gcs.tui.guard import Guarded
from mavlink_defs.profile import Segment
from mavlink_defs.visible import visible

_COLUMNS = (
    GridColumn("#", 2),
    GridColumn("start s", 7),
    GridColumn("V m/s", 6),
    GridColumn("roll°", 6),
    GridColumn("pitch°", 6),
    GridColumn("yaw°", 6),
    GridColumn("shape", 0, "left"),
)
_VALUES = ("airspeed_m_s", "roll_deg", "pitch_deg", "yaw_deg")
_TITLE = "[$primary]V m/s[/] [$accent]roll°[/] [$success]pitch°[/] [$error]yaw°[/] over s"
_TAIL = 1.25  # the last segment goes on


class ProfileFiles(DirectoryTree):
    """Folders and YAML files: a folder's, and the bundled ones."""

    ICON_NODE, ICON_NODE_EXPANDED, ICON_FILE = "▸ ", "▾ ", "  "

    def __init__(self, folder: Path, **kwargs: Any) -> None:
        super().__init__(folder, **kwargs)
        self._folder = folder
        self.show_root = False

    async def watch_path(self) -> None:
        """Show the two folders in place of the content of the first."""
        await super().watch_path()
        self.root.remove_children()
        own = self.root.add(self._folder.name or str(self._folder), DirEntry(self._folder))
        own.expand()
        self.root.add("bundled", DirEntry(SCENARIOS))

    def process_label(self, label: Any) -> Text:
        """Return a file's name as the operator may see it."""
        return Text(visible(str(label)))

    def filter_paths(self, paths: Any) -> Any:
        """Leave out what can be no profile."""
        kept = (path for path in paths if not path.name.startswith((".", "_")))
        named = (p for p in kept if p.is_dir() or p.suffix in {".yaml", ".yml"})
        return [p for p in named if p.is_dir() or p.parent != SCENARIOS]  # not its additions


class ProfileTable(Grid):
    """Segments; where another profile differs, its value follows."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("choose a file, or g: what a vehicle holds", **kwargs)
        self.border_title = "Profile"

    def show_profile(
        self, segments: Sequence[Segment], other: Sequence[Segment] | None, title: str
    ) -> None:
        """Show segments, compared with another profile's if there is one."""
        count = max(len(segments), len(other or ()))
        self.show(_COLUMNS, [_row(i, segments, other) for i in range(count)])
        self.border_title = Text(visible(title))  # names of files are no markup


class ProfilePlot(Guarded, PlotextPlot):
    """Airspeed and attitude over time."""

    def show_profile(self, segments: Sequence[Segment]) -> None:
        """Draw segments."""
        self.border_title = _TITLE
        palette = palette_of(self.app.theme_variables)
        self.plt.clear_figure()
        values: list[float] = []
        for key, colour in zip(_VALUES, palette.channels, strict=True):
            x, y = polyline(segments, key)
            if x:
                self.plt.plot(x, y, marker="braille", color=colour)
                self.plt.xticks(ticks(x[0], x[-1]))
                values += y
        if values:
            self.plt.yticks(ticks(min(values), max(values)))
        self.plt.grid(False, False)
        self.refresh()


def polyline(segments: Sequence[Segment], key: str) -> tuple[list[float], list[float]]:
    """Corners of one quantity over time [s]."""
    values = [float(segment.as_dict()[key]) for segment in segments]
    starts = [segment.start_s for segment in segments]
    ends = [*starts[1:], max(starts[-1] * _TAIL, starts[-1] + 1.0)] if starts else []
    x: list[float] = []
    y: list[float] = []
    for i, segment in enumerate(segments):
        begin = y[-1] if segment.ramp and y else values[i]
        x += [starts[i], ends[i]]
        y += [begin, values[i]]
    return x, y


def differences(a: Sequence[Segment], b: Sequence[Segment]) -> int:
    """Count the values in which two profiles differ; a missing segment counts as one."""
    count = abs(len(a) - len(b))
    for one, other in zip(a, b, strict=False):
        left, right = one.as_dict(), other.as_dict()
        count += sum(left[key] != right[key] for key in left)
    return count


def _row(i: int, segments: Sequence[Segment], other: Sequence[Segment] | None) -> Row:
    ours = _texts(segments, i)
    theirs = ours if other is None else _texts(other, i)
    cells: list[Cell] = [(str(i + 1), "muted")]
    for a, b in zip(ours, theirs, strict=True):
        cells.append((a, "") if a == b else (f"{a}≠{b}", "warn"))
    return Row(i, tuple(cells))


def _texts(segments: Sequence[Segment], i: int) -> list[str]:
    if i >= len(segments):
        return ["–"] * 6
    return [f"{v:g}" if isinstance(v, float) else str(v) for v in segments[i].as_dict().values()]
