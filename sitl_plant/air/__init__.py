"""The air around the aircraft: wind, turbulence, disturbances."""
