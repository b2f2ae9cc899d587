"""What the pytest plugin `gcs.pytest_plugin` gives to tests; see docs/reference/pytest.md."""
