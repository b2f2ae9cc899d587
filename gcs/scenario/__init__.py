"""Scenario files: models, checks, profiles."""
