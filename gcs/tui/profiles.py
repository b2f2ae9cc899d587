"""Profiles: choose a file, view it, upload it, compare it with what vehicles hold."""

from pathlib import Path
from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import DirectoryTree, Input

from gcs.scenario.profile_file import load_profile
from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_link import Progress
from gcs.station.vehicle_state import VehicleState
from gcs.tui.formatting import Cell, ids
from gcs.tui.grid import Grid, GridColumn, Row
from gcs.tui.guard import CachedStatic, on
from gcs.tui.profile_views import ProfileFiles, ProfilePlot, ProfileTable, differences
from gcs.tui.requests import ActionOutcome, Refresh, VehicleAction
from gcs.tui.view import FleetView, Panel
from mavlink_defs.config.models import ConfigError, counted
from mavlink_defs.profile import Segment
from mavlink_defs.visible import visible

_COLUMNS = (GridColumn("", 1, "left"), GridColumn("UAV", 3), GridColumn("holds", 0, "left"))
_BAR = 10


class Holdings(Grid):
    """The profile of each vehicle, compared with the file."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("space", "mark", "mark", show=False)]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("waiting for vehicles", **kwargs)
        self.border_title = "Vehicles (space marks)"
        self.progress: dict[int, tuple[int, int]] = {}

    def show_holdings(self, view: FleetView, segments: tuple[Segment, ...] | None) -> None:
        """Show all vehicles."""
        rows = []
        for state in view.states:
            mark = "●" if state.system in view.marked else ""
            holds = self._bar(state.system) or _compared(state, segments)
            rows.append(Row(state.system, ((mark, "accent"), (str(state.system), "strong"), holds)))
        self.show(_COLUMNS, rows)

    def _bar(self, system: int) -> Cell | None:
        if system not in self.progress:
            return None
        done, total = self.progress[system]
        full = round(_BAR * done / max(total, 1))
        return ("█" * full + "░" * (_BAR - full) + f" {done}/{total}", "accent")


class ProfilesPanel(Panel, Horizontal):
    """Files and vehicles beside the profile."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("u", "upload", "upload", tooltip="Upload the file to the marked UAVs"),
        Binding(
            "g",
            "download",
            "get & compare",
            tooltip="Download what the marked UAVs hold, and compare it with the file",
        ),
        Binding("o", "open", "open", tooltip="Type the path of a file"),
    ]

    def __init__(self, offers_files: bool = True, **kwargs: Any) -> None:
        """Prepare the panel.

        Args:
            offers_files: Whether there is a tree of files, from the working directory on, and a
                field for a path.
            kwargs: Of Widget.
        """
        super().__init__(**kwargs)
        self.segments: tuple[Segment, ...] | None = None
        self._offers_files = offers_files
        self._file: Path | None = None
        self._view: FleetView | None = None

    def compose(self) -> ComposeResult:
        """Lay out the panel."""
        with Vertical(id="profile-side"):
            if self._offers_files:
                yield Input(placeholder="o: path of a YAML file", id="profile-path", compact=True)
                files = ProfileFiles(Path.cwd(), id="profile-files", classes="panel")
                files.border_title = "Files"
                yield files
            yield Holdings(id="holdings", classes="panel")
        with Vertical():
            yield CachedStatic(grow=True, id="profile-says")
            yield ProfileTable(id="profile-table", classes="panel")
            yield ProfilePlot(id="profile-plot", classes="panel")

    def show_view(self, view: FleetView) -> None:
        """Show the vehicles' profiles."""
        self._view = view
        holdings = self.query_one(Holdings)
        holdings.attempt(holdings.show_holdings, view, self.segments)
        state = next((s for s in view.states if s.system == holdings.key), None)
        held = state.profile if state is not None else None
        table = self.query_one(ProfileTable)
        if self.segments is not None:
            against = f" ≠ UAV {holdings.key}" if held and held != self.segments else ""
            table.attempt(
                table.show_profile, self.segments, held, f"{self._title_of_file}{against}"
            )
        elif held:
            title = f"UAV {holdings.key} holds {counted(len(held), 'segment')}"
            table.attempt(table.show_profile, held, None, title)
            self._plot(held)
        else:
            table.attempt(table.show_profile, (), None, "Profile")
            self._plot(())

    def load(self, path: Path) -> None:
        """Show the profile of a file, or say what is wrong with it."""
        says = self.query_one("#profile-says", CachedStatic)
        try:
            self.segments, self._file = load_profile(path), path
        except ConfigError as problem:
            says.say(str(problem))
            says.add_class("-wrong")
        else:
            says.say("")
            says.remove_class("-wrong")
            self._plot(self.segments)
        self.post_message(Refresh())

    @property
    def _title_of_file(self) -> str:
        return (
            f"{visible(self._file.name)}, {counted(len(self.segments or ()), 'segment')}"
            if self._file
            else ""
        )

    def _plot(self, segments: tuple[Segment, ...]) -> None:
        plot = self.query_one(ProfilePlot)
        plot.attempt(plot.show_profile, segments)

    @on(DirectoryTree.FileSelected)
    def _file_chosen(self, event: DirectoryTree.FileSelected) -> None:
        self.load(event.path)

    @on(Input.Submitted)
    def _path_typed(self, event: Input.Submitted) -> None:
        self.load(Path(event.value.strip()).expanduser())
        self.query_one(Holdings).focus()

    @on(Holdings.Moved)
    def _moved(self) -> None:
        self.post_message(Refresh())

    def action_open(self) -> None:
        """Go to the field for a path."""
        for field in self.query("#profile-path"):
            field.focus()

    def _targets(self) -> tuple[int, ...]:
        if self._view is None:
            return ()
        marked = tuple(sorted(self._view.marked))
        key = self.query_one(Holdings).key
        return marked or (() if key is None else (key,))

    def action_upload(self) -> None:
        """Upload the file to the marked vehicles, or the one of the cursor."""
        segments, name, targets = self.segments, self._title_of_file, self._targets()
        if segments is None or self._view is None:
            self.app.notify("choose a file first", severity="warning")
            return

        async def act(vehicle: Vehicle, _: str) -> str:
            await vehicle.upload_profile(segments, self._progress(vehicle.system))
            await vehicle.download_profile()
            return f"profile {name} uploaded"

        flying = [s.system for s in self._view.states if s.system in targets and s.armed]
        question = f"Upload {name} to {ids(targets)}?\n" + (
            f"{ids(flying)} in flight: it is in force at once." if flying else ""
        )
        self.post_message(
            VehicleAction(
                "upload", targets, act, question=question if flying else "", on_done=self._done
            )
        )

    def action_download(self) -> None:
        """Ask the marked vehicles, or the one of the cursor, for their profiles."""

        async def act(vehicle: Vehicle, _: str) -> str:
            held = await vehicle.download_profile(self._progress(vehicle.system))
            text = f"holds {counted(len(held), 'segment')}" if held else "holds no profile"
            if self.segments is None:
                return text
            different = differences(held, self.segments)
            same = f"{different} values differ from" if different else "the same as"
            return f"{text}, {same} {self._title_of_file}"

        self.post_message(VehicleAction("download", self._targets(), act, on_done=self._done))

    def _progress(self, system: int) -> Progress:
        holdings = self.query_one(Holdings)

        def note(done: int, total: int) -> None:
            holdings.progress[system] = (done, total)

        return note

    def _done(self, outcome: ActionOutcome) -> None:
        self.query_one(Holdings).progress.pop(outcome.system, None)


def _compared(state: VehicleState, segments: tuple[Segment, ...] | None) -> Cell:
    if state.profile is None:
        text = "not asked yet" if state.offers_profile else "does not tell"
        return (text, "muted")
    if not state.profile and state.mission:
        return ("a mission: panel 7", "")
    if not state.profile:
        return ("no profile", "warn")
    count = counted(len(state.profile), "segment")
    if segments is None:
        return (count, "")
    if state.profile == segments:
        return ("= file", "good")
    differing = counted(differences(state.profile, segments), "value")
    return (f"{count} ≠ file: {differing}", "warn")
