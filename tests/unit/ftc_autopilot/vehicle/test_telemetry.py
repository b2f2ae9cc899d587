"""Telemetry: what messages say, that they can always be made, and how often they come."""

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.hot.drops import GCS
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.vehicle.message import declared_in
from ftc_autopilot.vehicle.status_messages import VERSION
from ftc_autopilot.vehicle.telemetry import DEFAULT_INTERVALS_US, MAKERS
from ftc_autopilot.vehicle.vehicle import VehicleServices
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker, parse

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
ATTITUDE = dialect.MAVLINK_MSG_ID_ATTITUDE
UNIX_S = 1.8e9


class Bench:
    """A vehicle that flies North-East and climbs, a kilometre North of its origin."""

    def __init__(self, scenario: Scenario) -> None:
        config = scenario.autopilot_config(3)
        autopilots = new_autopilots([config])
        self.controllers, self.hot = autopilots.controllers, HotState(autopilots)
        state = self.hot.measured
        state["position"] = (1000.0, 0.0, -120.0)
        state["velocity"] = (40.0, 0.0, 0.0)
        state["attitude"] = (0.0, math.radians(10.0), math.radians(45.0))
        state["time_usec"] = 5_000_000
        self.controllers.uavs[0]["actuators"]["controls"][:4] = (0.5, -1.0, 1.0, 0.25)
        self.vehicle = VehicleServices(config, self.hot, self.controllers, UNIX_S)
        (self.telemetry,) = self.vehicle.telemetry
        self.speaker = FramePacker(3, 1)

    def heard(self, name: str) -> Any:
        """A message as a ground station gets it."""
        message_id = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
        made = self.telemetry.make(message_id)
        assert made is not None
        received = parse(self.speaker.pack(made))
        assert received is not None
        return received


@pytest.fixture
def bench(scenario1: Scenario) -> Bench:
    return Bench(scenario1)


def test_in_wind_airspeed_and_groundspeed_differ(bench: Bench) -> None:
    state = bench.hot.measured
    state["attitude"] = (0.0, 0.0, math.radians(90.0))  # it heads East, the wind blows North-East
    state["velocity"], state["wind"] = (50.0, -6.0, 0.5), (10.0, -6.0, 0.5)
    hud, wind = bench.heard("VFR_HUD"), bench.heard("WIND_COV")
    assert hud.airspeed == pytest.approx(40.0)
    assert hud.groundspeed == pytest.approx(math.hypot(50.0, 6.0))
    assert (wind.wind_x, wind.wind_y, wind.wind_z) == pytest.approx((6.0, 10.0, 0.5), abs=1e-5)
    assert wind.wind_alt == pytest.approx(704.0)
    assert math.isnan(wind.horiz_accuracy)


def test_global_position(bench: Bench) -> None:
    m, home = bench.heard("GLOBAL_POSITION_INT"), bench.heard("HOME_POSITION")
    assert (m.lat - home.latitude) * 1e-7 * math.radians(6378137.0) == pytest.approx(1000.0, 1e-4)
    assert (m.lon, m.alt, m.relative_alt) == (home.longitude, 704_000, 120_000)
    assert (home.latitude, home.longitude, home.altitude) == (-353632620, 1491652370, 584_000)
    assert (m.vx, m.vy, m.hdg) == (2785, 2785, 4500)
    assert m.vz == -695
    assert bench.heard("GPS_RAW_INT").cog == 4500
    assert bench.heard("VFR_HUD").alt == pytest.approx(704.0)
    assert bench.heard("ALTITUDE").altitude_relative == pytest.approx(120.0)


def test_east_is_east_across_the_date_line() -> None:
    place = place_of(
        Origin(latitude_deg=0.0, longitude_deg=180.0, altitude_m=0.0), 0.0, 1000.0, 0.0
    )
    assert place.longitude == pytest.approx(-180e7 + 89832, abs=1)


def test_attitude_quaternion_is_body_to_ned(bench: Bench) -> None:
    m = bench.heard("ATTITUDE_QUATERNION")
    w, x, y, z = m.q1, m.q2, m.q3, m.q4
    pitch = math.asin(2.0 * (w * y - z * x))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    assert (math.degrees(pitch), math.degrees(yaw)) == pytest.approx((10.0, 45.0), abs=1e-4)


def test_held_commands(bench: Bench) -> None:
    assert bench.heard("ACTUATOR_OUTPUT_STATUS").actuator[:4] == [0.5, -1.0, 1.0, 0.25]
    m = bench.heard("SERVO_OUTPUT_RAW")
    assert (m.servo1_raw, m.servo2_raw, m.servo3_raw, m.servo4_raw) == (1750, 1000, 1250, 2000)


def test_it_looks_like_a_small_aircraft(bench: Bench) -> None:
    battery, status = bench.heard("BATTERY_STATUS"), bench.heard("SYS_STATUS")
    cells = [mv for mv in battery.voltages if mv != 65535]
    assert sum(cells) == status.voltage_battery
    assert all(3500 <= mv <= 4200 for mv in cells)
    assert battery.battery_remaining == status.battery_remaining == 100
    assert battery.current_battery == status.current_battery > 0
    for bit in (0, 1, 2, 3, 4, 5, 20, 25, 28):
        assert status.onboard_control_sensors_health & 1 << bit
    gps = bench.heard("GPS_RAW_INT")
    assert gps.fix_type >= dialect.GPS_FIX_TYPE_3D_FIX
    assert 6 <= gps.satellites_visible <= 30
    assert 0 < gps.eph < 200


def test_dropped_datagrams_of_ground_stations_are_reported(bench: Bench) -> None:
    bench.hot.drops[GCS, -DropReason.BAD_CRC] = 7
    assert bench.heard("SYS_STATUS").errors_comm == 7


def test_a_vehicle_lives_while_simulated_time_stands_still(bench: Bench) -> None:
    """And from then on its clock is simulated time, however fast that runs."""
    times = []
    for now, simulated_s, running in [
        (100.0, 0.0, False),
        (160.0, 0.0, False),
        (160.0, 0.0, True),
        (161.0, 30.0, True),  # thirty times as fast as real time
        (162.0, 60.0, True),
        (162.0, 60.0, False),  # the plant ended, and another one starts at 0
        (172.0, 0.0, False),
        (172.0, 0.0, True),
        (173.0, 1.0, True),
    ]:
        bench.hot.measured["time_usec"] = round(simulated_s * 1e6)
        bench.hot.flags = dialect.FTC_SIM_FLAGS_RUNNING if running else 0
        bench.vehicle.handle_timer(now)
        reported = bench.heard("SYSTEM_TIME")
        times.append(reported.time_boot_ms / 1e3)
        assert bench.heard("ATTITUDE").time_boot_ms == reported.time_boot_ms
        assert bench.heard("GPS_RAW_INT").time_usec == 1000 * reported.time_boot_ms
        assert reported.time_unix_usec == round(UNIX_S * 1e6) + 1000 * reported.time_boot_ms
        assert bench.heard("FTC_EVENTS").time_boot_ms == round(simulated_s * 1e3)
    assert times == [0.0, 60.0, 60.0, 90.0, 120.0, 120.0, 130.0, 130.0, 131.0]


def test_version(bench: Bench) -> None:
    project = Path(__file__).parents[4] / "pyproject.toml"
    declared = tomllib.loads(project.read_text())["project"]["version"]
    assert ".".join(map(str, VERSION)) == declared
    m = bench.heard("AUTOPILOT_VERSION")
    assert m.flight_sw_version >> 8 == 0x000100
    assert m.uid & 0xFF == 3
    assert m.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST


@pytest.mark.parametrize("value", [0.0, math.nan, math.inf, -math.inf, 1e300, -1e300, 1e9])
def test_no_state_is_too_strange_to_be_reported(value: float, bench: Bench) -> None:
    records = (
        bench.hot.measured,
        bench.controllers.uavs[0]["signals"],
        bench.controllers.uavs[0]["controller"],
        bench.controllers.uavs[0]["actuators"],
    )
    with np.errstate(all="ignore"):
        for record in records:
            _fill(record, value)
        every = [i for i in range(60_000) if bench.telemetry.request((float(i), 0.0)) is not None]
        assert len(every) > 22
        for message_id in every:
            message = bench.telemetry.request((float(message_id), 0.0))
            assert message is not None
            received = parse(bench.speaker.pack(message))
            assert received is not None
            assert received.get_msgId() == message_id


def _fill(record: Any, value: float) -> None:
    for name in record.dtype.names or ():
        if record.dtype[name].names:
            _fill(record[name], value)
        elif record.dtype[name].base.kind == "f":
            record[name] = value


def due(bench: Bench, message_id: int, seconds: float = 2.0) -> int:
    count = 0
    for ms in range(10_000, 10_000 + round(seconds * 1e3), 20):
        count += sum(m.get_msgId() == message_id for m in bench.telemetry.due(ms * 1000))
    return count


def test_intervals_are_set_reported_and_restored(bench: Bench) -> None:
    assert due(bench, ATTITUDE) == 20
    assert bench.telemetry.set_interval((ATTITUDE, 500_000.0)) == ACCEPTED
    assert due(bench, ATTITUDE) == 4
    assert _interval(bench, ATTITUDE) == 500_000
    bench.telemetry.set_interval((ATTITUDE, -1.0))
    assert (due(bench, ATTITUDE), _interval(bench, ATTITUDE)) == (0, -1)
    bench.telemetry.set_interval((ATTITUDE, 0.0))
    assert _interval(bench, ATTITUDE) == DEFAULT_INTERVALS_US[ATTITUDE]


def _interval(bench: Bench, message_id: int) -> int:
    message: Any = bench.telemetry.interval((float(message_id),))
    assert message.message_id == message_id
    return int(message.interval_us)


def test_what_is_not_streamed_at_first_can_be(bench: Bench) -> None:
    odometry = dialect.MAVLINK_MSG_ID_ODOMETRY
    assert (due(bench, odometry), _interval(bench, odometry)) == (0, -1)
    bench.telemetry.set_interval((odometry, 200_000.0))
    assert due(bench, odometry) == 10
    bench.telemetry.set_interval((odometry, 0.0))
    assert due(bench, odometry) == 0


@pytest.mark.parametrize(
    "params",
    [(31_000.0, 1e5), (math.nan, 1e5), (30.0, math.inf), (-1.0, 1.0), (30.7, 1e5), (0.0, 1e5)],
)
def test_other_intervals_are_denied(params: tuple[float, float], bench: Bench) -> None:
    before = _interval(bench, ATTITUDE)
    assert bench.telemetry.set_interval(params) == DENIED
    assert _interval(bench, ATTITUDE) == before
    assert _interval(bench, 31_000) == 0


def test_heartbeats_have_an_interval_that_stays(bench: Bench) -> None:
    heartbeat = dialect.MAVLINK_MSG_ID_HEARTBEAT
    for interval_us in (0.0, 1e6):
        assert bench.telemetry.set_interval((heartbeat, interval_us)) == ACCEPTED
    assert bench.telemetry.set_interval((heartbeat, -1.0)) == DENIED
    assert _interval(bench, heartbeat) == 1_000_000


def test_every_message_that_nobody_asked_for_is_of_the_common_dialect() -> None:
    assert DEFAULT_INTERVALS_US.keys() <= common.mavlink_map.keys()


@pytest.mark.parametrize(
    ("stream", "rate", "start", "expected"),
    [
        (10, 4, 1, 250_000),
        (0, 2, 1, 500_000),
        (10, 4, 0, -1),
        (10, 0, 1, -1),
        (11, 4, 1, 100_000),
        (99, 4, 1, 100_000),
        (10, 1000, 1, 20_000),
    ],
)
def test_data_streams(stream: int, rate: int, start: int, expected: int, bench: Bench) -> None:
    bench.telemetry.set_interval((dialect.MAVLINK_MSG_ID_FTC_EVENTS, 200_000.0))
    bench.vehicle.receive(dialect.MAVLink_request_data_stream_message(3, 1, stream, rate, start), 0)
    assert _interval(bench, ATTITUDE) == expected
    assert _interval(bench, dialect.MAVLINK_MSG_ID_FTC_EVENTS) == 200_000


def test_asking_again_for_the_same_rate_does_not_disturb_it(bench: Bench) -> None:
    bench.telemetry.due(10_000_000)
    bench.telemetry.set_interval((ATTITUDE, 100_000.0))
    assert ATTITUDE not in {m.get_msgId() for m in bench.telemetry.due(10_020_000)}


STEP_US = 1000


def gaps(bench: Bench, seconds: float, step_us: int = STEP_US) -> list[list[int]]:
    """Ids of the messages made after each control step of a flight in real time."""
    most = bench.telemetry.most_per_step(step_us)
    clocks = range(0, round(seconds * 1e6), step_us)
    return [[m.get_msgId() for m in bench.telemetry.due(t, most)] for t in clocks]


def test_default_streams_are_never_due_together(bench: Bench) -> None:
    made = gaps(bench, 4.0)
    assert max(map(len, made)) == 1
    for message_id, interval_us in DEFAULT_INTERVALS_US.items():
        assert sum(message_id in gap for gap in made) == 4_000_000 // interval_us


@pytest.mark.parametrize("step_us", [100, 1000, 10_000, 20_000, 100_000])
def test_no_rate_makes_more_than_a_few_messages_between_two_steps(
    bench: Bench, step_us: int
) -> None:
    every = [i for i in range(60_000) if bench.telemetry.request((float(i), 0.0)) is not None]
    streams = [i for i in every if bench.telemetry.set_interval((i, 20_000.0)) == ACCEPTED]
    made = gaps(bench, 2.0, step_us)
    assert max(map(len, made)) <= bench.telemetry.most_per_step(step_us)
    assert bench.telemetry.most_per_step(1000) == 2
    expected = 2_000_000 // max(step_us, 20_000)
    for message_id in streams:
        assert abs(sum(gap.count(message_id) for gap in made) - expected) <= 1


def test_no_stream_starves_when_there_is_room_for_less_than_all(bench: Bench) -> None:
    streams = [i for i in range(60_000) if bench.telemetry.set_interval((i, 20_000.0)) == ACCEPTED]
    made = [m.get_msgId() for ms in range(2000) for m in bench.telemetry.due(ms * STEP_US, 1)]
    counts = [made.count(message_id) for message_id in streams]
    assert len(made) == 2000
    assert max(counts) - min(counts) <= 0.1 * max(counts)


def test_after_a_standstill_all_are_made_in_turn_and_none_is_sent_later(bench: Bench) -> None:
    gaps(bench, 1.0)
    made = [
        [m.get_msgId() for m in bench.telemetry.due(10_000_000 + ms * STEP_US, 2)]
        for ms in range(20)
    ]
    assert max(map(len, made)) == 2
    together = [i for gap in made for i in gap]
    assert {*together} == {*DEFAULT_INTERVALS_US}
    assert len(together) <= len(DEFAULT_INTERVALS_US) + 5


def test_a_clock_that_is_set_back_stops_no_stream(bench: Bench) -> None:
    bench.telemetry.due(10_000_000)
    assert sum(ATTITUDE in gap for gap in gaps(bench, 1.0)) == 10


def test_a_new_stream_is_the_next_that_is_due(bench: Bench) -> None:
    bench.telemetry.due(10_000_000)
    assert bench.telemetry.next_due_us() > 10_000_000
    bench.telemetry.set_interval((dialect.MAVLINK_MSG_ID_FTC_EVENTS, 200_000.0))
    assert bench.telemetry.next_due_us() <= 10_000_000
    bench.telemetry.due(10_000_000)
    assert bench.telemetry.next_due_us() > 10_000_000


def test_answers_and_telemetry_wait_for_their_turn_and_none_is_forgotten(bench: Bench) -> None:
    bench.hot.heard_s = 1.0
    bench.hot.flags = dialect.FTC_SIM_FLAGS_RUNNING
    bench.vehicle.receive(dialect.MAVLink_param_request_list_message(3, 1), 0.0)
    said: list[Any] = []
    for ms in range(1000):
        bench.hot.measured["time_usec"] = ms * STEP_US
        bench.vehicle.handle_timer(ms / 1e3, most=2)
        messages = bench.vehicle.gcs_messages(most=2)
        assert len(messages) <= 2
        said += messages
    assert not bench.vehicle.has_gcs_messages
    params = [m for m in said if m.get_type() == "PARAM_VALUE"]
    assert {m.param_index for m in params} == set(range(params[0].param_count))
    assert sum(m.get_msgId() == ATTITUDE for m in said) == 10


def test_what_makes_messages_of_a_vehicle_is_listed(bench: Bench) -> None:
    """What is not listed can be asked for, but is not streamed from the start."""
    assert set(bench.telemetry._makers) <= {each.number for each in declared_in(*MAKERS)}
