"""How near each UAV of a formation kept its slot, from the run folder of a recorded flight.

    python -m benchmarks.slots runs/formation --from 20

Distances in space from the slot, whose place on the path is the leader's own one there: median and
largest of the whole flight, and from `--from` on.
"""

import argparse
from pathlib import Path

import numpy as np

from ftc_lab.reports.markdown import table
from gcs.results.mission_paths import leaders_of, paths_of, silent_in
from gcs.results.path_following import PathErrors
from gcs.results.store import read_recording
from gcs.scenario.model import load_scenario


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.slots",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("run", type=Path, help="recorded with `gcs fly --record full`")
    parser.add_argument("--from", type=float, default=20.0, dest="settled_s", metavar="SECONDS")
    args = parser.parse_args()
    scenario = load_scenario(args.run / "scenario.yaml")
    recording, paths = read_recording(args.run), paths_of(scenario)
    if paths is None or scenario.formation is None:
        parser.error(f"{args.run}: no mission in formation was flown")
    following = PathErrors(paths, leaders_of(scenario), recording.step_us, silent_in(scenario))
    errors = following.of(recording.steps)
    off = np.hypot(errors["slot"], errors["height"])
    settled = round(args.settled_s * 1e6 / recording.step_us)
    rows = []
    for i, uav in enumerate(scenario.uavs):
        parts = (off[:, i], off[settled:, i])
        figures = [f(part) for part in parts for f in (np.nanmedian, np.nanmax)]
        rows.append([f"{uav.id} {uav.name}", *(f"{one:.1f}" for one in figures)])
    titles = ["median [m]", "largest [m]"]
    print(table(["UAV", *titles, *(f"{t} from {args.settled_s:g} s" for t in titles)], rows))


if __name__ == "__main__":
    main()
