"""Flights by sensors beside the same flights by the true state, and faults of sensors.

    python -m benchmarks.by_sensors
    python -m benchmarks.by_sensors --seeds 10 --laws tube

The first table flies scenario 1 without faults, the second the bundled `sensor_faults`. Errors are
against the truth, of the worst UAV; estimation and attitude errors after 10 s.
"""

import argparse
import statistics
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ftc_autopilot.estimation.state import TESTED
from gcs.fleet.in_process import InProcessFlight, begin, fly_in_process, fly_on
from gcs.results.figures import FlightSummary
from gcs.results.recording import Steps
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from sitl_plant.sensing.units import FAULT_NAMES

LAWS = ("surviving", "tube")
QUANTITIES = ("airspeed", "roll", "pitch", "yaw")
FAULTS = Path(__file__).parent.parent / "scenarios" / "sensor_faults"
_LOOK_S = 0.02
_SETTLED_S = 10.0


class Exclusion(NamedTuple):
    """A sensor excluded, or taken back."""

    time_s: float
    uav: int
    sensor: str
    excluded: bool


def scenario_with(name: str, law: str, seed: int, navigation: str) -> Scenario:
    """Return a scenario flown by a law, and by sensors or by the true state."""
    own = {"controller": {"kind": law}, "seed": seed, "navigation": navigation}
    if law == "tube":
        own["trigger"] = {"mode": "consequence"}
    return scenario_of(name, merged(scenario_tree(name), own))


def without_faults(law: str, seeds: int) -> str:
    """Return the row of a law: what it costs to fly by sensors."""
    ratios, events = [], []
    for seed in range(1, seeds + 1):
        true, by_sensors = (_flown(law, seed, how) for how in ("true_state", "estimated"))
        ratios.append([_worst(by_sensors, key) / _worst(true, key) for key in QUANTITIES])
        counts = [sum(uav.events for uav in one.uavs) for one in (true, by_sensors)]
        events.append((counts[0], counts[1], counts[1] / counts[0]))
    cells = [f"{statistics.median(column):.2f}" for column in zip(*ratios, strict=True)]
    before, after, times = (statistics.median(column) for column in zip(*events, strict=True))
    return f"| {law} | {before:.0f} | {after:.0f} | {times:.2f} | {' | '.join(cells)} |"


def _flown(law: str, seed: int, navigation: str) -> FlightSummary:
    tree = scenario_with("paper/scenario1", law, seed, navigation)
    scenario = tree.model_copy(update={"faults": ()})
    return summarise(fly_in_process(scenario), scenario)


def _worst(summary: FlightSummary, key: str) -> float:
    return max(uav.iae[key] or 0.0 for uav in summary.uavs)


def with_fault(name: str, law: str, seeds: int) -> str:
    """Return the row of a fault: when it was noticed, and the largest errors."""
    noticed, errors, blamed, others = [], [], 0, 0
    for seed in range(1, seeds + 1):
        scenario = scenario_with(f"sensor_faults/{name}", law, seed, "estimated")
        flown, exclusions = watched(scenario)
        fault = scenario.faults[0]
        after = [e for e in exclusions if e.time_s >= fault.start_s and e.excluded]
        if after:
            noticed.append(after[0].time_s - fault.start_s)
        others += sum(e.excluded and e.time_s < fault.start_s for e in exclusions)
        errors.append(errors_of(flown, scenario.step_us))
        blamed += int((flown.signals["phase"].max(axis=(0, 1)) > 1).sum())
    worst = np.max(errors, axis=0)
    share = f"{len(noticed)}/{seeds}"
    when = "" if not noticed else f"{statistics.median(noticed):.2f}, {max(noticed):.2f}"
    numbers = " | ".join(f"{value:.2f}" for value in worst)
    return f"| {name} | {law} | {share} | {when} | {numbers} | {others} | {blamed} |"


def watched(scenario: Scenario) -> tuple[Steps, list[Exclusion]]:
    """Fly a scenario by sensors, and look every 20 ms at what the estimators exclude."""
    flight, n = begin(scenario), len(scenario.uavs)
    steps = Steps.room(scenario.steps, n, estimated=True)
    stride = round(_LOOK_S * 1e6 / scenario.step_us)
    exclusions: list[Exclusion] = []
    bad: set[tuple[int, str]] = set()
    for first in range(0, scenario.steps, stride):
        end_s = min(first + stride, scenario.steps) * scenario.step_us / 1e6
        part = scenario.model_copy(update={"duration_s": end_s})
        ending = fly_on(part, flight, steps.part, first=first)
        now = set(_excluded(flight))
        exclusions += [Exclusion(end_s, *one, excluded=one in now) for one in sorted(bad ^ now)]
        bad = now
        if ending.loss is not None:
            return steps.part(0, ending.steps), exclusions
    return steps, exclusions


def _excluded(flight: InProcessFlight) -> Iterator[tuple[int, str]]:
    for uav, estimator in zip(flight.ids, flight.estimates.estimators, strict=True):
        report = estimator["report"]
        for k in range(3):
            if int(report["bad_imus"]) >> k & 1:
                yield uav, f"imu {k + 1}"
        for k in TESTED:
            if int(report["bad_sensors"]) >> k & 1:
                yield uav, (*FAULT_NAMES, "gps velocity", "gps height")[k]


def errors_of(steps: Steps, step_us: int, settled_s: float = _SETTLED_S) -> list[float]:
    """Return the largest errors after a time: roll or pitch, yaw [deg], airspeed [m/s], place [m].

    Args:
        steps: A flight by sensors.
        step_us: Its control period.
        settled_s: The time.
    """
    first = round(settled_s * 1e6 / step_us)
    true, estimated = steps.states[first:], steps.estimates[first:]
    turned = (estimated[..., 6:9] - true[..., 6:9] + np.pi) % (2.0 * np.pi) - np.pi
    through = np.linalg.norm(true[..., 3:6] - steps.wind[first:], axis=-1)
    shown = np.linalg.norm(estimated[..., 3:6] - estimated[..., 12:15], axis=-1)
    place = np.linalg.norm(estimated[..., :3] - true[..., :3], axis=-1)
    angles = np.degrees(np.abs(turned))
    airspeed = np.abs(shown - through)
    return [float(a.max()) for a in (angles[..., :2], angles[..., 2], airspeed, place)]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.by_sensors", description=__doc__)
    parser.add_argument("--laws", nargs="+", default=LAWS, choices=LAWS)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    heads = " | ".join(f"IAE of {key}" for key in QUANTITIES)
    print(f"| law | events by the true state | by sensors | times | {heads} |")
    print("| --- |" + " ---: |" * 7)
    for law in options.laws:
        print(without_faults(law, options.seeds), flush=True)
    print(
        "\n| fault | law | excluded | after: median, longest [s] | roll, pitch [deg] | yaw [deg] |"
        " airspeed [m/s] | place [m] | excluded before | actuators blamed |"
    )
    print("| --- | --- |" + " ---: |" * 8)
    for path in sorted(FAULTS.glob("*.yaml")):
        for law in options.laws:
            print(with_fault(path.stem, law, options.seeds), flush=True)


if __name__ == "__main__":
    main()
