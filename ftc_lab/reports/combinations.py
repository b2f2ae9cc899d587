"""Laws and triggers in one table: what is sent, how it tracks, what it survives."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence

from ftc_lab.baselines.combinations import (
    AIRCRAFT,
    Combination,
    fault_files,
    message_bytes,
    on_the_front,
)
from ftc_lab.baselines.senders import SenderVerdict
from ftc_lab.reports.markdown import render
from gcs.results.figures import UAV_FIGURES
from gcs.results.quantities import IAE_UNITS, QUANTITIES, milliseconds, percent


def mean_iae(one: Combination, uav_id: int, of: dict[str, float]) -> float | None:
    """Return the mean of the four IAEs of a UAV, each by a given one; None without a flight."""
    if (uav := one.uav(uav_id)) is None:
        return None
    ratios = [(uav.iae[quantity] or 0.0) / of[quantity] for quantity in QUANTITIES]
    return sum(ratios) / len(ratios)


def front_of(listed: Iterable[Combination], uav_id: int, of: dict[str, float]) -> list[Combination]:
    """Return the combinations that no other beats in both transmissions and mean IAE."""
    by_name, points = {}, {}
    for one in listed:
        mean, uav = mean_iae(one, uav_id, of), one.uav(uav_id)
        if mean is not None and uav is not None:
            name = f"{one.law} {one.trigger}"
            by_name[name], points[name] = one, (float(uav.events), mean)
    return [by_name[name] for name in on_the_front(points)]


def combinations_section(
    listed: Sequence[Combination], uav_id: int, of: dict[str, float], caption: str
) -> str:
    """Return the section of the report, Markdown.

    Args:
        listed: The flown combinations.
        uav_id: UAV whose numbers are shown.
        of: IAEs that the last column is relative to, by quantity.
        caption: Of the figure `figures/combinations.png`.
    """
    tables = {}
    for aircraft in AIRCRAFT:
        own = [one for one in listed if one.aircraft == aircraft]
        front = front_of(own, uav_id, of)
        head = ["law, trigger", "transmissions", "saved", "slowest equal sender"]
        head += ["saved against it", "messages", "bytes"]
        head += [*(f"IAE {q} [{IAE_UNITS[q]}]" for q in QUANTITIES), "mean"]
        head += ["fault files lost"] * any(one.faults_lost is not None for one in own)
        rows = [list(_row(one, uav_id, of, bold=one in front)) for one in own]
        tables[aircraft] = {"head": head, "rows": rows}
    return render(
        "combinations.md",
        uav_id=uav_id,
        message_bytes=message_bytes(),
        tables=tables,
        caption=caption,
    )


def _row(one: Combination, uav_id: int, of: dict[str, float], *, bold: bool) -> Iterator[str]:
    name = f"{one.law}, {one.trigger}"
    yield f"**{name}**" if bold else name
    uav, mean = one.uav(uav_id), mean_iae(one, uav_id, of)
    if uav is None or mean is None:
        yield from ("lost", *["-"] * (6 + len(QUANTITIES)))
    else:
        yield from (str(uav.events), percent(uav.saving))
        if (equal := one.slowest_equal) is None:
            yield from ("none", "-")
        else:
            period = milliseconds(equal.sender.period_s)
            yield f"{equal.sender.law}, every {period}: {equal.transmissions}"
            yield percent(1.0 - uav.events / equal.transmissions)
        yield from (str(uav.actuator_messages), str(uav.actuator_messages * message_bytes()))
        yield from (f"{uav.iae[quantity]:.2f}" for quantity in QUANTITIES)
        yield f"{mean:.3f}"
    if one.faults_lost is not None:
        yield f"{len(one.faults_lost)} of {len(fault_files())}"


def combinations_csv(listed: Iterable[Combination]) -> str:
    """Return one line per combination and UAV, every figure that the section has."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    head = ["aircraft", "law", "trigger", "uav", "completed", "attitude_lost", "heading_lost"]
    head += ["transmissions", "bytes", *(figure.heading for figure in UAV_FIGURES)]
    head += ["faults_flown", "faults_lost"]
    head += ["slowest_equal_law", "slowest_equal_period_s", "slowest_equal_transmissions"]
    writer.writerow(head)
    for one in listed:
        if one.summary is None:
            continue
        lost, equal = one.faults_lost, one.slowest_equal
        for uav in one.summary.uavs:
            writer.writerow(
                [
                    *(one.aircraft, one.law, one.trigger, uav.id, one.summary.completed),
                    *(uav.attitude_lost_at_s is not None, uav.heading_lost_at_s is not None),
                    *(uav.events, uav.actuator_messages * message_bytes()),
                    *(figure.of(uav) for figure in UAV_FIGURES),
                    None if lost is None else len(fault_files()),
                    None if lost is None else " ".join(lost),
                    *(_cells(equal) if equal else [None] * 3),
                ]
            )
    return text.getvalue()


def _cells(equal: SenderVerdict) -> tuple[str, float, int]:
    return equal.sender.law, equal.sender.period_s, equal.transmissions
