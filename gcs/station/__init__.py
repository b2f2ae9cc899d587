"""The ground station's side of MAVLink: client, vehicles, their state."""
