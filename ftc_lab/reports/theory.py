"""The report's section on the theory: the checks of the flights and their results."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

from ftc_lab.reports.markdown import bullets, table
from ftc_lab.theory import UavTheory, check_theory, theory_sentences
from ftc_lab.theory.judgement import Judgement
from gcs.results.quantities import PAPER_ORDER
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.config.output_files import write_text

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
    """Check every flight, write all findings as JSON, and return the main ones as text.

    Args:
        scenarios: By file name.
        recordings: By file name.
        path: File for all findings on all UAVs, as JSON.

    Returns:
        Markdown; tables show UAV 3, the one with the faults.
    """
    found = {file: check_theory(recordings[file], scenarios[file]) for file in recordings}
    everything = {file: asdict(theory) for file, theory in found.items()}
    write_text(path, json.dumps(everything, indent=1) + "\n")
    watched = {
        file: next(uav for uav in theory.uavs if uav.id == _WATCHED)
        for file, theory in found.items()
    }
    same = [file for file in watched if watched[file] == watched["scenario1"]]
    for file in same[1:]:
        del watched[file]
    absent = {
        file: found[file].proofs_absent for file in watched if found[file].proofs_absent is not None
    }
    parts = [
        "UAV 3 of every flight; all UAVs are in `data/theory.json`, the method in "
        f"`docs/explanation/theory.md`. {', '.join(same)} are one and the same flight.\n",
        "### Smallest interval between events, and the Zeno bound\n",
        _dwell(watched),
        "### Residual sets\n",
        _residual(watched),
        "### Proofs of (53), (69)\n",
        _lyapunov(watched),
        bullets(f"{file} was not checked: {reason}." for file, reason in absent.items()),
        "### What each inequality gives away\n",
        _slack(watched),
        "### Equalities of the laws and of the proofs, scenario 1\n",
        _equalities(watched["scenario1"]),
        "### What was checked in scenario 1, and what was not\n",
        bullets(theory_sentences(found["scenario1"])),
    ]
    return "\n".join(parts)


def _dwell(watched: Mapping[str, UavTheory]) -> str:
    rows = []
    for file, uav in watched.items():
        cells = []
        for name in PAPER_ORDER:
            channel = uav.dwell[name]
            shortest, bound = channel["min_interval_s"], channel["bound_s"]
            shown = "-" if shortest is None else f"{1e3 * shortest:g} ms"
            below = channel["intervals_below_bound"]
            shown += "" if bound is None else f" ≥ {1e6 * bound:.3g} µs"
            cells.append(shown + (f" ({below} below!)" if below else ""))
        rows.append([file, *cells])
    return table(["smallest interval ≥ bound a2/µ or b2/µ", *PAPER_ORDER], rows) + (
        "\nµ is the largest rate of change of the saturated command that was measured. Without a "
        "trigger there is no bound.\n"
    )


def _residual(watched: Mapping[str, UavTheory]) -> str:
    rows = []
    for file, uav in watched.items():
        for part in uav.residual:
            window = f"({part['from_s']:g}, {part['end_s']:g}] s"
            cells = [
                " / ".join(_number(part[kind][name]) for kind in ("tracking", "synchronisation"))
                for name in _ERRORS
            ]
            rows.append([f"{file}, {window}", *cells])
    return table(["sup of tracking / synchronisation error", *_ERRORS.values()], rows)


def _proofs(watched: Mapping[str, UavTheory]) -> Iterator[tuple[str, str, Judgement]]:
    for file, uav in watched.items():
        for name, part in uav.proofs.items():
            yield file, name, part


def _lyapunov(watched: Mapping[str, UavTheory]) -> str:
    rows = []
    for file, name, part in _proofs(watched):
        compared = [equality for equality in part.equalities if equality.steps]
        held = sum(equality.violated == 0 for equality in compared)
        row = [file, name, part.verdict, f"{held} of {len(compared)}"]
        hypotheses, found = part.hypotheses, part.certificate
        row.append(f"{hypotheses.at_stop}, {sum(hypotheses.no_effectiveness.values())}")
        if found is None:
            rows.append([*row, *["-"] * 4])
            continue
        rate = found.finite_difference
        shown = "-" if rate.satisfied is None else f"{100 * rate.satisfied:.3g} % of {rate.steps}"
        use, sup, bound = rate.largest_use, found.sup_last_3s, found.ultimate_bound
        rows.append([*row, shown, _number(use), _number(sup), _number(bound)])
    header = [
        "V̇_L ≤ -κ V_L + χ",
        "subsystem",
        "verdict",
        "equalities to rounding",
        "steps at a stop, at ρ = 0",
        "steps where it held",
        "largest (V̇_L + κ V_L)/χ",
        "sup V_L, last 3 s",
        "bound χ/κ",
    ]
    return table(header, rows)


def _slack(watched: Mapping[str, UavTheory]) -> str:
    tables = []
    for subsystem in ("speed", "attitude"):
        found = {
            file: part.certificate
            for file, name, part in _proofs(watched)
            if name == subsystem and part.certificate is not None
        }
        if not found:
            continue
        names = list(next(iter(found.values())).slack)
        rows = [
            [file, *(_share(part.slack[name].mean) for name in names), _share(part.used)]
            for file, part in found.items()
        ]
        header = [f"share of χ, {subsystem}", *names, "left: (V̇_L + κ V_L)/χ"]
        tables.append(table(header, rows))
    return "\n".join(tables) + (
        "\nMeans over the steps within the hypotheses; a row makes 100 %. The proofs' inequalities "
        "are named by their equations; with W* = 0 the network's part of (43), (61) is given away "
        "whole.\n"
    )


def _equalities(uav: UavTheory) -> str:
    rows = [
        [
            f"{equality.equation} {equality.quantity}",
            name,
            str(equality.steps),
            str(equality.violated),
            _number(equality.largest),
        ]
        for name, part in uav.proofs.items()
        for equality in part.equalities
    ]
    header = ["equality", "subsystem", "steps", "violated", "largest deviation, share of summands"]
    return table(header, rows)


def _share(share: float) -> str:
    return f"{share:.2%}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
