"""Support for the processes: compilation, system calls, shutdown."""
