"""Logs of flights, of any autopilot and our own, read into one table of a flight."""
