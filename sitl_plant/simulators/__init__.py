"""Simulators that fly an aircraft in place of the plant's own equations."""
