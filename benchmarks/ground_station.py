"""Share of one core that the ground station takes while it flies and records a fleet.

``python -m benchmarks.ground_station`` prints it for 30 UAVs in lockstep. Linux only: the times of
the process are read from /proc.
"""

import os
import subprocess
import tempfile
import time
from pathlib import Path

from benchmarks.fleet import gcs, star
from mavlink_defs.config.yaml_text import yaml_of

_SETTLING_S, _MEASURED_S = 1.5, 8.0
_LONG_S = 600.0  # simulated; what is measured must be in flight, which is ended then


def share_of_a_core(uavs: int = 30) -> float:
    """Fly a fleet once; return the processor time of `gcs fly` per wall-clock time in flight."""
    with tempfile.TemporaryDirectory() as folder:
        scenario, run = Path(folder) / "star.yaml", Path(folder) / "run"
        scenario.write_text(yaml_of(star(uavs, _LONG_S)))
        command = ["fly", str(scenario), "--quiet", "--free-ports", "--out", str(run)]
        with subprocess.Popen(gcs(*command), stderr=subprocess.DEVNULL) as process:
            log = run / "processes" / "plant.log"
            while not (log.exists() and "simulated time starts" in log.read_text()):
                if process.poll() is not None:
                    raise RuntimeError("the flight did not start")
                time.sleep(0.05)
            time.sleep(_SETTLING_S)
            begin_s, before_s = time.monotonic(), _processor_s(process.pid)
            time.sleep(_MEASURED_S)
            used_s, passed_s = _processor_s(process.pid) - before_s, time.monotonic() - begin_s
            if (run / "summary.json").exists():
                raise RuntimeError("the flight was over before it was measured")
            process.terminate()
        return used_s / passed_s


def _processor_s(pid: int) -> float:
    """Return the processor time of a process, without its children's [s]; see proc(5)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    print(f"{100.0 * share_of_a_core():.1f} % of one core")
