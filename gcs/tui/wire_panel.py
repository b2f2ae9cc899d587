"""The savings of event triggering: events and rates per vehicle and channel."""

from typing import Any

from gcs.station.event_counts import EventCounts
from gcs.tui.formatting import Cell, count, number, percent, sparkline
from gcs.tui.grid import Grid, GridColumn, Row
from gcs.tui.view import FleetView
from mavlink_defs.constants import ACTUATORS

_FIXED = (
    GridColumn("UAV", 3),
    GridColumn("channel", 8, "left"),
    GridColumn("events", 8),
    GridColumn("10 s", 6),
    GridColumn("saved", 7),
    GridColumn("shortest", 8),
    GridColumn("repeats", 7),
    GridColumn("now/s", 6),
)
_SPARK_MAX = 60
_SPARK_BIN_S = 1.0
_LATEST_S = 2.0
_TITLE_EDGES = 6  # of a border around its title

_Rates = tuple[float, list[list[float]]]


class WirePanel(Grid):
    """Events, savings and rates of every channel of every vehicle."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("no event counters yet", **kwargs)
        self.border_title = "Wire"
        self._rates: dict[int, _Rates] = {}

    def show_view(self, view: FleetView) -> None:
        """Show the counters."""
        rest = self.room - sum(column.width + 1 for column in _FIXED)
        bins = min(max(rest, 8), _SPARK_MAX)
        title = f"events/s, last {bins} s"
        columns = (*_FIXED, GridColumn(title if len(title) <= rest else "events/s", 0, "left"))
        rows = [row for state in view.states for row in self._rows(state.system, state.counts)]
        self.show(columns, rows)
        self.border_title = _totals(view, self.size.width)

    def _rows(self, system: int, counts: EventCounts) -> list[Row]:
        recent, rates = counts.recent(), self._rates_of(system, counts)
        rows = []
        for i, name in enumerate(ACTUATORS):
            shortest = counts.min_interval_s[i]
            cells: tuple[Cell, ...] = (
                (str(system) if i == 0 else "", "strong"),
                (name, ""),
                (count(counts.events[i]), ""),
                (count(recent[i]), ""),
                (percent(counts.savings[i]), "good"),
                ("–" if shortest is None else f"{1e3 * shortest:.0f} ms", "muted"),
                (count(counts.repeats[i]), "warn" if counts.repeats[i] else "muted"),
                (_latest(rates[i]), ""),
                (self._spark(rates[i]), "accent"),
            )
            rows.append(Row((system, name), cells))
        together = [sum(values) for values in zip(*rates, strict=True)]
        cells = (
            ("", ""),
            ("all", "strong"),
            (count(counts.total), "strong"),
            (count(sum(recent)), "strong"),
            (percent(counts.saving), "good"),
            ("", ""),
            (count(sum(counts.repeats)), "warn" if sum(counts.repeats) else "muted"),
            (_latest(together), "strong"),
            (self._spark(together), "accent"),
        )
        return [*rows, Row((system, "all"), cells)]

    def _spark(self, rates: list[float]) -> str:
        fixed = sum(column.width + 1 for column in _FIXED)
        return sparkline(rates, min(max(self.room - fixed, 8), _SPARK_MAX))

    def _rates_of(self, system: int, counts: EventCounts) -> list[list[float]]:
        """Rates per channel, looked up once per simulated second: that is costly."""
        known = self._rates.get(system)
        if known is None or not 0.0 <= counts.time_s - known[0] < _SPARK_BIN_S:
            rates = counts.rates(_SPARK_MAX, _SPARK_BIN_S).T.tolist()
            known = self._rates[system] = (counts.time_s, rates)
        return known[1]


def _latest(rates: list[float]) -> str:
    return number(sum(rates[-2:]) / _LATEST_S, 0)


def _totals(view: FleetView, width: int) -> str:
    """Return the sums of all vehicles, as many as fit."""
    fleet = view.source.fleet
    periodic = 4 * sum(state.counts.steps for state in view.states)
    repeats = sum(sum(state.counts.repeats) for state in view.states)
    to_actuators = sum(state.counts.messages for state in view.states)
    to_neighbours = sum(state.counts.neighbour_messages for state in view.states)
    parts = (
        f"{count(fleet.events)} events instead of {count(periodic)}: "
        f"{percent(fleet.saving, 2)} saved",
        f"{count(repeats)} repeats",
        f"{count(to_actuators)} actuator, {count(to_neighbours)} neighbour messages",
    )
    title = "Wire"
    for part in parts:
        longer = f"{title} · {part}"
        if len(longer) + _TITLE_EDGES <= width:
            title = longer
    return title
