"""What a process needs to run: compilation, system calls, shutdown."""
