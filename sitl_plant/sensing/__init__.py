"""The navigation sensors of an aircraft, and their faults."""
