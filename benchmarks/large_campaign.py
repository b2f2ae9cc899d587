"""A campaign of a million rows: how long its table and its report take, and their memory.

Method: a few flights of 10 ms of `campaigns/uncertainty` are flown; their figures are repeated
beside the draws of a million flights, in files of 10 000 rows. Each reader runs in a process of
its own, whose processor time and largest resident set are printed. The number of rows may be given
as an argument.
"""

import multiprocessing
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ftc_lab.campaigns.draws import draw_table
from ftc_lab.campaigns.findings import findings_of
from ftc_lab.campaigns.flights import fly_rows
from ftc_lab.campaigns.mark import write_mark
from ftc_lab.campaigns.model import load_campaign
from ftc_lab.campaigns.plan import plan, rows_of
from ftc_lab.campaigns.store import append_results, read_results, write_draws
from ftc_lab.reports.campaign import write_report
from gcs.scenario.bundled import SCENARIOS

_ROWS, _FILE_ROWS, _FLOWN = 1_000_000, 10_000, 16


def main() -> None:
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else _ROWS
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = store(folder, rows)
        size = sum(path.stat().st_size for path in folder.rglob("*.parquet")) / 1e6
        print(f"{rows} rows, {size:.0f} MB of Parquet")
        for what, read in (("two columns", _two_columns), ("report", _report)):
            wall_s, cpu_s, megabytes = measured(read, folder)
            print(f"{what}: {wall_s:.1f} s ({cpu_s:.1f} s of processor time), ", end="")
            print(f"at most {megabytes:.0f} MB")


def store(folder: Path, rows: int) -> int:
    """Write a campaign's folder; returns the number of its rows, a multiple of the variants."""
    path = SCENARIOS / "campaigns" / "uncertainty.yaml"
    short = load_campaign(path, _FLOWN)
    variants = {name: {**v, "duration_s": 0.01} for name, v in short.variants.items()}
    few = plan(short.model_copy(update={"variants": variants}), path)
    flown = fly_rows(few.flights, list(rows_of(few.draws)))
    draws = rows // len(variants)
    large = few.mark.campaign.model_copy(update={"draws": draws})
    planned = draw_table(large, [1, 2, 3])
    write_mark(folder, replace(few.mark, campaign=large))
    write_draws(folder, planned)
    for begin in range(0, planned.num_rows, _FILE_ROWS):
        part = planned.slice(begin, _FILE_ROWS)
        repeated = flown.take(np.arange(begin, begin + part.num_rows) % flown.num_rows)
        for k, name in enumerate(flown.column_names):
            if name in part.column_names:
                repeated = repeated.set_column(k, name, part[name])
        append_results(folder, repeated)
    return int(planned.num_rows)


def measured(read: Callable[[Path], object], folder: Path) -> tuple[float, float, float]:
    """Run a function in a process of its own.

    Returns:
        Duration [s], processor time [s] and largest resident set [MB].
    """
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_measured, (read, folder))


def _measured(read: Callable[[Path], object], folder: Path) -> tuple[float, float, float]:
    begin, cpu_begin = time.perf_counter(), time.process_time()
    read(folder)
    wall_s, cpu_s = time.perf_counter() - begin, time.process_time() - cpu_begin
    return wall_s, cpu_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def _report(folder: Path) -> None:
    write_report(findings_of(folder))


def _two_columns(folder: Path) -> object:
    return read_results(folder, ["variant", "outcome"])


if __name__ == "__main__":
    main()
