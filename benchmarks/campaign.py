"""Campaigns: 1000 flights of scenario 1, the gain of a second worker, memory over 20 000 flights.

Method: campaigns of scenario 1 with a drawn mass fly in this process with workers of their own,
the compile cache warm. The time of 1000 flights runs from the start of the workers to their end;
the pace of one and of two workers, and the share of the time that they do not fly, from the
first batch to the last. On a machine that does other work, too, the pace says little. What a second
worker costs then shows in the processor time of a flight, in the share of the time that workers
fly, and in the product of the ratios of both, the efficiency that an idle machine would have.
Memory is the resident set of this process after a tenth and after all of
20 000 flights of 10 ms.
"""

import os
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.plan import plan
from ftc_lab.campaigns.workers import Flown
from ftc_lab.run import run_campaign

FLIGHTS, FEWER, SHORT = 1000, 200, 20_000


@dataclass
class Watch:
    """The course of a campaign.

    Attributes:
        workers: How many.
        flown_s: Time that workers flew.
        cpu_s: Processor time that they flew.
        ends: When each batch ended, and how many flights it had.
        memory: Resident set after each batch [MB].
    """

    workers: int
    flown_s: float = 0.0
    cpu_s: float = 0.0
    ends: list[tuple[float, int, float]] = field(default_factory=list)
    memory: list[float] = field(default_factory=list)

    def __call__(self, batch: Flown) -> None:
        """Count a batch of flights."""
        self.flown_s += batch.wall_s
        self.cpu_s += batch.cpu_s
        self.ends.append((time.perf_counter(), batch.rows.num_rows, batch.wall_s))
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        self.memory.append(pages * os.sysconf("SC_PAGE_SIZE") / 1e6)

    @property
    def span_s(self) -> float:
        """From the start of the first batch to the end of the last."""
        first, _, wall_s = self.ends[0]
        return self.ends[-1][0] - first + wall_s

    @property
    def flights(self) -> int:
        """Flights that were flown."""
        return sum(n for _, n, _ in self.ends)

    @property
    def pace(self) -> float:
        """Flights per second."""
        return self.flights / self.span_s

    @property
    def busy(self) -> float:
        """Share of the time that workers fly."""
        return self.flown_s / self.workers / self.span_s

    @property
    def flight_cpu_s(self) -> float:
        """Processor time of a flight."""
        return self.cpu_s / self.flights


def main() -> None:
    begin = time.perf_counter()
    both = flown(FLIGHTS, workers=2)
    total_s = time.perf_counter() - begin
    one = flown(FEWER, workers=1)
    two = flown(FEWER, workers=2)
    print(f"{FLIGHTS} flights of scenario 1, two workers: {total_s:.1f} s (target <= 150)")
    print(f"  of which the workers do not fly: {100 * (1 - both.busy):.1f} % (target < 5)")
    print(f"pace of one worker {one.pace:.2f}, of two {two.pace:.2f} flights/s")
    print(f"  efficiency: {100 * two.pace / 2 / one.pace:.0f} % (target >= 90)")
    for watch in (one, two):
        print(
            f"  {watch.workers} of them: {1e3 * watch.flight_cpu_s:.0f} ms of processor time per "
            f"flight, flying {100 * watch.busy:.1f} % of the time"
        )
    idle = one.flight_cpu_s / two.flight_cpu_s * two.busy / one.busy
    print(f"  efficiency by these on an idle machine: {100 * idle:.0f} %")
    short = flown(SHORT, workers=2, duration_s=0.01).memory
    early = short[len(short) // 10]
    print(f"memory, {SHORT} flights of 10 ms:")
    print(f"  {early:.0f} MB after a tenth, {short[-1]:.0f} MB at the end")


def flown(draws: int, workers: int, **changes: Any) -> Watch:
    """Fly a campaign in a folder that is then removed."""
    watch = Watch(workers)
    tree = {
        "name": "benchmark",
        "scenario": "paper/scenario1",
        "draws": draws,
        "factors": {"uncertainty.mass": {"draw": {"kind": "uniform", "low": 0.8, "high": 1.2}}},
        "variants": {"base": changes},
    }
    planned = plan(Campaign.model_validate(tree), Path("benchmark.yaml"))
    with tempfile.TemporaryDirectory() as folder:
        run_campaign(planned, Path(folder) / "out", jobs=workers, on_flown=watch)
    return watch


if __name__ == "__main__":
    main()
