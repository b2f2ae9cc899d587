"""Lockstep flights over UDP from one UAV to a hundred, beside the bare loop of the same size.

Each is flown with an autopilot process per UAV and with as few as there are cores, where that
differs. ``python -m benchmarks.fleet`` prints the table; ``--figure FILE`` draws the time per UAV
and step, too. All that is compared is measured in turn, so that it sees the same machine.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.bare_loop import bare_us_per_step
from gcs.scenario.model import scenario_tree
from mavlink_defs.config.yaml_text import yaml_of

STEPS = {1: 24_000, 3: 24_000, 10: 6_000, 30: 2_000, 100: 500}
"""Steps of a flight, by the number of UAVs; a step is 1 ms."""
ROUNDS = 3


@dataclass(frozen=True)
class Fleet:
    """Times of a step [µs], one for each round."""

    uavs: int
    processes: int
    flights_us: list[float]
    bare_us: list[float]

    @property
    def flight_us(self) -> float:
        """Median of the flights [µs]."""
        return statistics.median(self.flights_us)

    @property
    def ratio(self) -> float:
        """Speed of the flights as a share of the bare loop's."""
        return statistics.median(self.bare_us) / self.flight_us


def measure(uavs: int, rounds: int = ROUNDS) -> list[Fleet]:
    """Measure a fleet of some size, with a process for each autopilot and with fewer."""
    numbers = sorted({uavs, min(uavs, os.cpu_count() or 1)}, reverse=True)
    fleets = [Fleet(uavs, processes, [], []) for processes in numbers]
    with tempfile.TemporaryDirectory() as folder:
        scenario = Path(folder) / "star.yaml"
        scenario.write_text(yaml_of(star(uavs, STEPS[uavs] / 1000)))
        for _ in range(rounds):
            for fleet in fleets:
                flight_us, events = fly(scenario, fleet.processes)
                bare_us = bare_us_per_step(uavs, STEPS[uavs], events, processes=fleet.processes)
                fleet.flights_us.append(flight_us)
                fleet.bare_us.append(bare_us)
    return fleets


def star(uavs: int, duration_s: float) -> dict[str, Any]:
    """Return scenario 1 of the paper, without its fault, with more followers or fewer."""
    tree = scenario_tree("paper/scenario1")
    originals = tree["uavs"]
    tree["uavs"] = [
        {
            **originals[min(i, len(originals) - 1)],
            "id": 1 + i,
            "name": f"UAV {1 + i}",
        }
        for i in range(uavs)
    ]
    tree["network"]["edges"] = [{"between": [1, 1 + i], "weight": 1.0} for i in range(1, uavs)]
    tree["faults"], tree["duration_s"] = [], duration_s
    return tree


def fly(scenario: Path, processes: int) -> tuple[float, float]:
    """Fly once; return the wall time of a step [µs] and a UAV's actuator messages in one."""
    folder = scenario.with_name("run")
    command = ["fly", str(scenario), "--json", "--free-ports", "--out", str(folder)]
    command += ["--autopilot-processes", str(processes)]
    output = subprocess.run(gcs(*command), check=True, stdout=subprocess.PIPE).stdout
    shutil.rmtree(folder)
    summary = json.loads(output)
    steps, uavs = int(summary["steps"]), summary["uavs"]
    events = sum(uav["actuator_messages"] for uav in uavs) / len(uavs) / steps
    return float(summary["wall_s"]) / steps * 1e6, events


def gcs(*arguments: str) -> list[str]:
    """Return the command line of `gcs` in this environment."""
    return [sys.executable, "-c", "from gcs.__main__ import main; main()", *arguments]


def print_table(fleets: list[Fleet]) -> None:
    """Print a row for each fleet."""
    head = ("UAVs", "processes", "µs/step", "real time", "bare loop", "share", "µs/UAV-step")
    print("".join(f"{title:>15}" for title in head))
    for fleet in fleets:
        row = (
            f"{fleet.uavs}",
            f"{fleet.processes}",
            f"{fleet.flight_us:.1f}",
            f"{1000 / fleet.flight_us:.2f}×",
            f"{1000 / statistics.median(fleet.bare_us):.2f}×",
            f"{fleet.ratio:.2f}",
            f"{fleet.flight_us / fleet.uavs:.1f}",
        )
        print("".join(f"{cell:>15}" for cell in row))


def draw(fleets: list[Fleet], file: Path) -> None:
    """Draw the time per UAV and step."""
    from gcs.reports.figures.style import new_figure, style, tidy

    figure = new_figure(3.0)
    axes = figure.add_subplot()
    sizes = sorted({fleet.uavs for fleet in fleets})
    fewest = {fleet.uavs: fleet for fleet in fleets}  # processes: these come last
    ways = {
        "a process each": [fleet for fleet in fleets if fleet.processes == fleet.uavs],
        "as few processes as cores": [fewest[size] for size in sizes],
    }
    for i, (how, flown) in enumerate(ways.items()):
        bare = [statistics.median(fleet.bare_us) / fleet.uavs for fleet in flown]
        flight = [fleet.flight_us / fleet.uavs for fleet in flown]
        colour = style(i).colour
        axes.plot(sizes, flight, marker="o", label=f"flight, {how}", color=colour)
        axes.plot(sizes, bare, marker="o", ls="--", label=f"bare loop, {how}", color=colour)
    axes.set(xscale="log", ylim=(0.0, None), xlabel="UAVs", ylabel="time per UAV and step [µs]")
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()
    tidy(axes)
    axes.legend()
    figure.savefig(file)


def main() -> None:
    """Measure every size and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fleet", description=__doc__)
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw the times, too")
    parser.add_argument(
        "--uavs", type=int, nargs="+", choices=STEPS, default=list(STEPS), help="sizes of fleets"
    )
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="flights of each")
    options = parser.parse_args()
    fleets = [fleet for uavs in options.uavs for fleet in measure(uavs, options.rounds)]
    print_table(fleets)
    if options.figure is not None:
        draw(fleets, options.figure)


if __name__ == "__main__":
    main()
