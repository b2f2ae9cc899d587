"""Flights by ArduPilot SITLs in place of our autopilots."""
