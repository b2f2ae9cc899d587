"""One UAV of a fleet in a test, behind plain function calls."""

import functools
from collections.abc import Callable, Coroutine
from typing import Any, Concatenate, ParamSpec, TypeVar

from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_state import VehicleState

P = ParamSpec("P")  # of a method of `Vehicle`
R = TypeVar("R")  # what it returns when the UAV has answered


def _waited_for(
    method: Callable[Concatenate[Vehicle, P], Coroutine[Any, Any, R]],
) -> "Callable[Concatenate[FlyingUav, P], R]":
    """Return a coroutine method of `Vehicle` as a plain one, its arguments and text the same."""

    @functools.wraps(method)
    def call(self: "FlyingUav", /, *args: P.args, **kwargs: P.kwargs) -> R:
        result: R = self.call(method(self.vehicle, *args, **kwargs))
        return result

    return call


class FlyingUav:
    """One UAV in flight: the operations of `gcs.station.vehicle.Vehicle`, without ``await``.

    Each returns once the UAV has answered, and raises `gcs.errors.CommandRefused` if it refuses and
    `gcs.errors.NoAnswer` if it does not answer.

    Attributes:
        id: Its system id.
        vehicle: The asyncio client's vehicle, for `TestFleet.call`.
        call: Runs a coroutine of the client to its end, and returns its result.
    """

    def __init__(
        self, vehicle: Vehicle, call: Callable[[Any], Any], sent: Callable[[int, str], int]
    ) -> None:
        self.id = vehicle.id
        self.vehicle = vehicle
        self.call = call
        self._sent = sent

    def __repr__(self) -> str:
        return repr(self.vehicle)

    @property
    def state(self) -> VehicleState:
        """Its state by the latest telemetry."""
        return self.vehicle.state

    def sent(self, channel: str) -> int:
        """Return the transmissions of a channel ("rudder") so far, as the tap counted them."""
        return self._sent(self.id, channel)

    def command(self, number: int, *params: float) -> None:
        """Send any COMMAND_LONG: MAV_CMD and up to seven parameters."""
        self.call(self.vehicle.command(number, params))

    arm, disarm = _waited_for(Vehicle.arm), _waited_for(Vehicle.disarm)
    start = start_mission = _waited_for(Vehicle.start_mission)
    set_mode = _waited_for(Vehicle.set_mode)
    set_slot, formation = _waited_for(Vehicle.set_slot), _waited_for(Vehicle.formation)

    set_fault, clear_faults = _waited_for(Vehicle.set_fault), _waited_for(Vehicle.clear_faults)
    set_sensor_fault = _waited_for(Vehicle.set_sensor_fault)
    clear_sensor_faults = _waited_for(Vehicle.clear_sensor_faults)
    faults = _waited_for(Vehicle.faults)

    upload = upload_profile = _waited_for(Vehicle.upload_profile)
    download = download_profile = _waited_for(Vehicle.download_profile)
    upload_mission = _waited_for(Vehicle.upload_mission)
    download_mission = _waited_for(Vehicle.download_mission)
    home = _waited_for(Vehicle.home)
    upload_fence, download_fence = (
        _waited_for(Vehicle.upload_fence),
        _waited_for(Vehicle.download_fence),
    )
    upload_rally, download_rally = (
        _waited_for(Vehicle.upload_rally),
        _waited_for(Vehicle.download_rally),
    )
    enable_fence = _waited_for(Vehicle.enable_fence)

    list_params = _waited_for(Vehicle.list_params)
    get_param, set_param = _waited_for(Vehicle.get_param), _waited_for(Vehicle.set_param)
    set_interval, request = _waited_for(Vehicle.set_interval), _waited_for(Vehicle.request)
