"""Autopilots of other projects: a bridge process for each makes it one of ours to the plant."""
