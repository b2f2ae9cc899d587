"""Protocol: dialect, hot-path codec, UDP endpoints and the MAVLink microservices."""
