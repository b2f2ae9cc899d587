"""The state of vehicles as plain data and as a table."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from rich.table import Table

from gcs.station.vehicle_state import VehicleState
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.faults import Fault
from mavlink_defs.profile import Segment

__all__ = ["drop_lines", "fault_dict", "fleet_table", "segment_dict", "status_dict"]

_QUANTITIES = ("airspeed_m_s", "roll_deg", "pitch_deg", "yaw_deg")


def fault_dict(fault: Fault, time_s: float | None) -> dict[str, Any]:
    """Return a fault as plain data; `end_s` is None for one that lasts until cleared."""
    unit = "n" if ACTUATORS[fault.actuator] == "throttle" else "deg"
    return {
        "actuator": ACTUATORS[fault.actuator],
        "effectiveness": fault.effectiveness,
        f"{'stuck' if fault.effectiveness == 0.0 else 'bias'}_{unit}": fault.value,
        "frequency_hz": fault.frequency_hz,
        "start_s": fault.start_s,
        "end_s": fault.end_s if math.isfinite(fault.end_s) else None,
        "active": time_s is not None and fault.start_s < time_s <= fault.end_s,
    }


def segment_dict(segment: Segment) -> dict[str, Any]:
    """Return a segment with the keys of a scenario file."""
    return {
        "start_s": segment.start_s,
        "airspeed_m_s": segment.airspeed_m_s,
        "roll_deg": segment.roll_deg,
        "pitch_deg": segment.pitch_deg,
        "yaw_deg": segment.yaw_deg,
        "shape": "ramp" if segment.ramp else "step",
    }


def status_dict(state: VehicleState, now: float) -> dict[str, Any]:
    """All that is known of a vehicle; None for what is not."""
    attitude = state.attitude_deg
    return {
        "uav": state.system,
        "link": {
            "lost": state.lost,
            "age_s": state.age_s(now),
            "rate_hz": state.rate_hz(now),
            "restarts": state.restarts,
            "drops": state.drops,
        },
        "armed": state.armed,
        "ready": state.is_ready,
        "mode": state.mode,
        "time_s": state.time_s,
        "actual": _quantities(attitude and (state.airspeed_m_s, *attitude)),
        "reference": _quantities(state.reference),
        "error": _quantities(state.error),
        "sync_error": _quantities(state.sync_error),
        "held": state.held and dict(zip(ACTUATORS, state.held, strict=True)),
        **_event_dict(state),
        "faults": state.faults and [fault_dict(f, state.time_s) for f in state.faults],
        "profile": state.profile and [segment_dict(s) for s in state.profile],
    }


def _quantities(values: Iterable[float | None] | None) -> dict[str, Any] | None:
    """Return values by name; NaN, as of a reference while disarmed, becomes None."""
    if values is None:
        return None
    known = (None if value is None or math.isnan(value) else value for value in values)
    return dict(zip(_QUANTITIES, known, strict=True))


def _event_dict(state: VehicleState) -> dict[str, Any]:
    counts = state.counts
    recent = counts.recent()
    channels = {
        name: {
            "events": counts.events[i],
            "events_10_s": recent[i],
            "saving": counts.savings[i],
            "min_interval_s": counts.min_interval_s[i],
            "repeats": counts.repeats[i],
        }
        for i, name in enumerate(ACTUATORS)
    }
    return {"steps": counts.steps, "saving": counts.saving, "channels": channels}


def drop_lines(here: Mapping[str, int], states: Iterable[VehicleState]) -> list[str]:
    """Return counts of dropped datagrams by reason, one line for each process that dropped any.

    Args:
        here: Datagrams that this ground station dropped, by reason.
        states: The vehicles.
    """
    dropped: dict[str, Mapping[str, Mapping[str, int]]] = {"here": {"": here}}
    for state in states:
        drops = dict(state.drops or {})
        dropped["by the plant"] = {
            "": drops.pop("plant", dropped.get("by the plant", {}).get("", {}))
        }
        dropped[f"by UAV {state.system}"] = {f"{link} link ": n for link, n in drops.items()}
    lines = []
    for who, links in dropped.items():
        counts = [
            f"{link}{', '.join(f'{n} {reason}' for reason, n in reasons.items())}"
            for link, reasons in links.items()
            if reasons
        ]
        if counts:
            lines.append(f"dropped {who}: {'; '.join(counts)}")
    return lines


def fleet_table(states: Iterable[VehicleState], now: float) -> Table:
    """Return a table with one row per vehicle, for a terminal of 80 columns."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("UAV", justify="right", no_wrap=True)
    for heading in ("link", "armed", "mode"):
        table.add_column(heading, no_wrap=True)
    for heading in ("time s", "V m/s", "roll °", "pitch °", "yaw °", "events", "saved", "faults"):
        table.add_column(heading, justify="right", no_wrap=True)
    for state in states:
        table.add_row(*_row(state, now), style="red" if state.lost else None)
    return table


def _row(state: VehicleState, now: float) -> list[str]:
    roll, pitch, yaw = state.attitude_deg or (None, None, None)
    saving = state.counts.saving
    faults = "?" if state.faults is None else f"{len(state.active_faults)}/{len(state.faults)}"
    return [
        str(state.system),
        f"LOST {state.age_s(now):.0f} s" if state.lost else "up",
        "armed" if state.armed else "no",
        state.mode,
        _shown(state.time_s),
        *map(_shown, (state.airspeed_m_s, roll, pitch, yaw)),
        str(state.counts.total),
        "-" if saving is None else f"{100.0 * saving:.1f}%",
        faults,
    ]


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
