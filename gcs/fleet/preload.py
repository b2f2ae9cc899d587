"""What the fork server of local workers imports once, so that each worker flies at once.

Imports and machine code take a second and a half of a processor, a flight of 24 s a tenth.
"""

import contextlib
import signal

from gcs.console.errors import GcsError
from gcs.fleet.in_process import fly_and_summarise
from gcs.fleet.local_workers import STOPPING
from gcs.scenario.model import load_scenario
from mavlink_defs.config.models import ConfigError

with contextlib.suppress(ConfigError, GcsError, OSError):  # a worker meets it, too, and reports it
    fly_and_summarise(load_scenario("paper/scenario1").model_copy(update={"duration_s": 0.002}))

# a program has one fork server, which forks its own processes, too
on_ctrl_c = signal.signal(signal.SIGINT, signal.SIG_IGN)  # one that waits is of that program
signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPPING)
signal.signal(signal.SIGINT, on_ctrl_c)
