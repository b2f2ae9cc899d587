"""The estimator of the autopilot over what the sensors of a recorded flight reported."""
