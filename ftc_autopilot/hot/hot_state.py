"""The interface between the services of a vehicle and its compiled loop."""

from typing import Generic, TypeVar

import numpy as np

from ftc_autopilot.hot.state import Autopilots, reset_links
from mavlink_defs.dialect import FTC_SIM_FLAGS_RUNNING

T = TypeVar("T")


class _Field(Generic[T]):
    """A number of a record, by the attribute's name."""

    def __init__(self, record: str) -> None:
        self._record = record

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, hot: "HotState", owner: type) -> T:
        value: T = getattr(hot, self._record)[self._name].tolist()
        return value

    def __set__(self, hot: "HotState", value: T) -> None:
        getattr(hot, self._record)[self._name][...] = value


def _numbers(records: np.ndarray) -> dict[str, np.ndarray]:
    """Return the fields of the only record of an array, sharing its memory."""
    return {name: records[name][0, ...] for name in records.dtype.names or ()}


class HotState:
    """A typed view of one of `Autopilots`; between two steps it may be read and written.

    Attributes:
        step: Last running step handled, -1 if none.
        step_us: Control period [µs].
        flags: FTC_SIM_FLAGS of the last state.
        heard_s: Wall-clock time of the last state [s], 0 if none.
        repeated: Events sent again, by channel.
        sequence: Frames sent to the plant.
        edge_changes: Neighbours dropped or restored.
        measured: Last state, received or estimated, dtype `mavlink_defs.framing.codec.SIM_STATE`.
        navigation: Sensors and estimator, record of dtype `NAVIGATION`.
        neighbours: System ids of the neighbours.
        edges: 1 for each neighbour that is heard, 0 for a dropped one, shape (degree,).
        drops: Datagrams dropped, by link (GCS, FORMATION, SIMULATOR, PLANT of
            `ftc_autopilot.hot.drops`) and negated `DropReason`.
    """

    step = _Field[int]("_link")
    step_us = _Field[int]("_link")
    flags = _Field[int]("_link")
    heard_s = _Field[float]("_link")
    repeated = _Field[list[int]]("_link")
    sequence = _Field[int]("_link")
    edge_changes = _Field[int]("_formation")

    def __init__(self, autopilot: Autopilots) -> None:
        self._autopilot, self._own = autopilot, autopilot.own[0]
        self._link = _numbers(autopilot.own["link"])
        self._formation = _numbers(autopilot.own["formation"])
        self.measured: np.void = self._own["measured"]
        self.navigation: np.void = self._own["navigation"]
        self._time_us = autopilot.own["measured"]["time_usec"]
        self.neighbours: list[int] = autopilot.edges[0]["system"].tolist()
        self.edges = autopilot.edges[0]["edge"]
        self.drops: np.ndarray = self._own["drops"]

    @property
    def time_us(self) -> int:
        """Simulation time of the last state [µs]."""
        return int(self._time_us[0])

    @property
    def time_ms(self) -> int:
        """Simulation time of the last state, as in a `time_boot_ms` [ms]."""
        return self.time_us // 1000 % 2**32

    @property
    def oldest_state_us(self) -> int:
        """Longest time for which it acted on one state, of the last second or two [µs, simulated].

        0 in lockstep, where simulated time waits.
        """
        return int(self._link["oldest"].max()) * self.step_us

    @property
    def time_s(self) -> float:
        """Simulation time of the last state [s]."""
        return self.time_us * 1e-6

    @property
    def running(self) -> bool:
        """Whether simulated time runs."""
        return bool(self.flags & FTC_SIM_FLAGS_RUNNING)

    def reset(self) -> None:
        """Forget the flight, as `reset_links` does."""
        reset_links(self._autopilot)

    def received(self) -> bytes:
        """Return the datagram for which the loop returned `Outcome.SERVICE`."""
        buffer = self._own["received"]["bytes"]
        return bytes(buffer[: self._link["received"].item()])
