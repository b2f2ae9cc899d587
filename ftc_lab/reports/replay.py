"""A fault flown again as a page: the three side by side, and how far the model is to be trusted."""

from collections.abc import Iterator

import numpy as np

from ftc_lab.fault_replay.replay import DIVERGED, HORIZONS_S, QUANTITIES, Replayed
from ftc_lab.fault_replay.replayed import ReplayedFault
from ftc_lab.identification.identified import FORCES
from ftc_lab.reports.markdown import bullets, plain, table

PICTURE = "flights.png"
_COLUMNS = ("", "largest roll [deg]", "lowest pitch [deg]", "height at the end [m]", "ended")


def replay_report(found: ReplayedFault) -> str:
    """Return the whole page as Markdown."""
    read, fault = found.read, found.read.fault
    low, high = fault.between_s
    begin, end = fault.at_s
    return (
        f"# {plain(read.title)} flown again\n\n"
        f"**What failed**: {plain(str(fault))}, at {fault.onset_s:.2f} s of the log ({low:.2f} to "
        f"{high:.2f} s), sure at {fault.alarm_s:.2f} s. Its value was measured from {begin:.1f} to "
        f"{end:.1f} s and leaves {100.0 * fault.unexplained:.0f} % of what the {fault.actuator} "
        "did otherwise than commanded.\n\n## Side by side\n\n"
        f"{table(_COLUMNS, side_by_side(found))}\n"
        '<img src="flights.png" alt="Roll, pitch, yaw, airspeed and height of each flight">\n\n'
        "## How far the model is to be trusted\n\n"
        f"{divergence(found)} {confirmation(found)}\n\n{table(*_errors(found))}\n"
        f"{_identified(found)}"
        f"{bullets(plain(one) for one in read.remarks)}\n## Fly it yourself\n\n"
        + bullets(f"`gcs fly {one.scenario.name}`, in this folder: {one.law}" for one in found.laws)
    )


def side_by_side(found: ReplayedFault) -> Iterator[tuple[str, ...]]:
    """Yield a line for the log, the model and each law, from the fault on, by `_COLUMNS`."""
    onset_s = found.read.fault.onset_s
    yield _line(
        "the log", found.recorded, onset_s, f"the log ends {_after(found.recorded, onset_s)}"
    )
    how = _after(found.model, onset_s)
    if found.errors.diverged_s is not None:
        how = f"flies otherwise from {found.errors.diverged_s:.1f} s after the fault"
    yield _line("the model under the recorded commands", found.model, onset_s, how)
    for one in found.laws:
        how = (
            f"LOST: {one.loss}"
            if one.loss is not None
            else f"flies on, {_after(one.flown, onset_s)}"
        )
        yield _line(one.law, one.flown, onset_s, plain(how))


def _after(flown: Replayed, onset_s: float) -> str:
    return f"{flown.time_s[-1] - onset_s:.1f} s after the fault"


def _line(name: str, flown: Replayed, onset_s: float, how: str) -> tuple[str, ...]:
    late = flown.time_s >= onset_s
    if not late.any():
        return name, "-", "-", "-", how
    roll, pitch, height = (flown.values[one][late] for one in ("roll", "pitch", "height"))
    rise = height[-1] - height[0]
    return name, f"{np.abs(roll).max():.1f}", f"{pitch.min():.1f}", f"{rise:+.1f}", how


def divergence(found: ReplayedFault) -> str:
    """Return whether the model does what the aircraft did, as a sentence."""
    errors = found.errors
    most = ", ".join(f"{name} {size:g} {QUANTITIES[name]}" for name, size in DIVERGED.items())
    if errors.diverged_s is None:
        return (
            f"Under the recorded commands the model does what the aircraft did for all "
            f"{errors.judged_s:.1f} s after the fault, within {most}."
        )
    return (
        f"Under the recorded commands the model does what the aircraft did for "
        f"{errors.diverged_s:.1f} s after the fault; then they are more than {most} apart, and "
        "what comes later says nothing of this aircraft."
    )


def confirmation(found: ReplayedFault) -> str:
    """Return whether the replay confirms the fault, as a sentence."""
    if found.errors.confirms:
        return "The replay confirms the fault: without it the model flies less like the aircraft."
    return (
        "The replay does NOT confirm the fault: without it the model flies as much, or more, like "
        "the aircraft. Either the model is too wrong to say, or nothing failed."
    )


def _errors(found: ReplayedFault) -> tuple[list[str], list[list[str]]]:
    errors = found.errors
    header = ["largest difference"]
    header += [f"{name} [{unit}]" for name, unit in QUANTITIES.items()]
    rows = []
    for k, span in enumerate(HORIZONS_S):
        if span > errors.judged_s:
            break
        named = [(f"in {span:g} s after the fault, with it", errors.faulty)]
        named += [(f"in {span:g} s after the fault, without it", errors.healed)]
        if errors.starts:
            title = f"in {span:g} s of healthy flight, 95 % of {errors.starts} starts"
            named.append((title, errors.healthy))
        rows += [[text, *(f"{sizes[one][k]:.2f}" for one in QUANTITIES)] for text, sizes in named]
    return header, rows


def _identified(found: ReplayedFault) -> str:
    identified = found.read.identified
    if identified is None or identified.evidence is None:
        return ""
    rows = [
        [FORCES[axis], f"{one.coefficient:.2f}", "" if one.rate is None else f"{one.rate:.2f}"]
        for axis, one in identified.evidence.predictions.items()
    ]
    header = ["one half predicts the other, R²", "of it", "of its rate"]
    said = bullets(plain(one) for one in identified.evidence.remarks)
    return f"{table(header, rows)}\n{said}\n"
