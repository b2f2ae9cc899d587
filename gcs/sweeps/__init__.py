"""Grids of flights."""
