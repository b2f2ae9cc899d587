"""Measurements that the documentation quotes; run ``python -m benchmarks``."""
