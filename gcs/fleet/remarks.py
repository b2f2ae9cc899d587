"""What the user should know of a flight before it begins; each face tells it in its own way."""

import contextlib
import warnings
from collections.abc import Iterable, Iterator

from ftc_autopilot.plugins.loading import calling
from gcs.scenario.model import Scenario
from gcs.scenario.sections import Links
from mavlink_defs.endpoint import EndpointError, UdpAddress, exposed, is_loopback
from sitl_plant.sensing.observability import observability_warnings, rounded_rates

WARNING = "warning: "
"""What people read before a warning."""


class WarningRemark(str):
    """A remark that warns: programs in Python get it as a warning as well."""

    __slots__ = ()


class ExposureRemark(WarningRemark):
    """The warning that other machines can reach a flight: printed with ``--quiet`` as well."""

    __slots__ = ()


def remarks_of(scenario: Scenario) -> list[str]:
    """Return the remarks on a scenario, however it is flown."""
    return [
        *_one_path(scenario),
        *_mission(scenario),
        *_fence(scenario),
        *_sensors(scenario),
        *_heading(scenario),
    ]


def exposures(links: Links, *, with_key: bool) -> Iterator[str]:
    """Yield the warning that other machines can reach the ports of a flight, if they can."""
    with contextlib.suppress(EndpointError):  # binding them will report the error
        if not is_loopback(UdpAddress(links.host, links.gcs_port)):
            yield ExposureRemark(exposed(links.host, with_key))


def warn(remarks: Iterable[str]) -> None:
    """Warn the caller of our caller of those remarks on a flight that are warnings."""
    for text in remarks:
        if isinstance(text, WarningRemark):
            warnings.warn(text.removeprefix(WARNING), stacklevel=3)


def _one_path(scenario: Scenario) -> Iterator[str]:
    if scenario.mission is None or scenario.formation is not None or len(scenario.uavs) < 2:
        return
    uavs = ", ".join(str(uav.id) for uav in scenario.uavs)
    yield WarningRemark(
        f"{WARNING}UAVs {uavs} fly one path, and nothing keeps them apart: "
        "give each a slot in the section formation, as missions/hexagon does"
    )


def _mission(scenario: Scenario) -> Iterator[str]:
    """Yield what is flown otherwise than the mission may be meant."""
    if scenario.mission is not None:
        for remark in scenario.planner().remarks(scenario.mission_items()):
            yield f"mission: {remark}"


def _fence(scenario: Scenario) -> Iterator[str]:
    """Yield where the mission leaves the fence."""
    if scenario.fence is None or not scenario.fence.enable or scenario.mission is None:
        return
    path = scenario.planner().path(scenario.mission_items())
    if (item := scenario.fence.watch(scenario.origin).left_by(path)) is not None:
        yield WarningRemark(
            f"{WARNING}the mission leaves the fence on the way to item {item}: "
            f"a breach there is followed by {scenario.fence.action}"
        )


def _sensors(scenario: Scenario) -> Iterator[str]:
    """Yield what the sensors that an autopilot navigates by do otherwise than usual."""
    if scenario.navigation == "true_state":
        return
    navigation = scenario.sensors.navigation
    for loc, text in rounded_rates(navigation, scenario.step_us):
        yield f"{'.'.join(['sensors', 'navigation', *map(str, loc)])}: {text}"
    for loc, text in observability_warnings(navigation):
        key = ".".join(["sensors", "navigation", *map(str, loc)])
        yield WarningRemark(f"{WARNING}{key} is false: {text}")


def _heading(scenario: Scenario) -> Iterator[str]:
    """Yield of which UAVs the heading is held by bank, and why."""
    uavs: dict[str, list[int]] = {}
    for uav in scenario.uavs:
        with calling(type(scenario.controller), "holds_heading_by_bank"):
            reason = scenario.controller.holds_heading_by_bank(scenario.aircraft_of(uav.id))
        if reason is not None:
            uavs.setdefault(reason, []).append(uav.id)
    for reason, ids in uavs.items():
        yield f"UAV {', '.join(map(str, ids))}: heading is held by bank ({reason})"
