"""Programs catch the errors by the names that are documented for them."""

import gcs
from gcs import errors
from gcs.console.errors import GcsError


def test_errors_of_programs_are_those_that_are_raised() -> None:
    kinds = {getattr(errors, name) for name in errors.__all__}
    assert kinds == {GcsError, *GcsError.__subclasses__()}
    assert {name for name in gcs.__all__ if hasattr(errors, name)} < set(errors.__all__)
