"""JSBSim's units in SI units: exact by definition, or by standard gravity."""

FT = 0.3048
LBF = 4.4482216152605
"""Pound-force [N]: 0.45359237 kg times 9.80665 m/s²."""
SLUG = LBF / FT
"""kg"""
