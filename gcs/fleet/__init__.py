"""Fleets of processes and flights, over UDP and in process."""
