"""Types behind the fixtures of `gcs.pytest_plugin`; see docs/reference/pytest.md."""
