"""Programs that tests want and a machine may lack: skipped at home, failures in CI."""

import os
import shutil
from collections.abc import Generator

import pytest


def needs(program: str) -> pytest.MarkDecorator:
    """Return a mark that skips a test on machines without a program."""
    return pytest.mark.skipif(
        shutil.which(program) is None,
        reason=f"{program} is missing: run scripts/install-test-tools",
    )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Turn every skipped test into a failure if FTC_SITL_CI=1, as .ci/run sets it."""
    report = yield
    if report.skipped and os.environ.get("FTC_SITL_CI") == "1" and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid} must not be skipped in CI: {report.longrepr}"
    return report
