"""Flights for the command line, for Python and for tests: prepared, with remarks, and flown."""
