"""What failed in a recorded flight, and when: from how its answers relate to its commands."""
