"""Plots of the selected vehicle, and the formation from above."""

from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, Vertical
from textual_plotext import PlotextPlot

from gcs.tui import curves
from gcs.tui.formatting import number, seconds
from gcs.tui.guard import CachedStatic, Guarded, guarded
from gcs.tui.map_drawing import draw_formation
from gcs.tui.requests import Refresh
from gcs.tui.view import FleetView, Panel

_SPANS_S = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0)
_QUANTITIES = (("airspeed", "m/s"), ("roll", "°"), ("pitch", "°"), ("yaw", "°"))
_NAMES = ("airspeed", "roll", "pitch", "yaw", "held", "formation", "exits")
_HELD = (
    "held [$primary]aileron[/] [$accent]elevator[/] [$success]rudder[/] [$error]throttle[/]"
    " / limit, ╵ events"
)
_EXITS = (
    "predicted exit from the tube, s [$primary]aileron[/] [$accent]elevator[/] [$success]rudder[/]"
    " [$error]throttle[/]"
)
_DRAW_S = 0.1  # one chart at a time, so that keys never wait for all of them


class Chart(Guarded, PlotextPlot):
    """One plot.

    Attributes:
        kind: One of `_NAMES`.
    """

    def __init__(self, kind: str, **kwargs: Any) -> None:
        super().__init__(name=f"plot of {kind}", **kwargs)
        self.kind = kind
        self._drawn: object = None

    def draw(self, view: FleetView, span_s: float, until_s: float | None) -> bool:
        """Draw the present data; return False if they are drawn already."""
        state = view.state
        times = tuple(s.history.rows(0.0)["time_s"][-1:].tolist() for s in self._about(view))
        token = (view.selected, span_s, until_s, times, self.size, self.app.theme)
        if token == self._drawn or not self.size:
            return False
        self._drawn = None  # until it is
        plt = self.plt
        plt.clear_figure()
        palette = curves.palette_of(self.app.theme_variables)
        if self.kind == "formation":
            self._draw_formation(view, span_s, until_s, palette)
        elif state is not None and len(state.history):
            rows = curves.latest(state, span_s, until_s, 2 * self.size.width)
            end = float(rows["time_s"][-1]) if len(rows) else 0.0
            limits = (max(end - span_s, 0.0), max(end, 1.0))
            if not len(rows):
                pass
            elif self.kind == "held":
                height = self.size.height
                curves.draw_held(plt, rows, state.faults or (), limits, height, palette)
                self.border_title = _HELD
            elif self.kind == "exits":
                curves.draw_exits(plt, rows, limits, palette)
                self.border_title = _EXITS
            else:
                i = _NAMES.index(self.kind)
                curves.draw_quantity(plt, rows, i, limits, palette)
                name, unit = _QUANTITIES[i]
                actual, reference = rows["actual"][-1, i], rows["reference"][-1, i]
                self.border_title = f"{name} {number(actual)} → {number(reference)} {unit}"
        self._drawn = token
        self.refresh()
        return True

    def _about(self, view: FleetView) -> list[Any]:
        if self.kind == "formation":
            return list(view.states)
        return [view.state] if view.state is not None else []

    def _draw_formation(
        self, view: FleetView, span_s: float, until_s: float | None, palette: curves.Palette
    ) -> None:
        points = 2 * self.size.width
        trails = [curves.latest(s, span_s, until_s, points)["position"] for s in view.states]
        size = (self.size.width, self.size.height)
        draw_formation(self.plt, view.states, view.selected, trails, size, palette)
        self.border_title = "formation from above, m (↑ north)"


class PlotsPanel(Panel, Vertical):
    """All plots where there is room for them, one at a time where there is not."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("p", "pause", "pause", tooltip="Freeze the plots, or let them run"),
        Binding("plus,equals_sign", "span(1)", "longer", tooltip="Plot a longer time"),
        Binding("minus", "span(-1)", "shorter", tooltip="Plot a shorter time"),
        Binding("left", "turn(-1)", "plot before", show=False),
        Binding("right", "turn(1)", "next plot", show=False),
        Binding("z", "zoom", "zoom", tooltip="One plot alone; ← and → show the others"),
    ]
    can_focus = True

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._span = 1
        self._until_s: float | None = None
        self._chosen = 0
        self._turn = 0
        self._view: FleetView | None = None

    def compose(self) -> ComposeResult:
        """Lay out the plots."""
        yield CachedStatic(markup=True, id="plots-about", classes="about")
        with Container(id="charts"):
            for name in _NAMES:
                chart = Chart(name, classes=f"panel chart -{name}")
                chart.set_class(name == _NAMES[0], "-chosen")
                yield chart

    def on_mount(self) -> None:
        """Draw one plot at a time."""
        self.set_interval(_DRAW_S, self._draw_next)

    def show_view(self, view: FleetView) -> None:
        """Keep the view; the plots are drawn one by one."""
        self._view = view
        self._say()

    @property
    def paused(self) -> bool:
        """Whether the plots are frozen."""
        return self._until_s is not None

    @property
    def span_s(self) -> float:
        """The time that is plotted [s]."""
        return _SPANS_S[self._span]

    @guarded
    def _draw_next(self) -> None:
        if self._view is None or not self.is_on_screen:
            return
        charts = [chart for chart in self.query(Chart) if chart.display and chart.size]
        for _ in charts:
            self._turn = (self._turn + 1) % len(charts)
            chart = charts[self._turn]
            if chart.attempt(chart.draw, self._view, self.span_s, self._until_s):
                return

    @property
    def is_on_screen(self) -> bool:
        """Whether this is the panel that is shown."""
        return self.size.width > 0 and self.app.screen is self.screen

    def _say(self) -> None:
        view = self._view
        if view is None:
            return
        at = f"paused at {seconds(self._until_s)} s" if self.paused else "live"
        uav = f"UAV {view.selected}" if view.selected is not None else "no vehicle yet"
        single = f" · {self._chosen + 1}/{len(_NAMES)} (← →)" if self._is_single else ""
        self.query_one("#plots-about", CachedStatic).say(
            f"[b]{uav}[/b] \\[ ] · [$primary]━ actual[/] [$accent]━ reference[/] · "
            f"last {self.span_s:g} s + - · {at} p{single}"
        )

    @property
    def _is_single(self) -> bool:
        roomy = self.screen.has_class("-tall") and not self.screen.has_class("-narrow")
        return self.has_class("-zoomed") or not roomy

    def action_pause(self) -> None:
        """Freeze or resume the plots."""
        state = self._view.state if self._view else None
        self._until_s = None if self.paused or state is None else state.time_s
        self._say()

    def action_span(self, step: int) -> None:
        """Plot a longer or shorter time."""
        self._span = min(max(self._span + step, 0), len(_SPANS_S) - 1)
        self._say()

    def action_turn(self, step: int) -> None:
        """Show another plot."""
        self._chosen = (self._chosen + step) % len(_NAMES)
        for chart in self.query(Chart):
            chart.set_class(chart.kind == _NAMES[self._chosen], "-chosen")
        self._say()

    def action_zoom(self) -> None:
        """Show one plot alone, or all."""
        self.toggle_class("-zoomed")
        self.post_message(Refresh())
