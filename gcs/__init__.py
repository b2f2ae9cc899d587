"""Ground station: scenarios, fleets, MAVLink client, command line, dashboard, reports."""
