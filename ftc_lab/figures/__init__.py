"""Figures of many flights, and of the paper."""
