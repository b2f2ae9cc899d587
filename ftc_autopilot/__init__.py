"""Autopilot: reference, formation, controllers, triggers, and the autopilot process."""
