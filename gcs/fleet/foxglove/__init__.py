"""What Foxglove shows of a fleet: channels, a scene and a layout."""
