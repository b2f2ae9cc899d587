"""Nominal aircraft from flights: trim, experiment, least squares with intervals, verdict."""
