"""Instruments by plain pymavlink: a receiver that is off, wrong or stuck looks like that."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from flying import scenario_tree, standing
from pymavlink import mavutil
from pymavlink.dialects.v20 import common

from gcs.scenario.model import scenario_of

pytestmark = pytest.mark.sitl

TIMEOUT_S = 600.0
OFF, WRONG, STUCK = 1, 2, 3
"""The vehicles, by what is to happen to their receivers."""
EARTH_M_DEG = math.radians(6378137.0) * 1e-7
ABSOLUTE = common.ESTIMATOR_POS_HORIZ_ABS
UINT16 = 2**16 - 1


class Station:
    """A ground station that knows the common dialect only."""

    def __init__(self, port: int) -> None:
        mavutil.mavlink = common
        self._link: Any = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", dialect="common")
        self._link.mav = common.MAVLink(self._link, srcSystem=254, srcComponent=1)
        self._link.mav.robust_parsing = True
        self.heard: dict[tuple[int, str], list[Any]] = {}

    def close(self) -> None:
        self._link.close()

    def wait(self, condition: Callable[[], bool]) -> None:
        """Listen until a condition holds."""
        end_s = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < end_s, {key: row[-1] for key, row in self.heard.items()}
            message = self._link.recv_match(blocking=True, timeout=1.0)
            if message is not None:
                key = message.get_srcSystem(), message.get_type()
                self.heard.setdefault(key, []).append(message)

    def command(self, uav: int, number: int, *params: float) -> int:
        """Send a command until it is answered; return the result."""
        answers = self.heard.setdefault((uav, "COMMAND_ACK"), [])
        answers.clear()
        seven = (*params, *[0.0] * 7)[:7]
        self._link.mav.command_long_send(uav, 1, number, 0, *seven)
        self.wait(lambda: any(answer.command == number for answer in answers))
        return int(answers[-1].result)

    def last(self, uav: int, name: str) -> Any:
        return self.heard[uav, name][-1]

    def renew(self, *names: str) -> None:
        """Forget what was heard, and hear each of these messages of each vehicle again."""
        self.heard = {}
        keys = [(uav, name) for uav in (OFF, WRONG, STUCK) for name in names]
        self.wait(lambda: all(key in self.heard for key in keys))


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """Scenario 1 by sensors, in flight."""
    folder = tmp_path_factory.mktemp("instruments")
    tree = scenario_tree(duration_s=300.0, faults=[], navigation="estimated")
    with standing(scenario_of(folder / "scenario.yaml", tree), folder, speed=0.5) as scenario:
        station = Station(scenario.links.gcs_port)
        try:
            station.renew("HEARTBEAT", "GPS_RAW_INT", "GLOBAL_POSITION_INT")
            for uav in (OFF, WRONG, STUCK):
                for name in ("ESTIMATOR_STATUS", "HIGHRES_IMU", "SCALED_PRESSURE"):
                    number = getattr(common, f"MAVLINK_MSG_ID_{name}")
                    result = station.command(
                        uav, common.MAV_CMD_SET_MESSAGE_INTERVAL, number, 100_000.0
                    )
                    assert result == common.MAV_RESULT_ACCEPTED
            yield station
        finally:
            station.close()


def north_apart(station: Station, uav: int) -> float:
    """How far to the north of the estimate the receiver is [m]."""
    receiver, estimate = (
        station.last(uav, name).lat for name in ("GPS_RAW_INT", "GLOBAL_POSITION_INT")
    )
    return float((receiver - estimate) * EARTH_M_DEG)


def test_a_fleet_that_waits_has_a_fix_and_its_place(station: Station) -> None:
    station.renew("ESTIMATOR_STATUS", "GPS_RAW_INT", "GLOBAL_POSITION_INT", "SCALED_PRESSURE")
    for uav in (OFF, WRONG, STUCK):
        gps = station.last(uav, "GPS_RAW_INT")
        assert (gps.fix_type, gps.satellites_visible, gps.eph, gps.epv) == (3, 14, 80, 120)
        assert station.last(uav, "ESTIMATOR_STATUS").flags & ABSOLUTE
        assert abs(north_apart(station, uav)) < 10.0
        altitude_m = station.last(uav, "GLOBAL_POSITION_INT").alt / 1e3
        pressure = station.last(uav, "SCALED_PRESSURE").press_abs
        assert pressure == pytest.approx(1013.25 * (1.0 - 2.25577e-5 * altitude_m) ** 5.25588, 0.01)


def test_a_receiver_that_is_off_wrong_or_stuck_looks_like_that(station: Station) -> None:
    for uav in (OFF, WRONG, STUCK):
        station.command(uav, common.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    station.wait(lambda: abs(station.last(STUCK, "ATTITUDE").roll) > 1e-3)  # they fly
    begin_ms = station.last(STUCK, "ATTITUDE").time_boot_ms
    settled_ms = begin_ms + 5000  # before, nothing is excluded
    station.wait(lambda: station.last(STUCK, "ATTITUDE").time_boot_ms > settled_ms)
    for uav, failure in (
        (OFF, common.FAILURE_TYPE_OFF),
        (WRONG, common.FAILURE_TYPE_WRONG),
        (STUCK, common.FAILURE_TYPE_STUCK),
    ):
        unit = common.FAILURE_UNIT_SENSOR_GPS
        result = station.command(uav, common.MAV_CMD_INJECT_FAILURE, unit, failure)
        assert result == common.MAV_RESULT_ACCEPTED
    station.wait(
        lambda: (
            not any(
                station.last(uav, "ESTIMATOR_STATUS").flags & ABSOLUTE
                for uav in (OFF, WRONG, STUCK)
            )
        )
    )
    station.renew("ESTIMATOR_STATUS", "GPS_RAW_INT", "GLOBAL_POSITION_INT")

    off, status = station.last(OFF, "GPS_RAW_INT"), station.last(OFF, "ESTIMATOR_STATUS")
    assert (off.fix_type, off.satellites_visible) == (common.GPS_FIX_TYPE_NO_FIX, 255)
    assert (off.eph, off.epv, off.vel, off.cog) == (UINT16,) * 4
    assert not status.flags & common.ESTIMATOR_GPS_GLITCH
    assert math.isnan(status.vel_ratio)
    assert math.isnan(status.pos_horiz_ratio)
    assert status.mag_ratio >= 0.0

    wrong, status = station.last(WRONG, "GPS_RAW_INT"), station.last(WRONG, "ESTIMATOR_STATUS")
    assert wrong.fix_type == common.GPS_FIX_TYPE_3D_FIX
    assert abs(north_apart(station, WRONG)) > 20.0
    assert status.flags & common.ESTIMATOR_GPS_GLITCH
    assert status.pos_horiz_ratio > 1.0

    station.wait(lambda: len(station.heard[STUCK, "GPS_RAW_INT"]) >= 4)
    stuck, status = station.heard[STUCK, "GPS_RAW_INT"], station.last(STUCK, "ESTIMATOR_STATUS")
    assert len({(gps.lat, gps.lon, gps.alt) for gps in stuck}) == 1
    assert stuck[-1].fix_type == common.GPS_FIX_TYPE_3D_FIX
    moved = {place.lat for place in station.heard[STUCK, "GLOBAL_POSITION_INT"]}
    assert len(moved) > 1
    assert status.flags & common.ESTIMATOR_GPS_GLITCH
