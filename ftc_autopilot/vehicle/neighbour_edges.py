"""Texts of an autopilot whose neighbours fall silent, or are heard again."""

from collections.abc import Iterator

from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from mavlink_defs import dialect


class NeighbourEdges:
    """Reports every neighbour that was dropped or restored; the first states are no change."""

    def __init__(self, hot: HotState) -> None:
        self._hot = hot
        self._edges, self._edge_changes = hot.edges.tolist(), 0

    def changes(self) -> Iterator[Change]:
        """Yield what has changed since the last call."""
        before, self._edges = self._edges, self._hot.edges.tolist()
        if self._hot.edge_changes == self._edge_changes:
            return
        self._edge_changes = self._hot.edge_changes
        for uav, edge, edge_before in zip(self._hot.neighbours, self._edges, before, strict=True):
            if edge != edge_before:
                event = "heard again, edge restored" if edge else "silent, edge dropped"
                who = f"neighbour {uav}"
                yield Change(who, dialect.MAV_SEVERITY_WARNING, f"{who} {event}")
