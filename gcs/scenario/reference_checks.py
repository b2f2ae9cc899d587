"""Checks of references and faults of a scenario against the aircraft that are to fly them."""

from collections import Counter
from collections.abc import Mapping, Sequence

from ftc_autopilot.kinds import ForeignSection
from gcs.scenario.sections import FaultOfUav, Found, ProfileSegment, ScenarioSensorFault
from mavlink_defs.config.models import Loc
from mavlink_defs.faults.kinds import FaultLimits
from mavlink_defs.profile import AirspeedLimits


def airspeed_problems(loc: Loc, airspeed_m_s: float, limits: AirspeedLimits) -> Found:
    """Yield that an airspeed at a place is none that the aircraft accepts."""
    low, high = limits.min_m_s, limits.max_m_s
    if not low <= airspeed_m_s <= high:
        text = f"expected [{low:g}, {high:g}] m/s, the aircraft's limits, got {airspeed_m_s!r}"
        yield (*loc, "airspeed_m_s"), text


def profile_problems(
    profile: Sequence[ProfileSegment], has_mission: bool, limits: AirspeedLimits
) -> Found:
    """Yield what is wrong with a profile.

    Args:
        profile: Its segments; none if a mission is flown.
        has_mission: Whether a mission is.
        limits: Airspeeds that every aircraft accepts.
    """
    if not profile and not has_mission:
        yield ("profile",), "expected a segment, or a mission instead, got nothing"
    if profile and has_mission:
        yield ("mission",), "expected a profile or a mission, got both; null removes a profile"
    if not profile:
        return
    if profile[0].start_s != 0.0:
        text = f"expected 0 s in the first segment, got {profile[0].start_s!r}"
        yield ("profile", 0, "start_s"), text
    for i in range(1, len(profile)):
        before, start = profile[i - 1].start_s, profile[i].start_s
        if start <= before:
            text = f"overlaps profile[{i - 1}]: expected > {before!r} s, got {start!r}"
            yield ("profile", i, "start_s"), text
    for i in sorted({0, len(profile) - 1}):
        if profile[i].shape == "ramp":
            text = "expected 'step' in the first and the last segment, got 'ramp'"
            yield ("profile", i, "shape"), text
    for i, segment in enumerate(profile):
        yield from airspeed_problems(("profile", i), segment.airspeed_m_s, limits)


def fault_problems(
    faults: Sequence[FaultOfUav],
    limits_of: Mapping[int, FaultLimits],
    sensors: Mapping[int, Mapping[str, int]],
    foreign: Mapping[int, ForeignSection],
) -> Found:
    """Yield what is wrong with faults.

    Args:
        faults: The faults.
        limits_of: Limits of the actuators, by UAV.
        sensors: How many sensors of each name can fail, by UAV; none of one of ours that flies by
            its true state.
        foreign: Foreign autopilots, by UAV.
    """
    rows: Counter[tuple[int, str]] = Counter()
    for i, fault in enumerate(faults):
        family, name = fault.FAMILY, fault.target.name
        there = sensors.get(fault.uav, {})
        named = 1 if fault.command().instance else there.get(name, 1)
        rows[fault.uav, family.key] += named
        if rows[fault.uav, family.key] > family.most:
            text = f"UAV {fault.uav} has more than {family.most} faults, as many as fit"
            yield ("faults", i, "uav"), text
        limits = limits_of.get(fault.uav)
        if limits is None:
            ids = ", ".join(map(str, limits_of))
            yield ("faults", i, "uav"), f"expected one of the UAVs {ids}, got {fault.uav}"
        elif isinstance(fault, ScenarioSensorFault):
            yield from _sensor_problems(i, fault, there, foreign.get(fault.uav))
        else:
            yield from _limit_problems(i, fault, limits)
        for j in range(i):
            if fault.overlaps(faults[j]):
                text = (
                    f"overlaps faults[{j}]: the {name} of UAV {fault.uav} has a "
                    f"fault in {faults[j].shown_window} already, got {fault.shown_window}"
                )
                yield ("faults", i), text


def _limit_problems(i: int, fault: FaultOfUav, limits: FaultLimits) -> Found:
    target = fault.target
    if not limits.has(target.name):
        yield ("faults", i, fault.FAMILY.key), f"the aircraft has no {target.name}"
    elif fault.value is not None:
        kind, value = fault.value
        low, high = kind.bounds(target, limits)
        if not low <= value <= high:
            expected = f"[{low:g}, {high:g}] {kind.unit_of(target)}"
            text = f"expected {expected}, the aircraft's limits, got {value!r}"
            yield ("faults", i, kind.key(target)), text


def _sensor_problems(
    i: int,
    fault: ScenarioSensorFault,
    sensors: Mapping[str, int],
    foreign: ForeignSection | None,
) -> Found:
    if foreign is not None and (why := foreign.refuses(fault.command())) is not None:
        yield ("faults", i, "sensor"), why
    elif not sensors:
        text = (
            f"with 'navigation: true_state' the aircraft has no {fault.sensor} that could fail; "
            "set 'navigation: estimated'"
        )
        yield ("faults", i, "sensor"), text
    elif not (there := sensors.get(fault.sensor, 0)):
        yield ("faults", i, "sensor"), f"the aircraft has no {fault.sensor}: see sensors.navigation"
    elif fault.instance > there:
        text = f"expected 0 to {there}, as many as there are, got {fault.instance}"
        yield ("faults", i, "instance"), text
