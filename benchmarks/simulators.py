"""Speed of flights that JSBSim flies, beside the same flights of the plant's own equations.

``python -m benchmarks.simulators`` flies three Cessnas of JSBSim at 1 kHz, in lockstep over UDP and
in process, in turn with the nominal model of the same aircraft, and prints real-time factors.
"""

import argparse
import json
import shutil
import statistics
import subprocess
import tempfile
from pathlib import Path

from benchmarks.fleet import gcs

SCENARIO = "airframes/c172p"
AIRCRAFT = "c172p"
ROUNDS = 3
TARGET = 8.0
"""Times real time that three aircraft in lockstep over UDP are to reach."""


def real_time_factor(scenario: str, plant: str, way: str, duration_s: float) -> float:
    """Fly once; return how many times faster than real time."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        command = ["fly", scenario, "--json", "--record", "none", "--out", str(out), way]
        command += ["--set", f"plant={plant}", "--set", f"duration_s={duration_s}"]
        output = subprocess.run(gcs(*command), check=True, stdout=subprocess.PIPE).stdout
        shutil.rmtree(out)
    return float(json.loads(output)["real_time_factor"])


def main() -> None:
    """Fly every way in turn, and print the medians."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simulators", description=__doc__)
    parser.add_argument("--scenario", default=SCENARIO, help="scenario of three aircraft")
    parser.add_argument("--aircraft", default=AIRCRAFT, help="what JSBSim flies")
    parser.add_argument("--duration", type=float, default=30.0, help="of a flight [s]")
    options = parser.parse_args()
    force = f"{{kind: jsbsim, aircraft: {options.aircraft}}}"
    engine = f"{{kind: jsbsim, aircraft: {options.aircraft}, thrust: engine}}"
    plants = {
        "own equations": "{kind: own}",
        "JSBSim, thrust as a force": force,
        "JSBSim, its engine": engine,
    }
    ways = {"lockstep over UDP": "--free-ports", "in process": "--in-process"}
    factors: dict[tuple[str, str], list[float]] = {}
    for _ in range(ROUNDS):
        for plant, section in plants.items():
            for way, option in ways.items():
                factor = real_time_factor(options.scenario, section, option, options.duration)
                factors.setdefault((plant, way), []).append(factor)
    print(f"{'plant':28}{'way':20}{'real time':>10}")
    for (plant, way), flown in factors.items():
        print(f"{plant:28}{way:20}{statistics.median(flown):9.1f}×")
    print(f"asked of JSBSim in lockstep over UDP: ≥ {TARGET:g}×")


if __name__ == "__main__":
    main()
