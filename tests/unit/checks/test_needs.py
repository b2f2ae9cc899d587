"""A test that is skipped proves nothing: in CI it fails."""

import pytest

TESTS = """
import pytest
from needs import needs

@needs("no-such-program")
def test_with_a_program(): ...

def test_with_a_right():
    pytest.skip("may not capture here")

@pytest.mark.xfail(strict=False)
def test_that_may_fail():
    raise AssertionError
"""


@pytest.mark.parametrize(
    ("ci", "outcomes"),
    [("", {"skipped": 2, "xfailed": 1}), ("1", {"failed": 1, "errors": 1, "xfailed": 1})],
)
def test_skips_are_failures_in_ci(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, ci: str, outcomes: dict[str, int]
) -> None:
    monkeypatch.setenv("FTC_SITL_CI", ci)
    pytester.makeconftest('pytest_plugins = ["needs"]')
    pytester.makepyfile(TESTS)
    result = pytester.runpytest("-p", "no:cacheprovider")
    assert result.parseoutcomes() == outcomes
    if ci:
        result.stdout.fnmatch_lines(
            ["*test_with_a_program must not be skipped in CI*no-such-program is missing*"]
        )
