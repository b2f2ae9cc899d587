"""Faults of actuators, and what lies between a command and them: servos, lags."""
