"""From the outputs of PX4 to commands of the plant."""

import numpy as np

from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.dialect import MAV_MODE_FLAG_SAFETY_ARMED
from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import aerodynamics
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.foreign.px4.config import MotorOutput, Px4Outputs, ServoOutput

_SURFACES = (AILERON, ELEVATOR, RUDDER)
_aerodynamics = in_python(aerodynamics.aerodynamics)


class Px4Actuators:
    """The outputs of one PX4, as an aircraft's actuators take them.

    Attributes:
        shares: What was commanded last, shape (4,), float32 as on our wire: aileron, elevator,
            rudder from -1 to 1 in the plant's signs, throttle from 0 to 1.
    """

    def __init__(self, config: Px4Outputs, aircraft: AircraftRecord) -> None:
        """Begin in the middle, without thrust.

        Args:
            config: Which output moves which actuator.
            aircraft: The aircraft, whose signs it needs: a greater value is to turn it right, or
                its nose up, by whatever deflection does that.
        """
        self._config = config
        C = _aerodynamics((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), aircraft).C
        self._signs = [-1.0 if C[c][c] < 0.0 else 1.0 for c in _SURFACES]
        self.shares = np.zeros(N_CHANNELS, np.float32)

    def receive(self, message: np.void) -> None:
        """Take an HIL_ACTUATOR_CONTROLS, of dtype `codec.ACTUATORS`.

        Of one that is not armed all outputs are off, whatever their values.
        """
        self.shares[:] = 0.0
        if not message["mode"] & MAV_MODE_FLAG_SAFETY_ARMED:
            return
        values = np.nan_to_num(message["controls"]).tolist()  # an output that is no number is off
        for c, sign, outputs in zip(_SURFACES, self._signs, self._config.surfaces, strict=True):
            if outputs:
                shares = [servo_share(values[one.output - 1], one) for one in outputs]
                self.shares[c] = sign * sum(shares) / len(shares)
        motor = self._config.throttle
        self.shares[THROTTLE] = motor_share(values[motor.output - 1], motor)


def servo_share(value: float, servo: ServoOutput) -> float:
    """Return which share of a surface's full moment an output commands, from -1 to 1.

    Positive is to the right, or nose up. On each side of the middle the value counts by that side.
    """
    off = value - servo.middle
    side = servo.greatest - servo.middle if off > 0.0 else servo.middle - servo.least
    share = min(max(off / side, -1.0), 1.0)
    return -share if servo.reversed else share


def motor_share(value: float, motor: MotorOutput) -> float:
    """Return which share of the full thrust an output commands, from 0 to 1."""
    return min(max((value - motor.off) / (motor.full - motor.off), 0.0), 1.0)
