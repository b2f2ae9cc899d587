"""The simulator's side of PX4's lockstep: a PX4 SITL flies the plant's aircraft."""
