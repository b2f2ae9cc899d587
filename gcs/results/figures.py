"""Figures of a flight: its summary, and the one table of what is known of each UAV."""

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Generic, Literal, Self, TypeVar

from gcs.results import quantities
from gcs.results.ground import GroundSummary
from gcs.results.path_following import PassedCommand, PathSummary
from gcs.results.recording import Mode
from gcs.results.separation import SeparationSummary
from gcs.results.summary_parts import (
    BesideSummary,
    ChannelSummary,
    ControlFailure,
    DiagnosisSummary,
    MotionBands,
)
from gcs.results.traffic import KINDS

_Of = TypeVar("_Of")


@dataclass(frozen=True)
class UavSummary:
    """One UAV's part of a flight; errors are by quantity, None where no step has one.

    Attributes:
        id: System id.
        active_steps: Steps at which its law was evaluated.
        missing_steps: Steps at which no state reached its autopilot.
        saving: Share of the periodic sender's transmissions that were not sent.
        channels: By name, in the order of the paper's tables.
        actuator_messages: Messages that carried the events; several may travel in one.
        neighbour_messages: Messages to neighbours, one to each, after the first step.
        neighbour_saving: Share of messages saved against a sender in every step; None without
            neighbours.
        link_bytes: Size of `states` received, and of both kinds of messages sent, by kind; see
            `gcs.results.traffic`.
        iae: Integrals of absolute errors against the commands [m, deg s].
        iae_filtered: The same against the filtered reference.
        iae_sync: The same of the synchronisation errors (31) and (32) between the true states.
        max_error: Largest errors against the reference after the first second [m/s, deg].
        final_error: Largest ones within the last second [m/s, deg].
        attitude_lost_at_s: When roll or pitch was first more than 90° off [s]; None if never.
        heading_lost_at_s: The same for yaw.
        diagnosis: Decisions of its diagnosis, in order; none of a law without one.
        restarts: How often its autopilot was started again.
        path: How it followed the path of the mission; None in a flight without one.
        lowest_altitude_m: Least height of its centre of gravity above the ground [m]; below 0 it
            has hit it. None of a flight without steps, or of an earlier version.
        control_failure: Commands of its law that were not finite; None if all were.
        commands: Commands of its mission that it passed, and announced or would have, in order.
        ground: What became of it on the ground; None of an aircraft without gear.
        beside: Our trigger beside a foreign autopilot; None of an autopilot of ours.
        motion: Of one that a foreign autopilot flies, whose references are not known; else None.
    """

    id: int
    active_steps: int
    missing_steps: int
    saving: float | None
    channels: Mapping[str, ChannelSummary]
    actuator_messages: int
    neighbour_messages: int
    neighbour_saving: float | None
    link_bytes: Mapping[str, int]
    iae: Mapping[str, float | None]
    iae_filtered: Mapping[str, float | None]
    iae_sync: Mapping[str, float | None]
    max_error: Mapping[str, float | None]
    final_error: Mapping[str, float | None]
    attitude_lost_at_s: float | None
    heading_lost_at_s: float | None
    diagnosis: tuple[DiagnosisSummary, ...] = ()
    restarts: int = 0
    path: PathSummary | None = None
    lowest_altitude_m: float | None = None
    control_failure: ControlFailure | None = None
    commands: tuple[PassedCommand, ...] = ()
    ground: GroundSummary | None = None
    beside: BesideSummary | None = None
    motion: MotionBands | None = None

    def to_json(self) -> dict[str, Any]:
        """Return its part of `summary.json`."""
        derived = {figure.name: figure.of(self) for figure in UAV_FIGURES if figure.derived}
        return asdict(self) | derived

    @property
    def hit_ground(self) -> bool:
        """Whether it crashed into the ground, where its flight ended."""
        if self.ground is not None:
            return self.ground.outcome == "crashed"
        return self.lowest_altitude_m is not None and self.lowest_altitude_m < 0.0

    @property
    def false_alarms(self) -> int:
        """Actuators declared lost in which no fault had begun."""
        return sum(one.phase == "lost" and one.delay_s is None for one in self.diagnosis)

    @property
    def control_failed_at_s(self) -> float | None:
        """When its law first gave a command that was not finite [s]; None if never."""
        return None if self.control_failure is None else self.control_failure.time_s

    def first_delay_s(self, phase: Literal["lost", "back"]) -> float | None:
        """Return the delay of the first such decision that follows a fault [s]; None without."""
        return next(
            (o.delay_s for o in self.diagnosis if o.phase == phase and o.delay_s is not None), None
        )

    @property
    def events(self) -> int:
        """Events of all channels."""
        return sum(channel.events for channel in self.channels.values())

    @property
    def min_interval_s(self) -> float | None:
        """Shortest time between two events of one channel [s]; None if no channel has two."""
        gaps = (channel.min_interval_s for channel in self.channels.values())
        return min((gap for gap in gaps if gap is not None), default=None)


@dataclass(frozen=True)
class FlightSummary:
    """The content of `summary.json`.

    Attributes:
        scenario: Name of the scenario.
        completed: Whether the flight reached the scenario's end, and all laws controlled it.
        loss: Why it did not, or which law failed; None if it is completed.
        mode: How it was flown.
        duration_s: Simulated time flown [s].
        steps: Control periods flown.
        wall_s: Wall-clock time that they took [s].
        real_time_factor: Simulated by wall-clock time; None if the latter is 0.
        saving: Share of the periodic senders' transmissions that were not sent.
        neighbour_saving: The same of the neighbour messages; None without neighbours.
        uavs: In the order of the scenario.
        separation: Least distance between two UAVs; None for a single one.
    """

    scenario: str
    completed: bool
    loss: str | None
    mode: Mode
    duration_s: float
    steps: int
    wall_s: float
    real_time_factor: float | None
    saving: float | None
    neighbour_saving: float | None
    uavs: tuple[UavSummary, ...]
    separation: SeparationSummary | None = None

    @property
    def hit_ground(self) -> bool:
        """Whether an aircraft hit the ground, which ended the flight."""
        return any(uav.hit_ground for uav in self.uavs)

    @property
    def control_failed(self) -> bool:
        """Whether a law gave a command that was not finite."""
        return any(uav.control_failure is not None for uav in self.uavs)

    @property
    def departure(self) -> tuple[Literal["attitude_lost", "heading_lost"], str] | None:
        """Which of attitude and heading was lost, the worse first, and a text; None if neither."""
        parts: tuple[tuple[Literal["attitude_lost", "heading_lost"], str], ...] = (
            ("attitude_lost", "roll or pitch"),
            ("heading_lost", "yaw"),
        )
        for lost, part in parts:
            times = ((getattr(uav, f"{lost}_at_s"), uav.id) for uav in self.uavs)
            first = min(((at, uav) for at, uav in times if at is not None), default=None)
            if first is not None:
                return lost, f"UAV {first[1]} was more than 90° off in {part} at {first[0]:g} s"
        return None

    def uav(self, system: int) -> UavSummary | None:
        """Return the part of one UAV, by its system id; None if it did not fly."""
        return next((uav for uav in self.uavs if uav.id == system), None)

    def to_json(self) -> dict[str, Any]:
        """Return the summary as plain data, with the keys of `summary.json`."""
        return {**asdict(self), "uavs": [uav.to_json() for uav in self.uavs]}

    @classmethod
    def from_json(cls, tree: object) -> Self:
        """Read what `to_json` made.

        Raises:
            ValueError: It is something else.
        """
        reader: Any = _adapter
        read: Self = reader(cls).validate_python(tree)
        return read


@functools.cache
def _adapter(cls: type) -> Any:
    """Return what reads a class from plain data; to make it takes longer than a hundred reads."""
    from pydantic import TypeAdapter

    return TypeAdapter(cls)


@dataclass(frozen=True)
class Figure(Generic[_Of]):
    """A figure of a UAV, or of a whole flight.

    Attributes:
        name: Column of a campaign's results (after ``uavK.``), and of CSV files.
        unit: Empty for counts and shares.
        of: Returns it; None where there is none.
        text: Formats it for people.
        better: "higher" or "lower"; None where neither is good.
        whole: Whether it is a whole number.
        derived: Whether `summary.json` has it beside what it follows from.
        in_csv: Column of CSV files, if it is another.
    """

    name: str
    unit: str
    of: Callable[[_Of], float | None]
    text: Callable[[Any], str] = "{:.2f}".format
    better: Literal["higher", "lower"] | None = "lower"
    whole: bool = False
    derived: bool = False
    in_csv: str = ""

    @property
    def heading(self) -> str:
        """Its column in CSV files."""
        return self.in_csv or self.name

    @property
    def is_share(self) -> bool:
        """Whether it is a share of a whole."""
        return self.text is quantities.percent


def _count(name: str, of: Callable[[_Of], float | None], *, derived: bool = False) -> Figure[_Of]:
    return Figure(name, "", of, str, whole=True, derived=derived)


def _share(name: str, of: Callable[[_Of], float | None]) -> Figure[_Of]:
    return Figure(name, "", of, quantities.percent, "higher")


def _time(
    name: str, of: Callable[[_Of], float | None], *, better: Any = None, derived: bool = False
) -> Figure[_Of]:
    return Figure(name, "s", of, quantities.milliseconds, better, derived=derived)


def _by_quantity(
    name: str, units: Mapping[str, str], *, unit_in_csv: bool = False
) -> Iterator[Figure[UavSummary]]:
    for quantity, unit in units.items():
        in_csv = f"{name}_{quantity}_{unit.replace(' ', '_')}" if unit_in_csv else ""
        yield Figure(f"{name}_{quantity}", unit, _part_of(name, quantity), in_csv=in_csv)


def _part_of(field: str, key: str) -> Callable[[UavSummary], Any]:
    return lambda uav: getattr(uav, field)[key]


def _events_of(channel: str) -> Callable[[UavSummary], int]:
    return lambda uav: uav.channels[channel].events


def _at_touchdown(name: str) -> Callable[[UavSummary], float | None]:
    def of(uav: UavSummary) -> float | None:
        worst = None if uav.ground is None else uav.ground.worst
        return None if worst is None else abs(getattr(worst, name))

    return of


def _off_centre(uav: UavSummary) -> float | None:
    """Return how far from its runway's centre line it was on the ground [m]."""
    return None if uav.ground is None else uav.ground.off_centre_m


def _landed(uav: UavSummary) -> int | None:
    """Return 1 of one that landed within its limits, 0 of another with gear."""
    return None if uav.ground is None else int(uav.ground.outcome == "landed")


def _beside_events(uav: UavSummary) -> int | None:
    return None if uav.beside is None else sum(uav.beside.events.values())


def _beside_messages(uav: UavSummary) -> int | None:
    return None if uav.beside is None else uav.beside.messages


def _on_path(name: str) -> Callable[[UavSummary], float | None]:
    return lambda uav: None if uav.path is None else getattr(uav.path, name)


UAV_FIGURES: list[Figure[UavSummary]] = [
    _share("saving", lambda uav: uav.saving),
    *_by_quantity("iae", quantities.IAE_UNITS, unit_in_csv=True),
    *(_count(f"events_{channel}", _events_of(channel)) for channel in quantities.PAPER_ORDER),
    _time("min_interval_s", lambda uav: uav.min_interval_s, derived=True),
    _time("attitude_lost_at_s", lambda uav: uav.attitude_lost_at_s),
    _time("heading_lost_at_s", lambda uav: uav.heading_lost_at_s),
    _time("control_failed_at_s", lambda uav: uav.control_failed_at_s),
    Figure("lowest_altitude_m", "m", lambda uav: uav.lowest_altitude_m, better="higher"),
    *(
        Figure(f"touchdown_{name}", unit, _at_touchdown(name))
        for name, unit in {"sink_m_s": "m/s", "bank_deg": "deg", "drift_m_s": "m/s"}.items()
    ),
    Figure("off_centre_m", "m", _off_centre),
    Figure("landed", "", _landed, "{:g}".format, "higher"),
    _count("messages", lambda uav: uav.actuator_messages),
    _count("neighbour_messages", lambda uav: uav.neighbour_messages),
    _share("neighbour_saving", lambda uav: uav.neighbour_saving),
    *_by_quantity("iae_sync", quantities.IAE_UNITS),
    *(_count(f"bytes_{kind}", _part_of("link_bytes", kind)) for kind in KINDS),
    *_by_quantity("iae_filtered", quantities.IAE_UNITS),
    *_by_quantity("max_error", quantities.UNITS),
    *_by_quantity("final_error", quantities.UNITS),
    _count("events", lambda uav: uav.events, derived=True),
    _time("detection_s", lambda uav: uav.first_delay_s("lost"), better="lower", derived=True),
    _time("return_s", lambda uav: uav.first_delay_s("back"), better="lower", derived=True),
    _count("false_alarms", lambda uav: uav.false_alarms, derived=True),
    *(Figure(name, "m", _on_path(name)) for name in quantities.PATH_FIGURES),
    Figure("beside_events", "", _beside_events, "{:g}".format),
    Figure("beside_messages", "", _beside_messages, "{:g}".format),
]
"""Every figure of a UAV. `summary.json`, the results of campaigns, CSV files of sweeps and of
`gcs reproduce` and the results in tests have these, and one more with a further row."""


def shown_figure(name: str, value: Any) -> str:
    """Format a figure of a UAV for people, by its name; a dash for none."""
    (text,) = (figure.text for figure in UAV_FIGURES if figure.name == name)
    return "-" if value is None else text(value)


FLIGHT_FIGURES: tuple[Figure[FlightSummary], ...] = (
    Figure("duration_s", "s", lambda flight: flight.duration_s, better=None),
    _share("saving", lambda flight: flight.saving),
    _count("events", lambda flight: sum(uav.events for uav in flight.uavs)),
    _count("messages", lambda flight: sum(uav.actuator_messages for uav in flight.uavs)),
    _count("neighbour_messages", lambda flight: sum(u.neighbour_messages for u in flight.uavs)),
    _share("neighbour_saving", lambda flight: flight.neighbour_saving),
    Figure(
        "least_separation_m",
        "m",
        lambda flight: flight.separation.least_m if flight.separation else None,
        better="higher",
    ),
    Figure("wall_s", "s", lambda flight: flight.wall_s, better=None),
)
"""Figures of a whole flight."""


def figure_of(name: str) -> Figure[Any] | None:
    """Return a figure of a UAV or a flight, by its name; None if there is no such figure."""
    figures: list[Figure[Any]] = [*UAV_FIGURES, *FLIGHT_FIGURES]
    return next((figure for figure in figures if figure.name == name), None)


def better_of(name: str) -> str | None:
    """Return whether "higher" or "lower" is better of a figure of a UAV or a flight, by its name.

    None where neither is, or if there is no such figure.
    """
    figure = figure_of(name)
    return None if figure is None else figure.better
