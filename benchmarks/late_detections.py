"""Why some stuck surfaces are found late: what there was to be seen.

    gcs campaign campaigns/stuck_surface --out runs/stuck
    python -m benchmarks.late_detections runs/stuck --variant elevator_real --later-than 0.12

Flies the late flights of a campaign with one stuck surface again and prints, for each, how far the
surface stood from its command when it stopped, and when it was sent its next command: a surface
that stands where it is commanded to shows nothing before that.
"""

import argparse
from pathlib import Path

import numpy as np

from ftc_lab.campaigns.again import scenario_of_row
from ftc_lab.campaigns.store import read_results
from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACTUATORS


def what_there_was(scenario: Scenario) -> tuple[float, float | None]:
    """Return the distance of a stuck surface from its command at the fault, and its next command.

    Returns:
        The distance [deg], and the time from the fault to the next command [s], None if none came.
    """
    fault = scenario.actuator_faults[0]
    channel = ACTUATORS.index(fault.actuator)
    i = [uav.id for uav in scenario.uavs].index(fault.uav)
    flight = fly_in_process(scenario)
    begin = round(fault.start_s * 1e6 / scenario.step_us)
    held_deg = np.rad2deg(flight.signals["held"][begin - 1, i, channel])
    sent = np.flatnonzero(flight.signals["events"][begin:, i] >> channel & 1)
    next_s = float(sent[0]) * scenario.step_us / 1e6 if len(sent) else None
    return abs(held_deg - fault.command().value), next_s


def main(arguments: list[str] | None = None) -> None:
    """Print the late flights of a campaign's variant."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path, help="folder of the campaign")
    parser.add_argument("--variant", default="elevator_real", help="of the campaign")
    parser.add_argument("--uav", type=int, default=3, help="system id of the faulty UAV")
    parser.add_argument("--later-than", type=float, default=0.12, help="detections to show [s]")
    options = parser.parse_args(arguments)
    detection = f"uav{options.uav}.detection_s"
    rows = read_results(options.campaign, ["row", "draw", "variant", detection]).to_pylist()
    rows = [row for row in rows if row["variant"] == options.variant]
    late = [row for row in rows if row[detection] is None or row[detection] > options.later_than]
    print(f"{len(late)} of {len(rows)} flights found it later than {options.later_than * 1e3:g} ms")
    print("draw  found [ms]  off its command [deg]  next command [ms]")
    for row in sorted(late, key=lambda row: row[detection] or np.inf):
        off_deg, next_s = what_there_was(scenario_of_row(options.campaign, row["row"]))
        found, following = _in_ms(row[detection]), _in_ms(next_s)
        print(f"{row['draw']:4d}  {found:>10s}  {off_deg:21.2f}  {following:>17s}")


def _in_ms(time_s: float | None) -> str:
    return "never" if time_s is None else f"{time_s * 1e3:.0f}"


if __name__ == "__main__":
    main()
