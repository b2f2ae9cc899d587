"""``make fuzz``: many frames through every parser and handler, with a watch on memory.

Each frame is one of four: noise, a damaged frame, twice a good frame with extreme values. Any
exception ends the run; the seed on the command line makes it happen again. With ``--atheris``
(package of that name, dependency group `fuzz`) coverage guides the bytes of the parsers.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from random import Random

from fuzzing.frames import MESSAGES, damaged, message_frame, noise
from fuzzing.targets import AutopilotTarget, PlantTarget, StationTarget, Target, parse_all_ways
from gcs.scenario.model import Scenario, load_scenario

SCENARIO = Path(__file__).parent.parent / "scenarios" / "paper" / "scenario1.yaml"
_BATCH = 1000  # frames between two ticks
_WARM_UP = 20_000  # frames until caches and bounded logs are full
_IDS = sorted(MESSAGES)


def targets(scenario: Scenario) -> dict[str, Target]:
    """Return everything that takes datagrams, by name."""
    ports = ("gcs", "simulator", "formation")
    return {
        **{f"autopilot, {port} link": AutopilotTarget(scenario, port) for port in ports},
        "plant, autopilot": PlantTarget(scenario, stranger=False),
        "plant, stranger": PlantTarget(scenario, stranger=True),
        "ground station": StationTarget(),
    }


def batch(random: Random, target: Target) -> list[bytes]:
    """Return datagrams for one target."""
    datagrams = []
    for _ in range(_BATCH // 4):
        good = [
            message_frame(random, random.choice(_IDS), target.sender, target.target)
            for _ in range(2)
        ]
        datagrams += [noise(random), damaged(random, good[0]), *good]
    return datagrams


def fuzz(name: str, target: Target, frames: int, random: Random) -> None:
    """Feed a target, and print its speed and how memory grew since it had warmed up."""
    busy_s, begin_mib = 0.0, 0.0
    for k in range(0, frames, _BATCH):
        if k <= _WARM_UP:
            begin_mib = rss_mib()
        datagrams = batch(random, target)
        start = time.perf_counter()
        for datagram in datagrams:
            target.feed(datagram)
            parse_all_ways(datagram)
        if isinstance(target, AutopilotTarget | StationTarget):
            target.handle_timer(k * 1e-3)
        busy_s += time.perf_counter() - start
    memory = f"RSS {begin_mib:7.1f} → {rss_mib():7.1f} MiB"
    print(f"{name:<28} {frames:>9} frames {frames / busy_s:>8.0f} frames/s   {memory}", flush=True)


def rss_mib() -> float:
    """Return the resident memory of this process [MiB] (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def main() -> None:
    """Run until all frames are through; exit status 1 if something raised."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing", description=__doc__)
    parser.add_argument("--frames", type=int, default=1_200_000, help="in all (%(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--atheris", type=int, metavar="RUNS", help="also with coverage")
    options = parser.parse_args()
    random = Random(options.seed)
    chosen = targets(load_scenario(SCENARIO))
    each = max(options.frames // len(chosen) // _BATCH, 1) * _BATCH
    for target in chosen.values():  # compile, and fill what is bounded
        for datagram in batch(random, target):
            target.feed(datagram)
    begin_mib, start = rss_mib(), time.monotonic()
    for name, target in chosen.items():
        fuzz(name, target, each, random)
        target.close()
    total = each * len(chosen)
    print(
        f"{total} frames in {time.monotonic() - start:.0f} s, generation included; RSS "
        f"{begin_mib:.1f} MiB before, {rss_mib():.1f} MiB after"
    )
    if options.atheris:
        with_coverage(options.atheris, parse_all_ways)


def with_coverage(runs: int, function: Callable[[bytes], object]) -> None:
    """Let atheris choose the bytes for the parsers; it ends the process."""
    try:
        import atheris
    except ImportError:
        print("atheris is not installed: pip install atheris (dependency group `fuzz`)")
        return
    atheris.Setup([sys.argv[0], f"-runs={runs}", "-max_len=300"], atheris.instrument_func(function))
    atheris.Fuzz()


if __name__ == "__main__":
    main()
