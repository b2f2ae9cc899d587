"""Reading one folder of results into an entry of the list."""

import json
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gcs.console.errors import BadInput
from gcs.console.extras import load_lab
from gcs.results.figures import FlightSummary
from gcs.results.flight_mark import DONE, INTERRUPTED, FlightMark, is_under_way, read_mark
from gcs.results.quantities import QUANTITIES
from gcs.results.run_folder import read_summary
from gcs.results.runs.recorded import figures_so_far
from gcs.results.runs.run import Kind, Outcome, Run, utc
from gcs.results.runs.scan import NOTE, SUMMARY, Found
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.user_files import open_file

_KINDS: Mapping[str, Kind] = {"fly": "flight", "up": "fleet", "ardupilot": "ardupilot"}
_MAX_NOTE = 10_000


def read_run(found: Found) -> Run:
    """Read a folder of results.

    Raises:
        BadInput: It has something else than its files' names promise.
        OSError: It cannot be read, or is gone.
    """
    try:
        match found.kind:
            case "campaign":
                facts = load_lab("campaigns.listing").facts_of(found.path)
            case "baseline":
                facts = _baseline(found.path)
            case "reproduce":
                facts = _reproduce(found.path)
            case _:
                facts = _flight(found.path)
    except ConfigError as problem:
        raise BadInput(problem.lines[0]) from None
    return Run(**{"name": found.name, "note": read_note(found.path), **facts})


def read_note(folder: Path) -> str:
    """Return the user's note on a run; "" if there is none."""
    try:
        with open_file(folder / NOTE) as file:
            return file.read(_MAX_NOTE).decode("utf-8", "replace").strip()
    except OSError:
        return ""


def _flight(folder: Path) -> dict[str, Any]:
    """Return the facts of a flight, however far it came."""
    mark = read_mark(folder)
    summary = read_summary(folder) if (folder / SUMMARY).exists() else None
    facts = _of_mark(mark) | ({} if summary is None else _of_summary(summary))
    if mark is None:
        facts["time"] = _time_of(folder / SUMMARY if summary else folder)
        facts["scenario"] = facts.get("title", "")
        if summary is not None and _has_frames(folder):
            facts |= {"kind": "ardupilot", "law": "ArduPilot"}
    if summary is None or is_under_way(folder):
        facts |= figures_so_far(folder) if summary is None else {}
        facts["outcome"], facts["reason"] = _ended(folder, mark)
        facts["completed"] = int(facts["outcome"] == "completed")
        facts["flights"] = int(facts["outcome"] != "under_way")
    return facts


def _of_mark(mark: FlightMark | None) -> dict[str, Any]:
    if mark is None:
        return {"kind": "flight", "planned": 1}
    return {
        "kind": _KINDS.get(mark.command, "flight"),
        "planned": 1,
        "time": utc(datetime.fromisoformat(mark.started)),
        "scenario": mark.scenario,
        "title": mark.title,
        "changes": tuple(mark.changes),
        "law": mark.law,
        "trigger": mark.trigger,
        "faults": tuple(mark.faults),
        "uavs": mark.uavs,
        "version": mark.version,
        "digest": mark.digest,
    }


def _of_summary(summary: FlightSummary) -> dict[str, Any]:
    outcome, reason = outcome_of(summary)
    return {
        "title": summary.scenario,
        "uavs": len(summary.uavs),
        "flights": 1,
        "completed": int(outcome == "completed"),
        "duration_s": summary.duration_s,
        "messages": sum(uav.actuator_messages for uav in summary.uavs),
        "events": sum(uav.events for uav in summary.uavs),
        "saving": summary.saving,
        "iae": {name: largest(uav.iae.get(name) for uav in summary.uavs) for name in QUANTITIES},
        "outcome": outcome,
        "reason": reason,
    }


def largest(values: Iterable[float | None]) -> float | None:
    """Return the largest value that is known; None if none is."""
    return max((value for value in values if value is not None), default=None)


def outcome_of(summary: FlightSummary) -> tuple[Outcome, str]:
    """Return how a flight ended, and why not better; the worst that applies."""
    if summary.control_failed:
        return "control_failed", summary.loss or ""
    if summary.hit_ground:
        return "ground", summary.loss or ""
    if summary.loss is not None:
        return "lost", summary.loss
    return summary.departure or ("completed", "")


def _ended(folder: Path, mark: FlightMark | None) -> tuple[Outcome, str]:
    """Return what is known of a flight without a summary."""
    if mark is None:
        return "interrupted", f"it has no {SUMMARY}"
    if is_under_way(folder):
        return "under_way", "figures so far"
    if mark.ended == DONE:
        return "completed", "" if mark.command == "up" else f"its {SUMMARY} is gone"
    if mark.ended == INTERRUPTED:
        return "interrupted", "by Ctrl-C or another signal"
    if not mark.ended:
        return "killed", "its process ended without a word"
    return "lost", mark.ended


def _has_frames(folder: Path) -> bool:
    """Return whether the summary of a folder is of a flight by ArduPilot."""
    with open_file(folder / SUMMARY) as file:
        return "ardupilot" in json.load(file)


def _baseline(folder: Path) -> dict[str, Any]:
    path = folder / "baseline.json"
    try:
        with open_file(path) as file:
            tree = json.load(file)
        saved = tree["saved"]["uniform"]
        text = "no equal periodic sender" if saved is None else f"saved {100.0 * saved:.2f} %"
        return {
            "kind": "baseline",
            "time": _time_of(path),
            "title": tree["scenario"],
            "scenario": tree["scenario"],
            "events": tree["transmissions"],
            "saving": tree["saved"]["every_period"],
            "outcome": "completed",
            "reason": f"against the slowest equal clock: {text}",
        }
    except (ValueError, KeyError, TypeError) as problem:
        raise BadInput(f"{path} is no baseline: {problem}") from None


def _reproduce(folder: Path) -> dict[str, Any]:
    done = (folder / "report.html").exists()
    return {
        "kind": "reproduce",
        "time": _time_of(folder / "data"),
        "scenario": "paper",
        "title": "the paper's tables and figures",
        "outcome": "completed" if done else "unfinished",
        "reason": "" if done else "it has no report.html",
    }


def _time_of(path: Path) -> str:
    """Return when a file was written last."""
    return utc(datetime.fromtimestamp(path.stat().st_mtime, UTC))
