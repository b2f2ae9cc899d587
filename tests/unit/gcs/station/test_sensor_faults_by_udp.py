"""Sensor faults over UDP: commands and programs here, the plant's service there."""

import asyncio
import json
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from typer.testing import CliRunner

from gcs.api.station import connect
from gcs.commands.cli import app
from gcs.console.errors import BadInput, CommandRefused
from gcs.scenario.model import load_scenario
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.services.command import CommandMessage, command_params
from sitl_plant.loop.fault_commands import faults_of
from sitl_plant.loop.fleet import new_plant_state
from sitl_plant.loop.service import AircraftService

SCENARIO = load_scenario("sensor_faults/pitot_off")
UAV, NOW_S = 3, 12.0


class Plant:
    """The plant's service of one aircraft on a UDP port of its own, as a vehicle."""

    def __init__(self, has_sensors: bool) -> None:
        navigation = "estimated" if has_sensors else "true_state"
        config = SCENARIO.plant_config().model_copy(update={"navigation": navigation})
        fleet = new_plant_state(config)
        self.failures = fleet.sensing.faults
        limits = SCENARIO.aircraft_of(UAV).fault_limits
        self._service = AircraftService(UAV, 1, faults_of(fleet, UAV - 1, limits))
        self._packer = FramePacker(UAV, 1)
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.bind(("127.0.0.1", 0))
        self._sock.settimeout(0.05)
        self.address = f"udpout:127.0.0.1:{self._sock.getsockname()[1]}"
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._stop.is_set():
            try:
                datagram, address = self._sock.recvfrom(2048)
            except TimeoutError:
                continue
            for message in self._answers(datagram):
                self._sock.sendto(self._packer.pack(message), address)

    def _answers(self, datagram: bytes) -> list[dialect.MAVLink_message]:
        message = parse(datagram)
        assert message is not None
        self._service.receive(message, NOW_S, time.monotonic())
        answers = [
            dialect.MAVLink_heartbeat_message(1, 0, 128, 0, 4, 3),
            *self._service.messages_to_send(),
        ]
        asked = command_params(message)[0] if isinstance(message, CommandMessage) else 0.0
        if asked == dialect.MAVLINK_MSG_ID_FTC_EVENTS:  # which have the simulated time
            counts = [0] * 4
            answers.append(
                dialect.MAVLink_ftc_events_message(
                    round(NOW_S * 1e3), 12_000, counts, counts, 0, counts, 0
                )
            )
        return answers

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._sock.close()

    def gcs(self, *arguments: str) -> Any:
        """Run a command against it."""
        options = ("--connect", self.address, "--uav", "3")
        return CliRunner().invoke(app, [*arguments, *options])


@pytest.fixture
def plant() -> Iterator[Plant]:
    plant = Plant(has_sensors=True)
    yield plant
    plant.close()


@pytest.fixture
def true_state() -> Iterator[Plant]:
    plant = Plant(has_sensors=False)
    yield plant
    plant.close()


def test_commands_set_list_and_clear_faults(plant: Plant) -> None:
    done = plant.gcs("fault", "sensor", "set", "gyro", "--bias-deg-s", "3", "--for-s", "8")
    assert done.stdout == "UAV 3: gyro +3 deg/s from now to 20 s\n"
    done = plant.gcs("fault", "sensor", "set", "airspeed", "--failure", "stuck")
    assert done.exit_code == 0
    done = plant.gcs("fault", "set", "rudder", "--effectiveness", "0.5", "--start-s", "30")
    assert done.exit_code == 0
    listed = plant.gcs("fault", "list").stdout
    assert listed.splitlines() == [
        "UAV 3: rudder at 50 % after 30 s, until cleared, waiting",
        "UAV 3: gyro 1 +3 deg/s in (12, 20] s, waiting",
        "UAV 3: gyro 2 +3 deg/s in (12, 20] s, waiting",
        "UAV 3: airspeed stuck after 12 s, until cleared, waiting",
    ]
    assert plant.gcs("fault", "sensor", "clear", "gyro", "--instance", "1").exit_code == 0
    assert plant.gcs("fault", "sensor", "clear", "airspeed").exit_code == 0
    (answer,) = json.loads(plant.gcs("fault", "list", "--json").stdout)
    assert answer["faults"][1:] == [
        {
            "sensor": "gyro",
            "instance": 2,
            "failure": "wrong",
            "bias_deg_s": 3.0,
            "start_s": 12.0,
            "end_s": 20.0,
            "active": False,
        }
    ]
    done = plant.gcs("fault", "clear")
    assert done.stdout == "UAV 3: faults of all actuators and sensors cleared\n"
    assert plant.gcs("fault", "list").stdout == "UAV 3: no faults\n"
    assert (plant.failures.faults["target"] == -1).all()


def test_a_program_sets_lists_and_clears_faults(plant: Plant) -> None:
    async def fly() -> list[str]:
        async with connect(plant.address, uavs=[3]) as fleet:
            uav = fleet[3]
            await uav.set_sensor_fault("airspeed", fade_s=20.0)
            await uav.set_sensor_fault("gyro", "stuck", instance=1, start_s=15.0, end_s=16.0)
            before = [fault.describe() for fault in await uav.faults()]
            await uav.clear_sensor_faults("gyro")
            with pytest.raises(CommandRefused, match=r"must be 0 \(all\) to 2 of gyro"):
                await uav.set_sensor_fault("gyro", "off", instance=3)
            with pytest.raises(BadInput, match="does not fit a sensor of gps"):
                await uav.set_sensor_fault("gps", fade_s=20.0)
            with pytest.raises(BadInput, match="expected gyro, accelerometer"):
                await uav.clear_sensor_faults("pitot")
            after = [fault.describe() for fault in await uav.faults()]
            assert after == before[:1]
            return before

    assert asyncio.run(fly()) == [
        "airspeed fades in 20 s after 12 s, until cleared",
        "gyro 1 stuck in (15, 16] s",
    ]


def test_an_aircraft_that_flies_by_its_true_state_refuses(true_state: Plant) -> None:
    done = true_state.gcs("fault", "sensor", "set", "gps", "--failure", "off")
    assert done.exit_code != 0
    assert isinstance(done.exception, CommandRefused) or "navigation: estimated" in done.output
    assert true_state.gcs("fault", "list").stdout == "UAV 3: no faults\n"
