"""Two flights compared: what differs in their scenarios, and in what they did."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.triggers import TRIGGERS
from gcs.console.errors import BadInput
from gcs.console.terminal import marked, numbers, table_of, texts
from gcs.results.figures import UAV_FIGURES, Figure, FlightSummary, UavSummary
from gcs.results.flight_mark import FLIGHT, INTERRUPTED, is_under_way, read_mark
from gcs.results.quantities import QUANTITIES
from gcs.results.rivals import LEGEND, beaten_by, cost_of, flight_of, law_of
from gcs.results.run_folder import read_summary
from gcs.results.runs.details import leaves, scenario_keys
from gcs.results.runs.read import outcome_of
from gcs.results.runs.scan import SUMMARY

_NAMES = ("messages", "events", "saving", "neighbour_messages")
_BY_QUANTITY = ("iae", "max_error")
_COMPARED = (
    *_NAMES,
    *(f"{figure}_{quantity}" for figure in _BY_QUANTITY for quantity in QUANTITIES),
    *("attitude_lost_at_s", "heading_lost_at_s", "control_failed_at_s", "lowest_altitude_m"),
)
_TITLES = {"iae": "IAE of", "max_error": "largest error of"}


def is_flight(folder: Path) -> bool:
    """Return whether a folder is a flight's."""
    return any((folder / name).exists() for name in (SUMMARY, FLIGHT))


class EndedFlight:
    """A flight that ended.

    Attributes:
        folder: Its run folder.
        summary: Its figures.
        keys: Every key of its scenario; none of an earlier version, which did not store it.
        mark: What it was flown for; None of an earlier version.
        digest: Digest of the code that flew it; "" if it is unknown.
    """

    def __init__(self, folder: Path) -> None:
        """Read a run folder.

        Raises:
            BadInput: It is of no flight, or of one that has not ended or has no figures.
        """
        if is_under_way(folder):
            raise BadInput(f"the flight in {folder} is under way", "wait for its end")
        if not (folder / SUMMARY).exists():
            raise BadInput(
                f"{folder} has no {SUMMARY}: its flight was interrupted, or never ended",
                "gcs runs says what is known of it",
            )
        self.folder = folder
        self.summary: FlightSummary = read_summary(folder)
        self.keys = scenario_keys(folder)
        self.mark = mark = read_mark(folder)
        self.digest = "" if mark is None else mark.digest

    def cost(self, figure: Figure[UavSummary], system: int) -> float:
        """Return a figure of a UAV as a cost, as of `gcs.results.rivals`."""
        uav = self.summary.uav(system)
        if uav is None or (self.mark is not None and self.mark.ended == INTERRUPTED):
            return math.nan
        return cost_of(figure.name, figure.of(uav)) if self.summary.completed else math.inf

    @property
    def ending(self) -> str:
        """How it ended, and how long it was."""
        outcome, reason = outcome_of(self.summary)
        text = f"{outcome.replace('_', ' ')}, {self.summary.duration_s:g} s"
        return f"{text}: {reason}" if reason else text


def difference(
    old: EndedFlight, new: EndedFlight, *, everything: bool = False
) -> Iterator[Table | str]:
    """Yield what two flights have not in common, as tables and lines for the terminal.

    Args:
        old: The flight to compare with.
        new: The flight in question.
        everything: Also list keys that only the law, or the trigger, of one of them has, and that
            have their defaults.
    """
    yield f"{old.folder}: {old.ending}"
    yield f"{new.folder}: {new.ending}"
    yield from _set(old, new)
    yield _figures(old, new)
    if law_of(old.keys) != law_of(new.keys) and flight_of(old.keys) != flight_of(new.keys):
        yield "more than law and trigger differs: nothing is marked where the simpler law is better"
    yield from _diagnoses(old, new)
    yield from _keys(old, new, everything)
    if old.digest and new.digest:
        same = old.digest == new.digest
        yield "both were flown by the same code" if same else "they were flown by different codes"


def difference_data(old: EndedFlight, new: EndedFlight) -> dict[str, Any]:
    """Return the same as data for JSON: figures by name, in the units of summaries.

    `scenario` is null if one of them has stored none, `same_code` if it is unknown.
    """
    flights = {"old": old, "new": new}
    ids = sorted({uav.id for flight in flights.values() for uav in flight.summary.uavs})
    known = bool(old.keys and new.keys)
    return {
        **{name: _ending_data(flight) for name, flight in flights.items()},
        "same_flight": flight_of(old.keys) == flight_of(new.keys) if known else None,
        "uavs": [_uav_data(system, flights) for system in ids],
        "scenario": {
            name: {which: flight.keys.get(name) for which, flight in flights.items()}
            for name in _differing(old, new)
        }
        if known
        else None,
        "same_code": old.digest == new.digest if old.digest and new.digest else None,
    }


def _ending_data(flight: EndedFlight) -> dict[str, Any]:
    outcome, reason = outcome_of(flight.summary)
    return {
        "folder": str(flight.folder),
        "outcome": outcome,
        "reason": reason or None,
        "duration_s": flight.summary.duration_s,
    }


def _uav_data(system: int, flights: Mapping[str, EndedFlight]) -> dict[str, Any]:
    uavs = {name: flight.summary.uav(system) for name, flight in flights.items()}
    by_name = {figure.name: figure for figure in UAV_FIGURES}
    figures = {}
    for name in _COMPARED:
        values = {
            which: None if uav is None else by_name[name].of(uav) for which, uav in uavs.items()
        }
        before, after = values["old"], values["new"]
        change = None if before is None or after is None else after - before
        beaten = _beaten(flights["old"], flights["new"], by_name[name], system)
        figures[name] = {**values, "change": change, "beaten_by": next(filter(None, beaten), None)}
    diagnosis = {
        which: None if uav is None else [asdict(one) for one in uav.diagnosis]
        for which, uav in uavs.items()
    }
    return {"uav": system, "figures": figures, "diagnosis": diagnosis}


def _beaten(
    old: EndedFlight, new: EndedFlight, figure: Figure[UavSummary], system: int
) -> tuple[str | None, str | None]:
    """Return which simpler law did better in a figure than either flight, if they can be compared.

    A flight that was lost is worse than any; one that was interrupted is not compared.
    """
    if not old.keys or flight_of(old.keys) != flight_of(new.keys):
        return None, None
    before, after = ((law_of(one.keys), one.cost(figure, system)) for one in (old, new))
    return beaten_by(*before, [after]), beaten_by(*after, [before])


def _figures(old: EndedFlight, new: EndedFlight) -> Table:
    """Return the figures of every UAV, with the change of each."""
    columns = (texts("UAV"), texts("figure"), *map(numbers, ("old", "new", "change", "in %")))
    table = table_of(*columns, title="Figures", box=box.SIMPLE_HEAD)
    ids = sorted({uav.id for flight in (old, new) for uav in flight.summary.uavs})
    by_name = {figure.name: figure for figure in UAV_FIGURES}
    for system in ids:
        before, after = old.summary.uav(system), new.summary.uav(system)
        label = str(system)
        for name in _COMPARED:
            row = _row(by_name[name], before, after)
            if row is not None:
                title, *values = row
                beaten = _beaten(old, new, by_name[name], system)
                for place, by in enumerate(beaten):
                    if by is not None:
                        table.caption = f"*: {LEGEND}"
                        values[place] = marked(str(values[place]), is_marked=True)
                table.add_row(label, title, *values)
                label = ""
        table.add_section()
    return table


def _row(
    figure: Figure[UavSummary], old: UavSummary | None, new: UavSummary | None
) -> tuple[str | Text, ...] | None:
    """Return a row of the table; None if neither flight has the figure."""
    values = [None if uav is None else figure.of(uav) for uav in (old, new)]
    if values == [None, None]:
        return None
    shown = ["-" if value is None else figure.text(value) for value in values]
    before, after = values
    if before is None or after is None:
        return (_title(figure), *shown, "", "")
    change = after - before
    share = f"{100.0 * change / abs(before):+.1f}" if before else ""
    if figure.name == "saving":
        return (_title(figure), *shown, f"{100.0 * change:+.2f} points", "")
    text = f"{change:+d}" if figure.whole else f"{change:+.3g}"
    return (_title(figure), *shown, text if change else "0", share if change else "")


def _title(figure: Figure[UavSummary]) -> str:
    for name, title in _TITLES.items():
        if figure.name.startswith(f"{name}_"):
            return f"{title} {figure.name.removeprefix(f'{name}_')} [{figure.unit}]"
    name = figure.name.removesuffix("_s").removesuffix("_m").replace("_", " ")
    return f"{name} [{figure.unit}]" if figure.unit else name.replace("saving", "saved")


def _diagnoses(old: EndedFlight, new: EndedFlight) -> Iterator[str]:
    """Yield the decisions of every UAV's diagnosis, where the flights differ."""
    ids = sorted({uav.id for flight in (old, new) for uav in flight.summary.uavs})
    for system in ids:
        decided = [_decisions(flight.summary.uav(system)) for flight in (old, new)]
        if decided[0] != decided[1]:
            for name, text in zip(("old", "new"), decided, strict=True):
                yield f"diagnosis of UAV {system}, {name}: {text}"


def _decisions(uav: UavSummary | None) -> str:
    if uav is None:
        return "no such UAV"
    parts = [
        f"{one.actuator} {one.phase} at {one.time_s:.3f} s"
        + ("" if one.delay_s is None else f", {1e3 * one.delay_s:g} ms after its cause")
        for one in uav.diagnosis
    ]
    return "; ".join(parts) or "nothing declared"


def _set(old: EndedFlight, new: EndedFlight) -> Iterator[str]:
    """Yield what was set differently: scenario, law, trigger, and changes on the command line."""
    if old.mark is None or new.mark is None:
        return
    for what in ("scenario", "law", "trigger", "changes"):
        before, after = (getattr(flight.mark, what) for flight in (old, new))
        if before != after:
            shown = [
                (" ".join(one) or "none") if what == "changes" else one for one in (before, after)
            ]
            yield f"{what}: {shown[0]} → {shown[1]}"


def _keys(old: EndedFlight, new: EndedFlight, everything: bool) -> Iterator[str]:
    """Yield the keys of the scenarios that differ, each in a line."""
    without = [str(flight.folder) for flight in (old, new) if not flight.keys]
    if without:
        yield (
            f"{' and '.join(without)} {'has' if len(without) == 1 else 'have'} no scenario.yaml: "
            "what differs in the scenarios is unknown"
        )
        return
    differing = _differing(old, new)
    if not differing:
        yield "their scenarios are the same"
        return
    count = len(_compared_keys(old, new))
    yield f"{len(differing)} of {count} keys of their scenarios differ, old → new:"
    folded: Counter[str] = Counter()
    defaults = [{} if everything else _defaults_of_one(*pair) for pair in ((old, new), (new, old))]
    for name in differing:
        owner = next((group[name] for group in defaults if name in group), None)
        if owner is None:
            yield f"  {name}: {old.keys.get(name, '-')} → {new.keys.get(name, '-')}"
        else:
            folded[owner] += 1
    for owner, number in folded.items():
        yield f"  {owner} only, at their defaults: {number} keys (--all lists them)"


def _defaults_of_one(flight: EndedFlight, other: EndedFlight) -> dict[str, str]:
    """Return which keys only one flight has, as defaults of its law or trigger, and whose."""
    own = {}
    sections: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
        ("controller", "kind", LAWS),
        ("trigger", "mode", TRIGGERS),
    )
    for section, name, models in sections:
        kind = flight.keys.get(f"{section}.{name}", "")
        if (model := models.get(kind)) is not None:
            for key, value in leaves(model().model_dump(mode="json"), section):
                if key not in other.keys and flight.keys.get(key) == value:
                    own[key] = f"{section}: of {kind}"
    return own


def _compared_keys(old: EndedFlight, new: EndedFlight) -> list[str]:
    """Return the keys of both scenarios, but for their names."""
    return [name for name in dict.fromkeys((*old.keys, *new.keys)) if name != "name"]


def _differing(old: EndedFlight, new: EndedFlight) -> list[str]:
    """Return the keys of the scenarios that differ."""
    return [name for name in _compared_keys(old, new) if old.keys.get(name) != new.keys.get(name)]
