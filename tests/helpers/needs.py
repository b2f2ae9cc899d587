"""Programs that tests want and a machine may lack: skipped at home, failures in CI.

Only a real autopilot, whose peer CI flies, may be skipped there, too.
"""

import os
import shutil
from collections.abc import Generator

import pytest

ARDUPLANE = os.environ.get("FTC_ARDUPLANE", "")


def needs(program: str) -> pytest.MarkDecorator:
    """Return a mark that skips a test on machines without a program."""
    return pytest.mark.skipif(
        shutil.which(program) is None,
        reason=f"{program} is missing: run scripts/install-test-tools",
    )


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a test of a real ArduPlane where the environment names none."""
    if item.get_closest_marker("real_arduplane") and not ARDUPLANE:
        pytest.skip("FTC_ARDUPLANE names no ArduPlane")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Turn every skipped test into a failure if FTC_SITL_CI=1, as .ci/run sets it."""
    report = yield
    wanted = not (hasattr(report, "wasxfail") or item.get_closest_marker("real_arduplane"))
    if report.skipped and os.environ.get("FTC_SITL_CI") == "1" and wanted:
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid} must not be skipped in CI: {report.longrepr}"
    return report
