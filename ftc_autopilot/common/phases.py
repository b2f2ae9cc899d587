"""Phases of an actuator, as the diagnosis decides them and FTC_PHASE numbers them."""

HEALTHY, SUSPECT, LOST = range(3)
