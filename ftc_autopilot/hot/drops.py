"""Counters of dropped datagrams: rows of `AUTOPILOT.drops`."""

GCS, FORMATION, SIMULATOR, PLANT = range(4)
"""The links of an autopilot; the last row has the plant's own counts, as it reports them."""
