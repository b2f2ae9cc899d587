"""``make bench``: the speed figures of docs/explanation/performance.md, measured in one run.

Timing is noisy on shared machines: what counts are the medians and, for the codec, the ratio
to pymavlink, measured in alternating rounds.
"""

import argparse
import json
import os
import platform
import resource
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

from benchmarks import codec, dashboard, figures, fleet, ground_station, recording
from benchmarks.fleet import gcs

SCENARIO = Path(__file__).parent.parent / "scenarios" / "paper" / "scenario1.yaml"
ROUNDS = 5
NOWHERE = ("--connect", "udpout:127.0.0.1:9", "--timeout", "0.1")
TALKING = (
    ("--version",),
    ("arm", *NOWHERE),
    ("status", *NOWHERE),
    ("fault", "set", "rudder", "--effectiveness", "0.5", *NOWHERE),
    ("param", "list", *NOWHERE),
)
TRIGGERED = "links.formation.trigger={}"


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    argparse.ArgumentParser(
        "python -m benchmarks", description=__doc__, formatter_class=form
    ).parse_args()
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    with tempfile.TemporaryDirectory() as folder:
        cold_s = [first_step_s(Path(folder) / "cold", new_cache=True)]
        warm_s = [first_step_s(Path(folder) / "warm") for _ in range(ROUNDS)]
        reproduced_s = [reproduction_s(Path(folder) / "paper")]
        lockstep, triggered, in_process = [], [], []
        for _ in range(ROUNDS):  # in turn, so that both see the same machine
            lockstep.append(real_time_factor(Path(folder) / "run"))
            triggered.append(real_time_factor(Path(folder) / "run", "--set", TRIGGERED))
            in_process.append(real_time_factor(Path(folder) / "run", "--in-process"))
    row("real-time factor, lockstep over UDP, 3 UAVs at 1 kHz", lockstep, "×", target="≥ 10")
    row("the same with triggered neighbour messages", triggered, "×")
    row("real-time factor, in process, 3 UAVs at 1 kHz", in_process, "×", target="≥ 200")
    row("gcs reproduce: all flights, figures and the report", reproduced_s, "s", target="< 60")
    row("gcs fly to first simulated step, compile cache cold", cold_s, "s", target="< 40")
    row("gcs fly to first simulated step, compile cache warm", warm_s, "s", target="< 1.5")
    for command in TALKING:
        talking_s = [processor_time_s(command) for _ in range(ROUNDS)]
        name = f"gcs {command[0]} until it listens, processor time"
        row(name, talking_s, "s", target="≤ 0.3", digits=2)
    shares = [100.0 * ground_station.share_of_a_core() for _ in range(3)]
    row("gcs fly with 30 UAVs in flight, share of one core", shares, "%", target="< 15")
    load = dashboard.measure()
    row("dashboard with 30 UAVs, from key to screen", load.key_ms, "ms", target="< 100")
    row("the same, share of one core", [load.cpu_percent], "%", target="< 100")
    print()
    fleet.print_table([one for uavs in (3, 30, 100) for one in fleet.measure(uavs)])
    print()
    recording.main()
    print()
    figures.main()
    print()
    codec.main()


def real_time_factor(folder: Path, *options: str) -> float:
    """Fly scenario 1 once; return the ratio of simulated to wall-clock time that it reports."""
    command = ["fly", str(SCENARIO), "--json", "--free-ports", "--out", str(folder), *options]
    output = subprocess.run(gcs(*command), check=True, stdout=subprocess.PIPE).stdout
    shutil.rmtree(folder)
    return float(json.loads(output)["real_time_factor"])


def first_step_s(folder: Path, new_cache: bool = False) -> float:
    """Return the time from starting `gcs fly` to the first step, as dated in the plant's log."""
    environment = dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # or every process compiles all sources
    if new_cache:
        environment["NUMBA_CACHE_DIR"] = str(folder.with_name("numba"))
    options = ["--quiet", "--free-ports", "--out", str(folder)]
    begin = time.time()
    subprocess.run(gcs("fly", str(SCENARIO), *options), check=True, env=environment)
    with (folder / "processes" / "plant.log").open() as log:
        started = next(line for line in log if "simulated time starts" in line)
    shutil.rmtree(folder)
    return float(started.rsplit(maxsplit=1)[1]) - begin


def processor_time_s(command: tuple[str, ...]) -> float:
    """Return the processor time of a command that finds nobody to talk to."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    subprocess.run(gcs(*command), check=False, env=environment, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def reproduction_s(folder: Path) -> float:
    """Return the time that `gcs reproduce` takes in process, from start to end."""
    begin = time.time()
    subprocess.run(gcs("reproduce", "--quiet", "--out", str(folder)), check=True)
    shutil.rmtree(folder)
    return time.time() - begin


def row(name: str, values: list[float], unit: str, target: str = "", digits: int = 1) -> None:
    spread = f"{min(values):.{digits}f} to {max(values):.{digits}f}"
    aim = f"  (target {target})" if target else ""
    print(f"{name:55s} {statistics.median(values):7.{digits}f} {unit}  {spread:>14s}{aim}")


if __name__ == "__main__":
    main()
