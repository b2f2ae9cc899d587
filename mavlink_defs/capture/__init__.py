"""Traffic recorded, counted, relayed and impaired."""
