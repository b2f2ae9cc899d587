"""Checked, frozen models read from YAML, with units and ranges."""
