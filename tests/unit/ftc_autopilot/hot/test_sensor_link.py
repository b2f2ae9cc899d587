"""The autopilot's link to a plant that sends what sensors report, over real loopback sockets.

The sensors' messages are made by pymavlink's own dialect, as another simulator would make them.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from link_bench import LOCKSTEP, NOTHING_APPLIED, UAV, Rig
from pymavlink.dialects.v20 import common

from ftc_autopilot.control.controllers import begin_path
from ftc_autopilot.hot.drops import SIMULATOR
from ftc_autopilot.hot.state import reset_links
from gcs.results.mission_paths import paths_of
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.dialect import FTC_SIM_FLAGS_GPS, FTC_SIM_FLAGS_RUNNING
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.hot_link import ReturnReason

ALL_OF_IMU_0 = 0b1_1111_1111_1111
GYRO_AND_ACCELEROMETER = 0b11_1111
FAR = 473_566_100, 85_191_400, 1_488_000


class SensorRig(Rig):
    """A link to a plant that sends sensors, of level flight at 40 m/s and 1000 m to the north."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._sender = common.MAVLink(None, UAV, 25)

    def send(self, message: Any) -> None:
        frame = message.pack(self._sender)
        self._sender.seq = (self._sender.seq + 1) % 256
        self.plant.sendto(frame, self.own.getsockname())

    def send_sensor(self, step: int, imu: int = 0, xgyro: float = 0.0) -> None:
        first = imu == 0
        self.send(
            common.MAVLink_hil_sensor_message(
                1000 * step,
                *(0.0, 0.0, -9.81),
                *(xgyro, 0.0, 0.0),
                *((0.2, 0.0, 0.4) if first else (0.0, 0.0, 0.0)),
                898.7 if first else 0.0,
                9.8 if first else 0.0,
                1000.0 if first else 0.0,
                8.5 if first else 0.0,
                ALL_OF_IMU_0 if first else GYRO_AND_ACCELEROMETER,
                imu,
            )
        )

    def send_gps(self, measured: int, place: tuple[int, int, int] = FAR) -> None:
        velocity = 4000, 4000, 0, 0, 0
        self.send(common.MAVLink_hil_gps_message(1000 * measured, 3, *place, 80, 80, *velocity, 14))

    def send_step(self, step: int, flags: int = LOCKSTEP, run: int = 7) -> None:
        silent = [0] * 32
        self.send(
            dialect.MAVLink_ftc_sim_step_message(
                1000 * step, NOTHING_APPLIED, step, run, flags, silent
            )
        )

    def send_all(self, step: int, flags: int = LOCKSTEP, run: int = 7) -> None:
        self.send_sensor(step, 0)
        self.send_sensor(step, 1)
        self.send_step(step, flags, run)

    def answers(self) -> list[int]:
        """Handle all that waits, and return what the plant hears."""
        for _ in range(8):
            self.run()
        return self.heard(self.plant)

    def drops(self, reason: DropReason) -> int:
        return int(self.autopilots.own[0]["drops"][SIMULATOR, -reason])

    def estimate(self) -> tuple[Any, ...]:
        measured = self.autopilots.own[0]["measured"]
        return tuple(measured[name].tolist() for name in ("position", "velocity", "attitude"))


@pytest.fixture
def rig(scenario1: Scenario) -> Iterator[SensorRig]:
    rig = SensorRig(scenario1.model_copy(update={"navigation": "estimated"}))
    yield rig
    rig.close()


def is_answered(rig: SensorRig) -> bool:
    return codec.MessageId.STEP_DONE in rig.answers()


def test_a_step_with_all_sensors_is_answered(rig: SensorRig) -> None:
    rig.send_neighbour_state(0)
    rig.send_all(0)
    assert rig.answers() == [codec.MessageId.ACTUATORS, codec.MessageId.STEP_DONE]
    assert int(rig.autopilots.own[0]["link"]["step"]) == 0
    assert not rig.autopilots.own["drops"].any()
    _, velocity, attitude = rig.estimate()
    assert np.isfinite([*velocity, *attitude]).all()


@pytest.mark.parametrize("lost", [0, 1])
def test_in_lockstep_a_step_that_lacks_an_imu_waits_until_all_is_sent_again(
    rig: SensorRig, lost: int
) -> None:
    rig.send_neighbour_state(0)
    rig.send_all(0)
    assert is_answered(rig)
    rig.send_neighbour_state(1)
    rig.send_sensor(1, 1 - lost)
    rig.send_step(1)
    assert rig.answers() == []
    rig.send_all(1)
    assert is_answered(rig)


def test_in_lockstep_a_step_that_lacks_its_gps_sample_waits(rig: SensorRig) -> None:
    rig.send_neighbour_state(0)
    rig.send_all(0)
    assert is_answered(rig)
    rig.send_neighbour_state(1)
    rig.send_all(1, LOCKSTEP | FTC_SIM_FLAGS_GPS)
    assert rig.answers() == []
    rig.send_sensor(1, 0)
    rig.send_sensor(1, 1)
    rig.send_gps(0)
    rig.send_step(1, LOCKSTEP | FTC_SIM_FLAGS_GPS)
    assert is_answered(rig)
    assert int(rig.autopilots.own[0]["link"]["flags"]) == LOCKSTEP


def test_before_the_first_fix_a_member_flies_by_no_place_and_tells_neighbours_none() -> None:
    """It tells them its motion; a place is one of the fix, not a guess from home."""
    scenario = with_changes("missions/hexagon", ["estimated"])
    rig, paths = SensorRig(scenario), paths_of(scenario)
    assert paths is not None
    rig.controllers.paths[0] = paths[1]
    uav = rig.controllers.uavs[0]
    begin_path(uav["guidance"])
    own, command = uav["own_state"], uav["guidance"]["command"].tolist()
    for step in range(3):
        rig.send_neighbour_state(step)
        rig.send_all(step)
        assert is_answered(rig)
        assert (int(own["step"]), int(own["path_id"]), own["position"].any()) == (step, 0, False)
        assert uav["guidance"]["command"].tolist() == command
    rig.send_neighbour_state(3)
    origin = scenario.origin
    degrees = round(origin.latitude_deg * 1e7), round(origin.longitude_deg * 1e7) + 10_000
    rig.send_gps(2, (*degrees, 1_000_000))
    rig.send_all(3, LOCKSTEP | FTC_SIM_FLAGS_GPS)
    assert is_answered(rig)
    assert int(own["path_id"]) == int(paths[1]["id"])
    place, _, _ = rig.estimate()
    assert own["position"] == pytest.approx(place, abs=1e-3)
    assert uav["guidance"]["command"].tolist() != command
    rig.close()


def test_in_real_time_a_step_is_flown_with_what_has_come(rig: SensorRig) -> None:
    for step in range(3):
        rig.send_sensor(step, 0)
        if step != 1:
            rig.send_sensor(step, 1)
        rig.send_step(step, FTC_SIM_FLAGS_RUNNING)
        rig.answers()
        assert int(rig.autopilots.own[0]["link"]["step"]) == step
    assert int(rig.autopilots.own[0]["navigation"]["step"]) == 2


def turning(rig: SensorRig, step: int, *, is_heard: bool = True) -> None:
    """Send a step in real time, with all sensors, of an aircraft that rolls."""
    for imu in (0, 1):
        rig.send_sensor(step, imu, xgyro=1.0)
    if is_heard:
        rig.send_step(step, FTC_SIM_FLAGS_RUNNING)


@pytest.fixture
def stepwise(scenario1: Scenario) -> tuple[Any, ...]:
    """The estimate of an autopilot that has handled six steps one by one."""
    rig = SensorRig(scenario1.model_copy(update={"navigation": "estimated"}))
    for step in range(6):
        turning(rig, step)
        rig.answers()
    rig.close()
    return rig.estimate()


def test_every_step_that_waits_is_estimated_and_the_newest_is_flown(
    rig: SensorRig, stepwise: tuple[Any, ...]
) -> None:
    turning(rig, 0)
    rig.answers()
    before = int(rig.controllers.uavs[0]["controller"]["steps"])
    for step in range(1, 6):
        turning(rig, step)
    rig.answers()
    assert int(rig.autopilots.own[0]["link"]["step"]) == 5
    assert int(rig.controllers.uavs[0]["controller"]["steps"]) == before + 1
    assert rig.estimate() == stepwise


def test_a_step_that_was_lost_is_estimated_with_the_next(
    rig: SensorRig, stepwise: tuple[Any, ...]
) -> None:
    for step in range(6):
        turning(rig, step, is_heard=step not in {2, 3})
        rig.answers()
    assert rig.estimate() == stepwise


def test_a_sensor_that_was_overtaken_is_left_out(rig: SensorRig, stepwise: tuple[Any, ...]) -> None:
    for step in range(6):
        if step == 5:
            for imu in (0, 1):
                rig.send_sensor(5, imu, xgyro=1.0)
            rig.send_sensor(3, 0, xgyro=-9.0)
            rig.send_step(5, FTC_SIM_FLAGS_RUNNING)
        else:
            turning(rig, step)
        rig.answers()
    assert rig.estimate() == stepwise


def test_the_first_step_in_real_time_needs_every_imu(rig: SensorRig) -> None:
    rig.send_sensor(0, 0)
    rig.send_step(0, FTC_SIM_FLAGS_RUNNING)
    rig.answers()
    assert int(rig.autopilots.own[0]["link"]["step"]) == -1
    rig.send_all(1, FTC_SIM_FLAGS_RUNNING)
    rig.answers()
    assert int(rig.autopilots.own[0]["link"]["step"]) == 1


def test_a_gps_sample_may_be_older_than_the_last(rig: SensorRig) -> None:
    for step, measured in enumerate((500, 300)):
        rig.send_neighbour_state(step)
        rig.send_sensor(step, 0)
        rig.send_sensor(step, 1)
        rig.send_gps(measured)
        rig.send_step(step, LOCKSTEP | FTC_SIM_FLAGS_GPS)
        assert is_answered(rig)


def test_a_step_whose_time_is_another_is_refused(rig: SensorRig) -> None:
    rig.send_sensor(0, 0)
    rig.send_sensor(0, 1)
    message = dialect.MAVLink_ftc_sim_step_message(500, NOTHING_APPLIED, 0, 7, LOCKSTEP, [0] * 32)
    rig.send(message)
    assert rig.answers() == []
    assert rig.drops(DropReason.OUT_OF_RANGE) == 1


def test_the_same_step_again_changes_no_estimate(rig: SensorRig) -> None:
    rig.send_neighbour_state(0)
    rig.send_all(0)
    assert is_answered(rig)
    estimator = rig.autopilots.own["navigation"]["estimator"]
    before, memory = estimator.copy(), rig.autopilots.histories.copy()
    estimate = rig.estimate()
    rig.send_all(0)
    assert rig.answers() == [codec.MessageId.STEP_DONE]
    assert rig.estimate() == estimate
    assert estimator.tobytes() == before.tobytes()
    assert rig.autopilots.histories.tobytes() == memory.tobytes()


def test_sensors_out_of_range_are_dropped_and_counted(rig: SensorRig) -> None:
    rig.send_sensor(0, 0, xgyro=float("nan"))
    rig.send_sensor(0, 2)
    rig.send(common.MAVLink_hil_gps_message(0, 3, 910_000_000, 0, 0, *([0] * 7), 14))
    rig.send_sensor(0, 1)
    rig.send_step(0)
    assert rig.answers() == []
    assert rig.drops(DropReason.OUT_OF_RANGE) == 3


def test_what_belongs_to_the_other_way_to_fly_is_unexpected(
    rig: SensorRig, scenario1: Scenario
) -> None:
    rig.send_state(0)
    rig.run()
    assert rig.drops(DropReason.UNEXPECTED) == 1
    true = SensorRig(scenario1)
    true.send_all(0)
    assert true.answers() == []
    assert true.drops(DropReason.UNEXPECTED) == 3
    true.close()


def test_sensors_of_another_aircraft_are_refused(rig: SensorRig) -> None:
    rig._sender = common.MAVLink(None, UAV + 1, 25)
    rig.send_all(0)
    assert rig.answers() == []
    assert rig.drops(DropReason.STRANGER) == 3


def test_another_plant_process_restarts_the_flight(rig: SensorRig) -> None:
    rig.send_neighbour_state(0)
    rig.send_all(0)
    rig.answers()
    rig.send_all(0, run=8)
    outcomes = [rig.run() for _ in range(3)]
    assert ReturnReason.RESTARTED in outcomes
    reset_links(rig.autopilots)
    rig.send_all(0, run=8)
    assert is_answered(rig)
