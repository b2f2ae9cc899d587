"""Flights and fleets: prepared, with remarks, and flown, over UDP and in process."""
