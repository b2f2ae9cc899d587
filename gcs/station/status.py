"""The state of vehicles as data, as a table and as text."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from rich.table import Table

from gcs.console.terminal import numbers, table_of, texts
from gcs.station.event_counts import EventCounts
from gcs.station.vehicle_state import VehicleState
from mavlink_defs.constants import ACTUATORS, OLD_STATE_S

_QUANTITIES = ("airspeed_m_s", "roll_deg", "pitch_deg", "yaw_deg")


def vehicle_status(state: VehicleState, now: float) -> dict[str, Any]:
    """Return the state of a vehicle as plain data; None stands for what is unknown.

    Args:
        state: The vehicle.
        now: Time of the client's clock [s].

    Returns:
        `link` (`oldest_state_s`: longest simulated time for which its autopilot acted on one state
        in the last second or two [s], 0 in lockstep; `drops`: datagrams dropped by vehicle and
        plant, by link and reason); `not_heard`; `actual`, `reference`, `error` and `sync_error`
        (31), (32) by quantity [m/s, deg]; `held` commands as shares of their limits; `channels`
        with their events; `faults` as of `Fault.as_dict`, `profile` as of `Segment.as_dict`.
    """
    attitude, held, faults, profile = state.attitude_deg, state.held, state.faults, state.profile
    return {
        "uav": state.system,
        "link": {
            "lost": state.lost,
            "age_s": state.age_s(now),
            "rate_hz": state.rate_hz(now),
            "restarts": state.restarts,
            "oldest_state_s": state.counts.oldest_state_s if state.tells_private else None,
            "drops": state.drops,
        },
        "not_heard": not_heard(state),
        "armed": state.armed,
        "ready": state.is_ready,
        "mode": state.mode,
        "time_s": state.time_s,
        "actual": _quantities(attitude and (state.airspeed_m_s, *attitude)),
        "reference": _quantities(state.reference),
        "error": _quantities(state.error),
        "sync_error": _quantities(state.sync_error),
        "held": None if held is None else dict(zip(ACTUATORS, held, strict=True)),
        "steps": state.counts.steps,
        "saving": state.counts.saving,
        "actuator_messages": state.counts.messages,
        "neighbour_messages": state.counts.neighbour_messages,
        "channels": _channels(state.counts),
        "faults": None if faults is None else [f.as_dict(state.time_s) for f in faults],
        "profile": None if profile is None else [s.as_dict() for s in profile],
    }


def _quantities(values: Iterable[float | None] | None) -> dict[str, float | None] | None:
    """Return values by name; NaN, as of a reference while disarmed, becomes None."""
    if values is None:
        return None
    known = (None if value is None or math.isnan(value) else value for value in values)
    return dict(zip(_QUANTITIES, known, strict=True))


def _channels(counts: EventCounts) -> dict[str, dict[str, Any]]:
    """Return by channel its events, events of the last 10 s, the saving, and repeats."""
    recent = counts.recent()
    return {
        name: {
            "events": counts.events[i],
            "events_10_s": recent[i],
            "saving": counts.savings[i],
            "min_interval_s": counts.min_interval_s[i],
            "repeats": counts.repeats[i],
        }
        for i, name in enumerate(ACTUATORS)
    }


def not_heard(state: VehicleState) -> list[str]:
    """Return what a vehicle has not reported, though it has not refused to."""
    private = state.offers_private
    unknown = {
        "attitude": state.attitude_deg is None,
        "airspeed": state.airspeed_m_s is None,
        "references": private and state.reference is None,
        "events": private and not state.tells_private,
        "drops": private and state.drops is None,
        "faults": state.offers_faults and state.faults is None,
        "profile": state.offers_profile and state.profile is None,
    }
    return [word for word, is_unknown in unknown.items() if is_unknown]


def silence_lines(missing: Iterable[int], states: Iterable[VehicleState]) -> list[str]:
    """Return which UAVs were not heard, and what was not heard of others; no line if all is known.

    Args:
        missing: System ids of the members of the fleet that were not heard.
        states: The vehicles.
    """
    lines = [f"UAV {system} of the fleet not heard" for system in missing]
    for state in states:
        missing_of, heard = not_heard(state), len(state.latest) > 1
        if missing_of and not heard:
            lines.append(f"UAV {state.system} sends HEARTBEATs, and answered nothing")
        elif missing_of:
            lines.append(f"not heard from UAV {state.system}: {', '.join(missing_of)}")
    return lines


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
    values = ("time s", "V m/s", "roll °", "pitch °", "yaw °", "events", "saved", "faults")
    columns = (numbers("UAV"), *map(texts, ("link", "armed", "mode")), *map(numbers, values))
    table = table_of(*columns, box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for state in states:
        table.add_row(*_row(state, now), style="red" if state.lost else None)
    return table


def _row(state: VehicleState, now: float) -> list[str]:
    roll, pitch, yaw = state.attitude_deg or (None, None, None)
    saving = state.counts.saving
    faults = "?" if state.faults is None else f"{len(state.active_faults)}/{len(state.faults)}"
    return [
        str(state.system),
        _link(state, now),
        "armed" if state.armed else "no",
        state.mode,
        _shown(state.time_s),
        *map(_shown, (state.airspeed_m_s, roll, pitch, yaw)),
        str(state.counts.total) if state.tells_private else "-",
        "-" if saving is None else f"{100.0 * saving:.1f}%",
        faults,
    ]


def _link(state: VehicleState, now: float) -> str:
    if state.lost:
        return f"LOST {state.age_s(now):.0f} s"
    old_s = state.counts.oldest_state_s
    return f"old {old_s:.1f} s" if old_s > OLD_STATE_S else "up"


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
