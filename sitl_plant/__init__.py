"""Plant: aircraft, aerodynamics, rigid body, actuators with faults, and the plant process."""
