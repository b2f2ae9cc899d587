"""Guidance: from a path in space to the references of the control law."""
