"""The report's section on the theory: what was held against the flights, and how it came out."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gcs.document import bullets, table
from gcs.recording import Recording
from gcs.scenario import Scenario
from gcs.summary import CHANNELS
from gcs.theory import check_theory, theory_words
from mavlink_defs.files import write_text

__all__ = ["theory_section"]

_WATCHED = 3
_ERRORS = {
    "airspeed_m_s": "airspeed [m/s]",
    "roll_deg": "roll [deg]",
    "pitch_deg": "pitch [deg]",
    "yaw_deg": "yaw [deg]",
}


def theory_section(
    scenarios: Mapping[str, Scenario], recordings: Mapping[str, Recording], path: Path
) -> str:
    """Check every flight, keep all that was found, and put the main part into words.

    Args:
        scenarios: By file name.
        recordings: By file name.
        path: Gets everything, for all UAVs, as JSON.

    Returns:
        Markdown; tables show UAV 3, the one with the faults.
    """
    found = {file: check_theory(recordings[file], scenarios[file]) for file in recordings}
    write_text(path, json.dumps(found, indent=1) + "\n")
    watched = {
        file: next(uav for uav in result["uavs"] if uav["id"] == _WATCHED)
        for file, result in found.items()
    }
    same = [file for file in watched if watched[file] == watched["scenario1"]]
    for file in same[1:]:
        del watched[file]
    parts = [
        "UAV 3 of every flight; all UAVs stand in `data/theory.json`, the method in "
        f"`docs/theory.md`. {', '.join(same)} are one and the same flight.\n",
        "### Smallest interval between events, and the Zeno bound\n",
        _dwell(watched),
        "### Residual sets\n",
        _residual(watched),
        "### Lyapunov inequalities (53), (69)\n",
        _lyapunov(watched),
        "### What was checked in scenario 1, and what was not\n",
        bullets(theory_words(found["scenario1"])),
    ]
    return "\n".join(parts)


def _dwell(watched: Mapping[str, Any]) -> str:
    rows = []
    for file, uav in watched.items():
        cells = []
        for name in CHANNELS:
            channel = uav["dwell"][name]
            shortest, bound = channel["min_interval_s"], channel["bound_s"]
            shown = "-" if shortest is None else f"{1e3 * shortest:g} ms"
            below = channel["intervals_below_bound"]
            shown += "" if bound is None else f" ≥ {1e6 * bound:.3g} µs"
            cells.append(shown + (f" ({below} below!)" if below else ""))
        rows.append([file, *cells])
    return table(["smallest interval ≥ bound a2/µ or b2/µ", *CHANNELS], rows) + (
        "\nµ is the largest rate of change of the saturated command that was measured. Without a "
        "trigger there is no bound.\n"
    )


def _residual(watched: Mapping[str, Any]) -> str:
    rows = []
    for file, uav in watched.items():
        for part in uav["residual"]:
            window = f"({part['from_s']:g}, {part['end_s']:g}] s"
            cells = [
                " / ".join(_number(part[kind][name]) for kind in ("tracking", "synchronisation"))
                for name in _ERRORS
            ]
            rows.append([f"{file}, {window}", *cells])
    return table(["sup of tracking / synchronisation error", *_ERRORS.values()], rows)


def _lyapunov(watched: Mapping[str, Any]) -> str:
    rows = []
    for file, uav in watched.items():
        if uav["lyapunov"] is None:
            rows.append([file, "", "not checked: " + uav["lyapunov_absent"], *[""] * 4])
            continue
        for name in ("speed", "attitude"):
            part = uav["lyapunov"][name]
            if "absent" in part:
                rows.append([file, name, "not checked: " + part["absent"], *[""] * 4])
                continue
            held = part["finite_difference"]
            rows.append(
                [
                    file,
                    name,
                    "contradicted" if part["contradicted"] else "not contradicted",
                    f"{100 * held['satisfied']:.3g} % of {held['steps']}",
                    _number(held["largest_use"]),
                    _number(part["sup_last_3s"]),
                    _number(part["ultimate_bound"]),
                ]
            )
    header = ["V̇_L ≤ -κ V_L + χ", "subsystem", "verdict", "steps where it held",
              "largest (V̇_L + κ V_L)/χ", "sup V_L, last 3 s", "bound χ/κ"]  # fmt: skip
    return table(header, rows)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
