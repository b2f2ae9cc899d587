"""One entry of the list of what was flown."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from typing import Any, Literal, Self, get_args

from gcs.results.quantities import QUANTITIES

Kind = Literal["flight", "fleet", "ardupilot", "campaign", "sweep", "baseline", "reproduce"]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""What made a folder: gcs fly, up, ardupilot, campaign, sweep, baseline, reproduce."""

Outcome = Literal[
    "completed",
    "heading_lost",
    "attitude_lost",
    "ground",
    "control_failed",
    "lost",
    "interrupted",
    "killed",
    "unfinished",
    "under_way",
]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
"""How a run ended, from best to worst. ``lost``: a flight did not reach its end; ``interrupted``:
by Ctrl-C or another signal; ``killed``: its process ended without a word; ``unfinished``: a
campaign has flights to fly; ``under_way``: a process flies it now."""

_UNSETTLED = {"killed", "unfinished", "under_way"}


@dataclass(frozen=True)
class Run:
    """One folder of results.

    Figures are None where a run has none. A campaign's or a sweep's are medians over the
    flights that completed, its IAEs the worst of them.

    Attributes:
        name: Folder, relative to the one that is listed.
        kind: What made it.
        time: When it began, as of `utc`; for a flight of an earlier version when its results were
            written.
        scenario: As the user named it; for a flight of an earlier version the scenario's name.
        title: Name of the scenario, or of the campaign.
        changes: What was changed against the scenario, as on the command line.
        law: Kind of the control law; several of a campaign with commas.
        trigger: Mode of the trigger, in the same way.
        faults: Faults of the scenario, each as a text.
        uavs: Number of UAVs.
        flights: Flights that ended; 1 of a flight.
        planned: Flights that were planned.
        completed: Flights that reached their end with attitude and heading kept.
        duration_s: Simulated time flown [s].
        messages: Messages with actuator commands, of all UAVs.
        events: Transmissions of a channel's command, of all UAVs; several may share a message.
        saving: Share of a periodic sender's transmissions that was not sent.
        iae: Largest integral of the absolute error of any UAV, by quantity [m, deg s].
        outcome: How it ended.
        reason: Why not better.
        version: Version of the package that flew it.
        digest: Digest of the code that flew it.
        note: Of the user.
    """

    name: str
    kind: Kind
    time: str
    outcome: Outcome
    reason: str = ""
    scenario: str = ""
    title: str = ""
    changes: tuple[str, ...] = ()
    law: str = ""
    trigger: str = ""
    faults: tuple[str, ...] = ()
    uavs: int | None = None
    flights: int | None = None
    planned: int | None = None
    completed: int | None = None
    duration_s: float | None = None
    messages: int | None = None
    events: int | None = None
    saving: float | None = None
    iae: Mapping[str, float | None] = field(default_factory=dict)
    version: str = ""
    digest: str = ""
    note: str = ""

    @property
    def worst_angle(self) -> str | None:
        """Angle with the largest IAE; None if there is none."""
        known = {name: self.iae.get(name) for name in QUANTITIES[1:]}
        found = [(value, name) for name, value in known.items() if value is not None]
        return max(found)[1] if found else None

    @property
    def is_settled(self) -> bool:
        """Whether it stays as it is, unless one of its files changes."""
        return self.outcome not in _UNSETTLED

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data, one level deep: an IAE is ``iae_QUANTITY``."""
        tree = asdict(self)
        iae = tree.pop("iae")
        return {**tree, **{f"iae_{name}": iae.get(name) for name in QUANTITIES}}

    @classmethod
    def from_json(cls, tree: Mapping[str, Any]) -> Self:
        """Read what `to_json` made.

        Raises:
            TypeError, KeyError: It is something else.
        """
        rest = dict(tree)
        rest["iae"] = {name: rest.pop(f"iae_{name}") for name in QUANTITIES}
        rest |= {name: tuple(rest[name]) for name in ("changes", "faults")}
        return cls(**rest)


def utc(moment: datetime) -> str:
    """Return a time as a text that sorts by time: ISO 8601 in UTC, to the second."""
    return moment.astimezone(UTC).isoformat(timespec="seconds")
