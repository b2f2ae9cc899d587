"""The operator's dashboard: Textual widgets over one read-only view of the fleet."""
