"""Figures for people. matplotlib is imported as the first one is drawn: it takes a second."""
