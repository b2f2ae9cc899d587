"""The pytest plugin `ftc_sitl`: fixtures for fleets and flights; see docs/reference/pytest.md.

pytest imports this in every run of every project that has ftc-sitl installed. So it imports
nothing of the project until a fixture is used.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pytest

if TYPE_CHECKING:
    from gcs.testing.fixtures import FlightMode
    from gcs.testing.flying import TestFleet
    from gcs.testing.results import FlightResult

__all__: list[str] = []

_MARK = "ftc_scenario"
_FLIGHTS: pytest.StashKey[dict[str, FlightResult]] = pytest.StashKey()
_FLEETS: pytest.StashKey[list[TestFleet]] = pytest.StashKey()


class Launch(Protocol):
    """The type of the fixture `ftc_launch`."""

    def __call__(
        self, path: str | Path, *, speed: float | None = None, **changes: Any
    ) -> TestFleet:
        """Start a fleet; see `ftc_launch`."""


class Fly(Protocol):
    """The type of the fixture `ftc_fly`."""

    def __call__(
        self,
        path: str | Path,
        *,
        speed: float | None = None,
        mode: FlightMode = "wire",
        **changes: Any,
    ) -> FlightResult:
        """Fly a scenario to its end; see `ftc_fly`."""


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    text = (
        f"{_MARK}(path, *, speed=None, mode='wire', **changes): the scenario of ftc_fleet and "
        "ftc_flight; path relative to the test's file or the rootdir, changes laid over it"
    )
    config.addinivalue_line("markers", text)
    config.stash[_FLIGHTS] = {}


@pytest.fixture
def ftc_launch(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Launch]:
    """Start fleets: ``ftc_launch("scenario.yaml", speed=None, **changes)``.

    They fly in lockstep, or at a real-time factor `speed`, and are stopped after the test.
    """
    from gcs.testing.fixtures import launch, prepared

    fleets = request.node.stash[_FLEETS] = []
    with ExitStack() as stack:

        def start(path: str | Path, *, speed: float | None = None, **changes: Any) -> TestFleet:
            flight = prepared(_found(request, path), changes, speed)
            fleet = launch(flight, tmp_path_factory.mktemp("fleet"))
            stack.callback(fleet.close)
            fleets.append(fleet)
            return fleet

        yield start


@pytest.fixture
def ftc_fleet(request: pytest.FixtureRequest, ftc_launch: Launch) -> TestFleet:
    """The fleet of ``@pytest.mark.ftc_scenario``, with its profile and faults set, not armed."""
    path, options = _marked(request)
    options.pop("mode", None)
    with _plainly():
        return ftc_launch(path, **options)


@pytest.fixture
def ftc_fly(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Fly:
    """Fly scenarios to their end: ``ftc_fly("scenario.yaml", mode="wire", **changes)``.

    Mode "in_process" uses no processes and no links. The same flight is flown once per session.
    """
    from gcs.testing.fixtures import fly, prepared

    flights = request.config.stash[_FLIGHTS]

    def flown(
        path: str | Path, *, speed: float | None = None, mode: FlightMode = "wire", **changes: Any
    ) -> FlightResult:
        flight = prepared(_found(request, path), changes, speed, mode)
        key = f"{mode} {speed} {flight.scenario.model_dump_json()}"
        if key not in flights:
            flights[key] = fly(flight, tmp_path_factory.mktemp("flight"))
        return flights[key]

    return flown


@pytest.fixture
def ftc_flight(request: pytest.FixtureRequest, ftc_fly: Fly) -> FlightResult:
    """The flight of ``@pytest.mark.ftc_scenario``, when it is over."""
    path, options = _marked(request)
    with _plainly():
        return ftc_fly(path, **options)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add a fleet's folder and simulated time to the report of a failed test."""
    report = yield
    if report.failed:
        lines = [f"{fleet!r}, files in {fleet.folder}" for fleet in item.stash.get(_FLEETS, [])]
        if lines and report.when == "call":
            from mavlink_defs.visible import visible

            report.sections.append(("ftc-sitl", "\n".join(map(visible, lines))))
    return report


@contextmanager
def _plainly() -> Iterator[None]:
    """Report errors of a scenario or its fleet without a traceback through our code."""
    from gcs.console.errors import GcsError

    try:
        yield
    except GcsError as problem:
        raise pytest.fail.Exception(str(problem), pytrace=False) from None


def _marked(request: pytest.FixtureRequest) -> tuple[str | Path, dict[str, Any]]:
    mark = request.node.get_closest_marker(_MARK)
    if mark is None or len(mark.args) != 1:
        raise pytest.UsageError(
            f"{request.node.nodeid} uses {request.fixturename}, which needs "
            f'@pytest.mark.{_MARK}("PATH"), with one path'
        )
    return mark.args[0], dict(mark.kwargs)


def _found(request: pytest.FixtureRequest, path: str | Path) -> Path:
    """Return a scenario beside the test's file, else below the rootdir, else a bundled one."""
    from gcs.scenario.bundled import find_scenario
    from mavlink_defs.config.models import ConfigError
    from mavlink_defs.visible import visible

    for folder in (request.path.parent, request.config.rootpath):
        if (folder / path).is_file():
            return folder / path
    try:
        return find_scenario(path)
    except ConfigError as problem:
        text = f"no scenario {path} in {request.path.parent} or {request.config.rootpath}"
        raise pytest.UsageError(f"{visible(text)}: {problem}") from None
