"""MAVSDK-Python drives a fleet: everything that docs/how-to/clients.md says it can."""

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from mavsdk import Autopilot, ComponentType, Configuration, Mavsdk, System
from mavsdk.plugins.action import Action, ActionError, ActionResult
from mavsdk.plugins.failure import Failure, FailureError, FailureResult, FailureType, FailureUnit
from mavsdk.plugins.info import Info, InfoError
from mavsdk.plugins.mission_raw import MissionItem, MissionRaw
from mavsdk.plugins.param import Param, ParamError, ParamResult
from mavsdk.plugins.telemetry import FlightMode, LandedState, Telemetry
from standing import Standing

from mavlink_defs.profile import segments_to_items

pytestmark = pytest.mark.sitl

TIMEOUT_S = 600.0
HOUR_US = 3600e6


def wait(condition: Callable[[], Any], what: str) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.02)


@pytest.fixture(scope="module")
def systems(fleet: Standing) -> Iterator[list[System]]:
    """The three vehicles, by system id."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    mavsdk.add_any_connection(f"udpin://127.0.0.1:{fleet.port}")
    try:
        wait(lambda: mavsdk.system_count() == 3, "three systems")
        found = sorted(mavsdk.get_systems(), key=lambda system: system.get_system_id())
        ardupilots = [Autopilot.ARDUPILOT] * 3  # until then, MAVSDK encodes integers bytewise
        wait(lambda: [s.autopilot_type() for s in found] == ardupilots, "their types")
        yield found
    finally:
        mavsdk.destroy()


@pytest.fixture(scope="module")
def leader(systems: list[System]) -> System:
    return systems[0]


@pytest.fixture(scope="module")
def telemetry(leader: System) -> Telemetry:
    telemetry = Telemetry(leader)
    wait(lambda: not math.isnan(telemetry.home().latitude_deg), "home")
    return telemetry


def mission(fleet: Standing) -> list[MissionItem]:
    return [
        MissionItem(
            i.seq,
            i.frame,
            i.command,
            int(i.seq == 0),
            1,
            i.param1,
            i.param2,
            i.param3,
            i.param4,
            i.x,
            i.y,
            i.z,
            0,
        )
        for i in segments_to_items(fleet.scenario.segments(), 1, 1)
    ]


def contents(items: list[MissionItem]) -> list[tuple[Any, ...]]:
    return [(i.seq, i.command, i.param1, i.param2, i.param3, i.param4, i.x, i.y) for i in items]


def test_all_vehicles_are_found_on_one_port(systems: list[System]) -> None:
    assert [system.get_system_id() for system in systems] == [1, 2, 3]
    assert all(system.component_ids() == [1] for system in systems)
    assert not any(system.has_camera() or system.has_gimbal() for system in systems)


def test_information(leader: System) -> None:
    info = Info(leader)

    def received() -> bool:
        with contextlib.suppress(InfoError):
            return info.get_version() is not None
        return False

    wait(received, "information")
    version = info.get_version()
    assert (version.flight_sw_major, version.flight_sw_minor) == (0, 1)
    assert bytes.fromhex(info.get_identification().hardware_uid).startswith(b"ftc-sitl UAV 1")


def test_telemetry_of_a_waiting_vehicle(fleet: Standing, telemetry: Telemetry) -> None:
    wait(telemetry.health_all_ok, "health")
    wait(lambda: not math.isnan(telemetry.position().latitude_deg), "position")
    wait(lambda: not math.isnan(telemetry.home().latitude_deg), "home")
    wait(lambda: not math.isnan(telemetry.velocity_ned().north_m_s), "velocity")
    wait(lambda: not math.isnan(telemetry.attitude_euler().pitch_deg), "attitude")
    wait(lambda: not math.isnan(telemetry.attitude_quaternion().w), "quaternion")
    wait(lambda: not math.isnan(telemetry.fixedwing_metrics().airspeed_m_s), "airspeed")
    wait(lambda: not math.isnan(telemetry.heading().heading_deg), "heading")
    wait(lambda: telemetry.landed_state() == LandedState.IN_AIR, "landed state")
    wait(lambda: telemetry.flight_mode() == FlightMode.HOLD, "flight mode")
    wait(lambda: telemetry.battery().remaining_percent > 0.9 * 100.0, "battery")
    wait(lambda: telemetry.gps_info().num_satellites >= 6, "satellites")
    position, home = telemetry.position(), telemetry.home()
    assert home.absolute_altitude_m == pytest.approx(584.0)
    assert position.relative_altitude_m == pytest.approx(100.0, abs=0.01)
    north_m = (position.latitude_deg - home.latitude_deg) * math.radians(6378137.0)
    assert north_m == pytest.approx(-20.0, abs=0.02)
    assert telemetry.velocity_ned().north_m_s == pytest.approx(40.0, abs=0.1)
    assert telemetry.attitude_euler().pitch_deg == pytest.approx(1.0, abs=1e-3)
    assert telemetry.attitude_quaternion().w == pytest.approx(1.0, abs=1e-3)
    assert telemetry.fixedwing_metrics().airspeed_m_s == pytest.approx(40.0)
    assert telemetry.heading().heading_deg == pytest.approx(0.0)
    assert telemetry.landed_state() == LandedState.IN_AIR
    assert telemetry.flight_mode() == FlightMode.HOLD
    assert not telemetry.armed()


def test_time_of_a_waiting_vehicle_flows(telemetry: Telemetry) -> None:
    began_us = time.time() * 1e6 - HOUR_US
    wait(lambda: telemetry.unix_epoch_time() > began_us, "the date")
    wait(lambda: telemetry.raw_gps().timestamp_us > 0, "GPS time")
    date_us, gps_us = telemetry.unix_epoch_time(), telemetry.raw_gps().timestamp_us
    wait(lambda: telemetry.unix_epoch_time() > date_us, "a later date")
    wait(lambda: telemetry.raw_gps().timestamp_us > gps_us, "later GPS time")
    assert telemetry.unix_epoch_time() < time.time() * 1e6 + HOUR_US


def attitudes_between(telemetry: Telemetry, n: int) -> int:
    """Count the attitudes that come in n intervals of the airspeed."""
    attitudes: list[None] = []
    counts: list[int] = []
    handles = (
        telemetry.subscribe_attitude_euler(lambda *_: attitudes.append(None)),
        telemetry.subscribe_fixedwing_metrics(lambda *_: counts.append(len(attitudes))),
    )
    wait(lambda: len(counts) > n + 1, f"{n + 2} airspeeds")
    telemetry.unsubscribe_attitude_euler(handles[0])
    telemetry.unsubscribe_fixedwing_metrics(handles[1])
    return counts[n + 1] - counts[1]


def test_rates_can_be_changed(telemetry: Telemetry) -> None:
    for name in (
        "position",
        "velocity_ned",
        "attitude_euler",
        "attitude_quaternion",
        "home",
        "in_air",
        "landed_state",
        "raw_gps",
        "gps_info",
        "battery",
        "odometry",
        "imu",
        "altitude",
        "fixedwing_metrics",
        "position_velocity_ned",
        "health",
        "actuator_output_status",
    ):
        getattr(telemetry, f"set_rate_{name}")(20.0)
    wait(lambda: not math.isnan(telemetry.odometry().position_body.x_m), "odometry")
    wait(lambda: telemetry.altitude().altitude_relative_m > 99.0, "altitude")
    wait(lambda: telemetry.imu().acceleration_frd.forward_m_s2 < 0.0, "imu")
    # one rate against the other: how fast time passes here does not matter
    telemetry.set_rate_fixedwing_metrics(5.0)
    assert attitudes_between(telemetry, 20) == pytest.approx(4 * 20, rel=0.2)
    telemetry.set_rate_attitude_euler(5.0)
    assert attitudes_between(telemetry, 20) == pytest.approx(20, rel=0.2)
    for name in ("attitude_euler", "position", "odometry", "imu", "altitude"):
        getattr(telemetry, f"set_rate_{name}")(0.0)


def test_parameters(leader: System) -> None:
    param = Param(leader)
    everything = param.get_all_params()
    names = {p.name: p.value for p in (*everything.int_params, *everything.float_params)}
    assert len(names) > 40
    assert (names["SYSID_THISMAV"], names["LAMBDA1"]) == (1, pytest.approx(0.46))
    assert param.get_param_int("TRIG_MODE") == 0
    param.set_param_int("TRIG_MODE", 1)
    assert param.get_param_int("TRIG_MODE") == 1
    param.set_param_int("TRIG_MODE", 0)
    assert param.get_param_float("K1_ROLL") == 50.0
    param.set_param_float("K1_ROLL", 47.5)
    assert param.get_param_float("K1_ROLL") == 47.5
    param.set_param_float("K1_ROLL", 50.0)


@pytest.mark.parametrize(
    ("ask", "result"),
    [
        (lambda param: param.get_param_float("NO_SUCH"), ParamResult.DOES_NOT_EXIST),
        (lambda param: param.set_param_float("K1_ROLL", -1.0), ParamResult.VALUE_OUT_OF_RANGE),
        (lambda param: param.set_param_int("TRIG_MODE", 8), ParamResult.VALUE_OUT_OF_RANGE),
        (lambda param: param.set_param_int("SYSID_THISMAV", 9), ParamResult.READ_ONLY),
        (lambda param: param.set_param_int("K1_ROLL", 9), ParamResult.WRONG_TYPE),
    ],
)
def test_refused_parameters(leader: System, ask: Callable[[Param], Any], result: int) -> None:
    with pytest.raises(ParamError) as refusal:
        ask(Param(leader))
    assert refusal.value.args[0] == result


def test_missions_of_all_types(fleet: Standing, leader: System) -> None:
    raw = MissionRaw(leader)
    raw.upload_mission(mission(fleet))
    assert contents(raw.download_mission())[1:] == contents(mission(fleet))[1:]
    raw.set_current_mission_item(2)
    wait(lambda: raw.mission_progress().current == 2, "item 2")
    raw.set_current_mission_item(1)
    wait(lambda: raw.mission_progress().current == 1, "item 1")
    assert raw.download_geofence() == raw.download_rallypoints() == []
    raw.clear_mission()
    assert len(raw.download_mission()) == 1


def test_failures(leader: System) -> None:
    failure = Failure(leader)
    for unit, kinds in (
        (FailureUnit.SYSTEM_SERVO, (FailureType.OFF, FailureType.STUCK, FailureType.OK)),
        (FailureUnit.SYSTEM_MOTOR, (FailureType.OFF, FailureType.OK)),
    ):
        for kind in kinds:
            failure.inject(unit, kind, 1)
    for unit, kind, why in (  # this fleet flies by the true state
        (FailureUnit.SENSOR_GPS, FailureType.OFF, FailureResult.DENIED),
        (FailureUnit.SYSTEM_SERVO, FailureType.GARBAGE, FailureResult.UNSUPPORTED),
    ):

        def is_refused(unit: FailureUnit = unit, kind: FailureType = kind, why: int = why) -> bool:
            """An acknowledgement names its command alone: a late one answers the next as well."""
            try:
                failure.inject(unit, kind, 0)
            except FailureError as refusal:
                return bool(refusal.args[0] == why)
            return False

        wait(is_refused, f"{unit} {kind} is {why}")


def test_arm_and_disarm(leader: System, telemetry: Telemetry) -> None:
    action = Action(leader)
    action.arm()
    wait(telemetry.armed, "armed")
    action.disarm()
    wait(lambda: not telemetry.armed(), "disarmed")


def test_the_mission_is_flown(fleet: Standing, systems: list[System], telemetry: Telemetry) -> None:
    """Arm all, then start: MAVSDK changes to HOLD before it arms."""
    raws, actions = [MissionRaw(s) for s in systems], [Action(s) for s in systems]
    for raw in raws:
        raw.upload_mission(mission(fleet))
    for action in actions:
        action.arm()
    for raw in raws:
        raw.start_mission()
    wait(lambda: telemetry.flight_mode() == FlightMode.MISSION, "flight mode MISSION")
    wait(lambda: raws[0].mission_progress().current == 2, "the second segment")
    wait(lambda: telemetry.position().latitude_deg > telemetry.home().latitude_deg, "movement")
    wait(lambda: raws[0].mission_progress().total == 4, "the number of items")
    assert not raws[0].is_mission_finished()
    with pytest.raises(ActionError) as refusal:
        actions[0].disarm()
    assert refusal.value.args[0] == ActionResult.COMMAND_DENIED
    raws[0].pause_mission()
    wait(lambda: telemetry.flight_mode() == FlightMode.HOLD, "flight mode HOLD")
    actions[0].kill()
    wait(lambda: not telemetry.armed(), "disarmed")
