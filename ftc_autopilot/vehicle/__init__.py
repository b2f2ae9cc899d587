"""The vehicle as MAVLink clients see it: modes, missions, parameters, telemetry."""
