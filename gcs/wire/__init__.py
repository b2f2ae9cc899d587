"""Captures and Wireshark."""
