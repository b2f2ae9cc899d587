"""Hours of simulated flight with random faults, restarts and bad links: ``python -m soak``."""
