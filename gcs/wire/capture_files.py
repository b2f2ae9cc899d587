"""Counts of recorded traffic: captures, telemetry logs, reports of a relay."""

import json
from pathlib import Path

from gcs.errors import BadInput
from mavlink_defs import dialect
from mavlink_defs.capture.pcap import PcapCutOff, PcapError, is_pcap, read_pcap
from mavlink_defs.capture.tap import LinkNames, Tap
from mavlink_defs.capture.tap_report import TapReport
from mavlink_defs.capture.tlog import TlogCutOff, TlogError, read_frames
from mavlink_defs.config.user_files import open_file
from mavlink_defs.constants import LAST_SYSTEM


def count_file(path: Path, tap: Tap, names: LinkNames) -> tuple[TapReport, str]:
    """Count the traffic in a file; its first bytes tell its format.

    Args:
        path: A pcap, pcapng or tlog file, or the wire.json of a flight.
        tap: Tap that counts, with no counts yet.
        names: How to name the links of a capture. Those of a telemetry log are "gcs".

    Returns:
        The report, and a remark for the user or "".

    Raises:
        BadInput: The file cannot be read, or is something else.
    """
    try:
        if report := _report(path):
            return report, ""
        if is_pcap(path):
            for packet in read_pcap(path):
                link, direction = names.of(packet.source, packet.destination)
                tap.count(packet.time_s, link, direction, packet.payload)
        else:
            for time_us, frame in read_frames(path, complain=True):
                tap.count(time_us / 1e6, "gcs", _direction(frame), frame)
    except (PcapCutOff, TlogCutOff) as problem:
        return tap.report(), f"{problem}; what comes before is counted"
    except OSError as problem:
        raise BadInput(f"{path} cannot be read: {problem.strerror}") from problem
    except PcapError as problem:
        raise BadInput(str(problem)) from problem
    except TlogError as problem:
        text = f"{path} is no capture (pcap, pcapng), telemetry log (tlog) or wire.json"
        raise BadInput(text, str(problem)) from problem
    return tap.report(), ""


def _report(path: Path) -> TapReport | None:
    """Return the report in a wire.json; None if the file is something else."""
    with open_file(path) as file:
        if file.read(1) != b"{":
            return None
    try:
        return TapReport.from_json(json.loads(path.read_bytes()))
    except ValueError:
        return None


def _direction(frame: bytes) -> str:
    """Return the direction of a logged frame, seen from the ground station."""
    version_2 = frame[0] == dialect.PROTOCOL_MARKER_V2
    system, component = frame[5:7] if version_2 else frame[3:5]
    ground = system > LAST_SYSTEM or component == dialect.MAV_COMP_ID_MISSIONPLANNER
    return "from" if ground else "to"
