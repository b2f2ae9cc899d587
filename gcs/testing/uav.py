"""One UAV of a fleet in a test, behind plain function calls."""

from collections.abc import Callable, Sequence
from typing import Any

from gcs.station.fault_keys import fault_of, sensor_fault_of
from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_state import VehicleState
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.faults.fault import Fault
from mavlink_defs.profile import Segment
from mavlink_defs.services.param import Param


class FlyingUav:
    """One UAV in flight; each call returns once the UAV has answered.

    Calls raise `gcs.errors.CommandRefused` if it refuses and `NoAnswer` if it does not answer.

    Attributes:
        id: Its system id.
        vehicle: The asyncio client's vehicle, for `TestFleet.call`.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        call: Callable[[Any], Any],
        sent: Callable[[int, str], int],
    ) -> None:
        self.id = vehicle.system
        self.vehicle = vehicle
        self._call, self._sent = call, sent

    def __repr__(self) -> str:
        return f"<UAV {self.id}>"

    @property
    def state(self) -> VehicleState:
        """Its state by the latest telemetry."""
        return self.vehicle.state

    def sent(self, channel: str) -> int:
        """Return the transmissions of a channel ("rudder") so far, as the tap counted them."""
        return self._sent(self.id, channel)

    def arm(self) -> None:
        """Arm; simulated time begins when the last UAV of the fleet is armed."""
        self._call(self.vehicle.arm())

    def disarm(self, force: bool = False) -> None:
        """Disarm; in flight only with `force`, which cuts the thrust."""
        self._call(self.vehicle.disarm(force))

    def start(self) -> None:
        """Start flying the profile."""
        self._call(self.vehicle.start_mission())

    def set_mode(self, mode: str) -> None:
        """Change the mode: "AUTO", "LOITER", "RTL" or "GUIDED"."""
        self._call(self.vehicle.set_mode(mode))

    def upload(self, segments: Sequence[Segment]) -> None:
        """Upload a profile in place of the scenario's, which it already has."""
        self._call(self.vehicle.upload(segments))

    def download(self) -> tuple[Segment, ...]:
        """Download its profile."""
        segments: tuple[Segment, ...] = self._call(self.vehicle.download())
        return segments

    def command(self, number: int, *params: float) -> None:
        """Send any COMMAND_LONG: MAV_CMD and up to seven parameters."""
        self._call(self.vehicle.command(number, params))

    def get_param(self, name: str) -> Param:
        """Read a parameter."""
        param: Param = self._call(self.vehicle.get_param(name))
        return param

    def set_param(self, name: str, value: float) -> Param:
        """Set a parameter, and return it as the UAV then holds it."""
        param: Param = self._call(self.vehicle.set_param(name, value))
        return param

    def set_fault(self, actuator: str, *, start_s: float | None = None, **keys: float) -> None:
        """Set an actuator fault, with the keys of a scenario's `faults`.

        Args:
            actuator: Its name.
            start_s: Start in simulated time, exclusive; None for now [s].
            **keys: `effectiveness`, `bias_deg`, `bias_n`, `stuck_deg`, `stuck_n`,
                `frequency_hz`, `end_s`.

        Raises:
            BadInput: They do not describe a fault.
        """
        self._call(self.vehicle.set_fault(fault_of(actuator, start_s, **keys)))

    def set_sensor_fault(
        self,
        sensor: str,
        failure: str | None = None,
        *,
        instance: int = 0,
        axis: str | None = None,
        start_s: float | None = None,
        **keys: float,
    ) -> None:
        """Set a fault of a navigation sensor, with the keys of a scenario's `faults`.

        Args:
            sensor: Its name.
            failure: As of MAV_CMD_INJECT_FAILURE; None if a value says it.
            instance: Number of the sensor from 1; 0 for all.
            axis: Axis that is wrong; None for all.
            start_s: Start in simulated time, exclusive; None for now [s].
            **keys: Such as `bias_deg_s`, `fade_s`, `noise_factor`, `end_s`.

        Raises:
            BadInput: They do not describe a fault.
        """
        fault = sensor_fault_of(
            sensor, failure, instance=instance, axis=axis, start_s=start_s, **keys
        )
        self._call(self.vehicle.set_fault(fault))

    def clear_faults(self, actuator: str | None = None) -> None:
        """Clear the faults of one actuator, or all."""
        index = None if actuator is None else ACTUATORS.index(actuator)
        self._call(self.vehicle.clear_faults(index))

    def faults(self) -> tuple[Fault, ...]:
        """Return its faults, including past and future ones."""
        faults: tuple[Fault, ...] = self._call(self.vehicle.list_faults())
        return faults
