"""Default UDP ports; light, since the help of every command names some."""

GCS_PORT = 14550
"""Ground stations bind it."""
HUB_PORT = 14555
"""Of the hub of `gcs up`."""
PLANT_PORT = 14560
FORMATION_BASE_PORT = 14600
"""UAV i binds this port plus i."""
