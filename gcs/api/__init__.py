"""Flights, campaigns and ground stations from Python; the package `gcs` has their names."""
