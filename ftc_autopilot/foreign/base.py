"""What a bridge asks of the autopilot of another project that it flies.

A further one is a class with these methods, its configuration in `ftc_autopilot.kinds`, and its
line in `ftc_autopilot.foreign.bridge.FOREIGN`. The bridge has the rest: registration with the
plant, commands to it, telemetry and faults to and from the ground stations, the recording.
"""

from typing import NamedTuple, Protocol

import numpy as np

from sitl_plant.sensing.failures import Failures


class ForeignError(Exception):
    """A foreign autopilot cannot fly, or cannot fly on; the text says why, in one line."""


class ForeignInputError(ForeignError):
    """It cannot be started as it is configured: the user can change that."""


class PlantStep(NamedTuple):
    """What the plant sent its aircraft at one step; payloads are records of the hot codec."""

    step: int
    time_us: int  # simulation time, 0 before the flight
    state: np.void | None  # codec.SIM_STATE; None in a flight by sensors
    sensors: tuple[np.void, ...] = ()  # codec.HIL_SENSOR of each IMU; flights by sensors only
    gps: np.void | None = None  # codec.HIL_GPS, if there is a sample


class Conversation(Protocol):
    """The MAVLink of a foreign autopilot, as its bridge passes it on."""

    @property
    def is_ready(self) -> bool:
        """Whether it can be armed, and stations see it; after a restart they need not."""

    @property
    def is_armed(self) -> bool:
        """Whether it is armed."""

    def exchange(self, time_s: float) -> None:
        """Take in what it has sent, and send what waits for it.

        Args:
            time_s: By its own clock.
        """

    def release(self) -> float:
        """Let what a station has sent wait for it, one message at a time.

        Returns:
            How long it takes to answer, by its own clock [s]; 0 if no station has sent anything.
        """


class ForeignAutopilot(Protocol):
    """The autopilot of another project, and the child process that it is.

    It sends its MAVLink, with the UAV's system id and component 1, to the address that the bridge
    gives its constructor: ``Class(config: AutopilotConfig, vehicle_link: UdpAddress)``. What
    ground stations send comes to it from there.

    Attributes:
        failures: Faults of the sensors that it is shown, which the bridge sets.
        notices: Lines for the operator, which the bridge takes away.
    """

    failures: Failures
    notices: list[str]

    def begin(self, first: PlantStep) -> None:
        """Start the program, and hold the aircraft where the plant has it.

        Args:
            first: The step at which the plant's time stands still: 0, or where one before it
                ended.

        Raises:
            ForeignInputError: It cannot be started.
        """

    def hold(self, talk: Conversation) -> bool:
        """Let its own clock run on a little (20 ms of the wall clock at most).

        It is called again and again until the plant's time begins.

        Args:
            talk: Its MAVLink, to be exchanged as its clock runs.

        Returns:
            Whether it is armed and in the air, or stands where its flight begins: the bridge then
            reports it to the plant as armed, and `exchange` follows with the same step.

        Raises:
            ForeignError: It has ended, or does not become ready.
        """

    def exchange(self, sent: PlantStep) -> np.ndarray:
        """Give it what the plant has sent, and return its commands at this step.

        In lockstep it returns when the autopilot has answered: nothing of its clock is left over.

        Returns:
            Shares as HIL_ACTUATOR_CONTROLS has them, in the plant's signs, shape (4,), float32:
            aileron, elevator, rudder from -1 to 1, throttle from 0 to 1.

        Raises:
            ForeignError: It has ended, or does not answer.
        """

    def close(self) -> None:
        """End the program (killed, not asked) and its files; it may never have begun."""
