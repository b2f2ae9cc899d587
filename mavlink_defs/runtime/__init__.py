"""Support for the processes: compilation, system calls, shutdown."""

import os

# numba colours the text of every failed attempt to find a type, thousands in a cold compile; where
# colorama is installed, that takes a fifth of the time
os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
