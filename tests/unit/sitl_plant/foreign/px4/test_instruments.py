"""What PX4 is sent of an aircraft: by MAVLink's units, and by what PX4 makes of it."""

import math
from typing import Any

import numpy as np
import pytest

from mavlink_defs import dialect
from mavlink_defs.framing.codec import SIM_STATE
from mavlink_defs.framing.frames import parse
from mavlink_defs.framing.stream import FrameStream
from mavlink_defs.origin import Origin
from sitl_plant.foreign.px4.instruments import Instruments
from sitl_plant.sensing.config import NavigationSensors

STEP_US, EVERY = 1000, 4
ACCEL, GYRO, MAG, BARO, PITOT = 0b111, 0b111000, 0b111000000, 0x1A00, 0x400
ORIGIN = Origin(latitude_deg=47.0, longitude_deg=8.0, altitude_m=500.0)


@pytest.fixture
def motion():
    state = np.zeros(1, SIM_STATE)[0]
    state["position"] = 100.0, -50.0, -80.0
    state["velocity"] = 25.0, 1.0, 2.0
    state["attitude"] = 0.2, -0.1, 2.5
    state["rates"] = 0.01, -0.02, 0.03
    state["specific_force"] = 0.5, 0.1, -9.6
    state["wind"] = 3.0, 0.0, 0.0
    return state


def instruments(grade="ideal", seed=1, **sensors):
    config = NavigationSensors.model_validate({"grade": grade, **sensors})
    return Instruments(config, ORIGIN, 1.2, 9.81, 1, seed, STEP_US)


def flown(made, motion, frames, first=0, with_truth=True):
    """The messages of each frame: one is sent with the first of its control periods."""
    found = []
    for frame in range(frames):
        for k in range(EVERY):
            made.note((first + frame) * EVERY + k, motion)
            if k == 0:
                time_us = (first + frame + 1) * EVERY * STEP_US
                data = made.frame(time_us, with_truth=with_truth)
                found.append([parse(one) for one in FrameStream().feed(data)])
    return found


def of_kind(messages, kind):
    return [m for m in messages if isinstance(m, kind)]


def test_the_primary_imu_comes_first_and_all_have_the_same_time(motion):
    for k, messages in enumerate(flown(instruments(), motion, 3), start=1):
        sensors = of_kind(messages, dialect.MAVLink_hil_sensor_message)
        assert messages[: len(sensors)] == sensors
        assert [m.id for m in sensors] == [0, 1]
        assert {m.time_usec for m in sensors} == {k * EVERY * STEP_US}
        assert all(m.fields_updated & (ACCEL | GYRO) == ACCEL | GYRO for m in sensors)


def test_each_instrument_is_new_at_its_rate_and_all_its_bits_together(motion):
    """At 250 frames a second what falls between two frames is new in the next."""
    frames = flown(instruments(gnss={"latency_s": 0.0}), motion, 251)[1:]  # a second
    updated = [m.fields_updated for one in frames for m in one if getattr(m, "id", 1) == 0
               and isinstance(m, dialect.MAVLink_hil_sensor_message)]  # fmt: skip
    for bits, rate in ((ACCEL, 250), (GYRO, 250), (MAG, 100), (BARO, 50), (PITOT, 100)):
        assert {u & bits for u in updated} <= {0, bits}
        assert sum(u & bits == bits for u in updated) == rate
    fixes = [m for one in frames for m in of_kind(one, dialect.MAVLink_hil_gps_message)]
    assert len(fixes) == 10


def test_values_are_the_aircrafts(motion):
    messages = [m for one in flown(instruments(gnss={"latency_s": 0.0}), motion, 1) for m in one]
    (sensor, _) = of_kind(messages, dialect.MAVLink_hil_sensor_message)
    assert (sensor.xacc, sensor.yacc, sensor.zacc) == pytest.approx((0.5, 0.1, -9.6))
    assert (sensor.xgyro, sensor.ygyro, sensor.zgyro) == pytest.approx((0.01, -0.02, 0.03))
    assert sensor.abs_pressure == pytest.approx(946.0, abs=2.0)  # hPa at 580 m
    assert sensor.diff_pressure * 100.0 == pytest.approx(0.5 * 1.2 * 22.0**2, rel=0.01)  # Pa
    (gps,) = of_kind(messages, dialect.MAVLink_hil_gps_message)
    assert gps.fix_type == 3
    assert gps.lat / 1e7 == pytest.approx(47.0 + 100.0 / 111_320.0, abs=2e-5)
    assert gps.alt == 580_000
    assert math.hypot(gps.vn, gps.ve, gps.vd) == pytest.approx(100.0 * math.hypot(25, 1, 2), abs=2)


def test_the_truth_is_as_px4_logs_it(motion):
    (frame,) = flown(instruments(), motion, 1)
    (truth,) = of_kind(frame, dialect.MAVLink_hil_state_quaternion_message)
    w, x, y, z = truth.attitude_quaternion
    assert math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) == pytest.approx(0.2)
    assert math.asin(2 * (w * y - z * x)) == pytest.approx(-0.1)
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(2.5)
    assert (truth.rollspeed, truth.alt) == (pytest.approx(0.01), 580_000)
    speed = math.hypot(truth.vx, truth.vy, truth.vz)
    assert speed == pytest.approx(100.0 * math.hypot(25.0, 1.0, 2.0), abs=2.0)
    assert truth.true_airspeed == pytest.approx(100.0 * math.hypot(22.0, 1.0, 2.0), abs=1.0)


def test_an_aircraft_at_rest_has_no_acceleration(motion):
    motion["attitude"], motion["specific_force"] = (0.0, 0.0, 1.0), (0.0, 0.0, -9.81)
    (frame,) = flown(instruments(), motion, 1)
    (truth,) = of_kind(frame, dialect.MAVLink_hil_state_quaternion_message)
    assert (truth.xacc, truth.yacc, truth.zacc) == (0, 0, 0)


@pytest.mark.parametrize("scale", [1.0, 1e3, 1e6])
def test_no_motion_is_too_large_to_be_sent(motion, scale):
    for name in ("velocity", "specific_force", "rates"):
        motion[name] *= scale
    assert all(None not in one for one in flown(instruments(), motion, 3))


def test_nothing_is_sent_of_the_truth_unless_asked_for(motion):
    frames = flown(instruments(), motion, 5, with_truth=False)
    kinds = {type(m) for one in frames for m in one}
    assert dialect.MAVLink_hil_state_quaternion_message not in kinds


def test_a_heartbeat_comes_each_second(motion):
    frames = flown(instruments(), motion, 500)
    beats = [m for one in frames for m in of_kind(one, dialect.MAVLink_heartbeat_message)]
    assert len(beats) == 2


def test_begun_again_they_show_the_same_whatever_was_before(motion):
    """How long a station took to arm it must not change a bit of the flight."""
    found: list[list[dict[str, Any]]] = []
    for held in (3, 40):
        made = instruments("consumer")
        flown(made, motion, held)
        made.restart(held * EVERY * STEP_US)
        found.append([])
        for frame in range(30):
            for k in range(EVERY):
                made.note(frame * EVERY + k, motion)
            time_us = (held + frame + 1) * EVERY * STEP_US
            for one in FrameStream().feed(made.frame(time_us, with_truth=True)):
                message = parse(one)
                assert message is not None
                values: dict[str, Any] = dict(message.to_dict())
                if "time_usec" in values:  # not of a HEARTBEAT
                    found[-1].append(values | {"time_usec": values["time_usec"] - held * 4000})
    assert found[0] == found[1]
