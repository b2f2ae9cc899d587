"""Time per UAV-step in process by what is recorded, and memory over a long flight.

``python -m benchmarks.recording [DURATION_S]``
"""

import resource
import sys
import tempfile
import time
from pathlib import Path

from gcs.fleet.in_process import fly_in_process, fly_in_steps
from gcs.results.choices import Record
from gcs.results.recorder import FlightRecorder
from gcs.results.recording import Steps
from gcs.scenario.model import Scenario, load_scenario

SCENARIO = Path(__file__).parent.parent / "scenarios" / "paper" / "scenario1.yaml"
ROUNDS = 5
UNRECORDED = ("no recording", "in memory")


def main() -> None:
    scenario = load_scenario(SCENARIO)
    duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else 1000.0
    best = dict.fromkeys((*UNRECORDED, *Record), 1000000000.0)
    for _ in range(ROUNDS):  # in turn, so that all see the same machine
        for name in best:
            best[name] = min(best[name], step_us(scenario, name))
    print("CPU time in process, 3 UAVs at 1 kHz, best of several   µs per UAV-step   × real time")
    for name, value in best.items():
        print(f"{name:55s} {value:15.2f} {1e3 / value / len(scenario.uavs):13.0f}")
    growth = memory_growth_mb(scenario.model_copy(update={"duration_s": duration_s}))
    print(f"memory growth after 10 % of {duration_s:g} s, --record light: {growth:.1f} MB")


def step_us(scenario: Scenario, name: str) -> float:
    """Fly once; return the CPU time of one step of one UAV [µs]."""
    with tempfile.TemporaryDirectory() as folder:
        recorder = (
            None if name in UNRECORDED else FlightRecorder(scenario, Path(folder), Record(name))
        )
        begin = time.thread_time()
        if recorder is not None:
            fly_in_steps(scenario, recorder.add)
            recorder.close()
        elif name == "in memory":
            fly_in_process(scenario)
        else:
            fly_in_steps(scenario, lambda _: None)
        return 1e6 * (time.thread_time() - begin) / scenario.steps / len(scenario.uavs)


def memory_growth_mb(scenario: Scenario) -> float:
    """Fly with a light recording; return the growth of peak memory in the last 90 % [MB]."""
    early_kb: list[int] = []
    with tempfile.TemporaryDirectory() as folder:
        recorder = FlightRecorder(scenario, Path(folder), Record.LIGHT)

        def follow(steps: Steps) -> None:
            recorder.add(steps)
            if steps.first < scenario.steps / 10:
                early_kb[:] = [resource.getrusage(resource.RUSAGE_SELF).ru_maxrss]

        recorder.finish(fly_in_steps(scenario, follow))
    return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - early_kb[0]) / 1e3


if __name__ == "__main__":
    main()
