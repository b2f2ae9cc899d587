"""Campaigns: many flights of one scenario with drawn values, on all cores or on a cluster."""
