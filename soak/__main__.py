"""Fly chapters one after the other and check the counters of each: ``python -m soak --help``.

Three counts of the same control messages must be equal: the autopilots' (FTC_EVENTS, as a
ground station received them last), the recordings', and the counts of a relay between plant and
autopilots that knows nothing of either. The plant must have applied what the autopilots held.
"""

import argparse
import hashlib
import json
import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from gcs.console.errors import GcsError
from gcs.fleet.flight import fly_and_record
from gcs.fleet.precompile import compile_parts
from gcs.results.figures import FlightSummary
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from mavlink_defs import dialect
from mavlink_defs.capture.tap_report import TapReport
from mavlink_defs.capture.tlog import read_tlog
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.runtime.heap import give_memory_back
from soak.chapters import Chapter, chapter


def main(arguments: list[str] | None = None) -> None:
    """Fly the chapters, print a line for each, and exit with 1 if any count differs."""
    parser = argparse.ArgumentParser(prog="python -m soak", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of everything that is random")
    parser.add_argument("--chapters", type=int, default=60, help="flights")
    parser.add_argument("--seconds", type=float, default=60.0, help="simulated time of each")
    parser.add_argument("--uavs", type=int, default=10, help="UAVs of each")
    options = parser.parse_args(arguments)
    story, failed, begin = hashlib.sha256(), 0, time.monotonic()
    for number in range(1, options.chapters + 1):
        drawn = chapter(options.seed, number, options.uavs, options.seconds)
        compile_parts()
        try:
            failures, digest = _fly(drawn)
        except GcsError as problem:
            failures, digest = [f"{type(problem).__name__}: {problem}"], b""
        story.update(digest)
        failed += bool(failures)
        print(_line(number, drawn, digest, failures), flush=True)
    simulated_s = options.chapters * options.seconds
    print(
        f"{simulated_s:g} s of {options.uavs} UAVs in {time.monotonic() - begin:.0f} s; "
        f"seed {options.seed}, story {story.hexdigest()[:16]}; "
        f"{failed} of {options.chapters} chapters failed"
    )
    sys.exit(1 if failed else 0)


def _line(number: int, drawn: Chapter, digest: bytes, failures: list[str]) -> str:
    """Return what is printed of a chapter, with the memory kept after it and the most so far."""
    columns = (
        f"{number:4d}",
        f"{drawn.scenario.controller.kind:12s}",
        f"{len(drawn.scenario.faults)} faults",
        f"{sum(map(len, drawn.crashes.values()))} restarts",
        "lossy" if drawn.lossy else "clean",
        f"story {digest.hex()[:12]}",
        f"memory {_kept_mb()} MB, at most {_most_mb()} MB",
        "; ".join(failures) or "counts agree",
    )
    return "  ".join(columns)


def _kept_mb() -> int:
    """Return the memory that this process keeps once what is free has been given back [MB].

    Without that the allocator keeps the gaps between what a flight leaves, and the next flight,
    of other sizes, does not fit into all of them.
    """
    give_memory_back()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 2**20


def _most_mb() -> int:
    """Return the most memory that this process has had so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def _fly(drawn: Chapter) -> tuple[list[str], bytes]:
    """Fly a chapter; return what is wrong with its counts, and a digest of the flight."""
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        folder = Path(name)
        flight = fly_and_record(drawn.scenario, folder, restart=True, crashes=drawn.crashes)
        summary = summarise(flight, drawn.scenario)
        wire = TapReport.from_json(json.loads((folder / "wire.json").read_text()))
        reported = reported_events(folder / "flight.tlog")
        failures = differences(drawn, flight, summary, wire, reported)
    digest = hashlib.sha256(flight.states.tobytes() + flight.signals["events"].tobytes())
    return failures, digest.digest()


def reported_events(log: Path) -> dict[int, dialect.MAVLink_ftc_events_message]:
    """Return the last FTC_EVENTS of each UAV in a telemetry log."""
    return {
        message.get_srcSystem(): message
        for _, message in read_tlog(log)
        if isinstance(message, dialect.MAVLink_ftc_events_message)
    }


def differences(
    drawn: Chapter,
    flight: Recording,
    summary: FlightSummary,
    wire: TapReport,
    reported: dict[int, dialect.MAVLink_ftc_events_message],
) -> list[str]:
    """Return each pair of counts that differs, as texts; none if all agree."""
    found = []

    def same(uav: int, what: str, *counts: object) -> None:
        if any(count != counts[0] for count in counts):
            found.append(f"UAV {uav}: {what} {' / '.join(map(str, counts))}")

    captured = {uav.system: uav for uav in wire.uavs if uav.link == "plant"}
    for uav in summary.uavs:
        counted, own = captured[uav.id], reported[uav.id]
        for c, name in enumerate(ACTUATORS):
            same(
                uav.id,
                f"events of the {name} (recorded / reported / captured)",
                uav.channels[name].events,
                own.events[c],
                counted.channels[name].events,
            )
            same(uav.id, f"repeats of the {name}", uav.channels[name].repeats, own.repeats[c])
        same(uav.id, "steps (recorded / reported)", uav.active_steps, own.steps)
        same(
            uav.id,
            "messages (recorded / reported / captured)",
            uav.actuator_messages,
            own.messages,
            counted.messages - counted.repeats,
        )
        same(uav.id, "restarts (done / planned)", uav.restarts, len(drawn.crashes.get(uav.id, ())))
    if not drawn.lossy:
        found += _not_applied(drawn, flight)
    return found


def _not_applied(drawn: Chapter, flight: Recording) -> list[str]:
    """Return the sound actuators that did something else than their autopilot held."""
    found = []
    faulty = {(fault.uav, fault.actuator) for fault in drawn.scenario.actuator_faults}
    for i, uav in enumerate(flight.uav_ids):
        flown = ~flight.missing[:, i]
        for c, name in enumerate(ACTUATORS):
            if (uav, name) in faulty:
                continue
            wrong = flown & (flight.applied[:, i, c] != flight.signals["held"][:, i, c])
            if wrong.any():
                at = int(np.flatnonzero(wrong)[0])
                found.append(f"UAV {uav}: the plant did not apply the {name} of step {at}")
    return found


if __name__ == "__main__":
    main()
