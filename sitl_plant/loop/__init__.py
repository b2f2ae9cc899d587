"""The control period of the plant: what is received, advanced, sent and recorded."""
